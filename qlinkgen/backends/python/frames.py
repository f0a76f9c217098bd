"""Views of frames for the templates: names, numbers and expressions, one for each kind of receiver."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import assert_never

from qlinkgen.backends.python import integers, pieces
from qlinkgen.backends.python.coding import CodingView, coding_view
from qlinkgen.backends.python.layout import in_hex, literal, slice_of, wrapped
from qlinkgen.backends.python.names import attribute, class_name
from qlinkgen.backends.python.ways import Ways
from qlinkgen.model.checksum import Algorithm, Checksum, Fletcher, Sum, Xor, catalogue
from qlinkgen.model.frame import Silence
from qlinkgen.model.integer import ByteOrder
from qlinkgen.model.message import Direction
from qlinkgen.model.naming import address_argument, address_attribute
from qlinkgen.plan.check import Check
from qlinkgen.plan.ends import ByLength, ByMark, ByMessage, ByTerminator, Hunt, InStep, Marks, Rescan
from qlinkgen.plan.envelope import Envelope
from qlinkgen.plan.parts import (
    AddressPart,
    BlocksPart,
    CellPart,
    CheckPart,
    ConstantPart,
    EqualPart,
    IdPart,
    LengthPart,
    MarkPart,
    Part,
    PayloadPart,
    Seed,
)
from qlinkgen.plan.transparency import Coded, FrameStuffing, PayloadStuffing, Plain, SevenBit
from qlinkgen.plan.tree import MessagePlan, Plan


@dataclass(frozen=True)
class DecodedDirection:
    """A decoded direction: its function, its word in texts, and the names of its tables.

    ``asking`` is the parameter of the function for the request, "" if no answer needs it.
    """

    direction: Direction
    function: str
    words: str
    classes: str
    readers: str
    asking: str
    by_id: str
    readers_by_id: str
    #: The function that decodes one frame, and what the decoder of a stream uses.
    decode: str = "_decode"
    ways: Sequence[str] = ()


@dataclass(frozen=True)
class CheckView:
    """The check value of a frame.

    Attributes:
        definition: statement that defines the algorithm.
        size: size on the wire.
        order: byte order of a value that is sent whole, "" if bits are omitted.
        bytes: expression for the bytes of the number ``crc``.
        selectable: another algorithm of the catalogue can replace it.
        maker: function of the support module that the definition calls.
    """

    definition: list[str]
    size: int
    order: str
    bytes: str
    selectable: bool
    maker: str


@dataclass(frozen=True)
class AddressView:
    """The address of a frame.

    Attributes:
        name: attribute of the messages.
        parameter: name of the parameter of ``from_bytes``.
        bytes: expression for the bytes of the part with ``number``, "" if the address shares a marked byte.
        default: the default address.
        limit: the greatest address, "" if the bytes hold no greater one.
    """

    name: str
    parameter: str
    bytes: str
    default: int
    limit: str = ""


@dataclass(frozen=True)
class UniqueView:
    """A frame with a preamble that occurs nowhere else."""

    title: str
    idle: tuple[float, float] | None
    check: CheckView
    address: AddressView | None
    preamble: str
    mark: str
    insert: str
    header: int
    overhead: int
    length_end: int
    uncounted: int
    min_length: int
    max_length: int
    body_start: int
    payload_of_body: str
    id_at: int
    blank_header: str
    trailer: int
    whole_sizes: Sequence[int]
    prefix: str
    check_letter: str

    template = "unique"


@dataclass(frozen=True)
class HeadCheck:
    """A condition for bytes that do not begin a frame, in wire order, and the result of ``_split``.

    Attributes:
        fault: "number", "address" or "constant" if only a decoder of one whole frame reports it.
        whole: the condition for a whole header, "" if decoding its message finds the same.
    """

    test: str
    found: str
    fault: str = ""
    whole: str = ""


@dataclass(frozen=True)
class LengthView:
    """The length of a frame: bounds, offsets, its value in ``head`` and the bytes of ``number``.

    Attributes:
        quick: the same value; raises an IndexError if the header is too short, unless ``sliced``.
        sliced: if the header is too short, ``quick`` is a wrong number.
        bounded: its part holds numbers beyond the bounds.
    """

    bias: int
    least: int
    most: int
    start: int
    end: int
    value: str
    quick: str
    sliced: bool
    bytes: str
    scale: int
    bounded: bool


@dataclass(frozen=True)
class StuffingView:
    """Stuffing of ``whole`` frames except their first and last bytes, or of payloads only."""

    whole: bool
    after: str
    insert: str
    front: int
    back: int


@dataclass(frozen=True)
class EndedView:
    """A terminator, and the coding of the bytes before it.

    Attributes:
        last: its last byte.
        pair: its first byte if that also begins pairs of coded bytes, otherwise "".
        kept: number of its bytes that may begin the next frame.
        closing: size of the terminator and what follows it.
        after: size of what follows it.
        limit: maximum size of a frame up to its terminator.
        lead: size of the constant at the beginning.
        front: number of uncoded bytes at the beginning.
        back: number of uncoded bytes at the end.
        splits: uncoded bytes are not only the first constant and the terminator.
        least: minimum size of a payload.
        lines: a frame begins only after a terminator.
        flag: the terminator is also the beginning of a frame.
        checks: conditions for wrong bytes, and the kind of fault.
        coding: None if bytes are sent as they are.
    """

    terminator: str
    last: str
    pair: str
    kept: int
    closing: int
    after: int
    limit: int
    lead: int
    front: int
    back: int
    splits: bool
    least: int
    lines: bool
    flag: bool
    checks: Sequence[tuple[str, str]]
    coding: CodingView | None


@dataclass(frozen=True)
class PlacedCheck:
    """A check value, its offsets in the frame, and the expression for the bytes that it covers.

    Attributes:
        mark: what the names of its functions end with, "" for the main one.
        seeded: it covers attributes of the message.
        main: another algorithm can replace it.
        early: it is verified before the payload.
        result: statement that computes the value of a whole frame with `message` and `checksum`.
        wrong: condition for another value in the frame.
        case: the call that makes received digits upper case, "" if there are none.
    """

    name: str
    view: CheckView
    start: str
    end: str
    covered: str
    otherwise: int | None
    mark: str
    seeded: bool
    main: bool
    early: bool
    result: str
    wrong: str
    case: str


@dataclass(frozen=True)
class BlocksView:
    """The check values of the blocks of a payload."""

    every: int
    view: CheckView


@dataclass(frozen=True)
class PartsView:
    """Any other delimited frame.

    Attributes:
        checks: the check values in wire order.
        filling: the same in the order in which they are computed.
        seeds: attributes of message classes that check values cover.
        blank: the zeros of the check value at the end of the frame, "" if something else is there.
        trim: bytes of a payload that are sent even if they are zeros at its end, None if all are.
    """

    title: str
    checks: Sequence[PlacedCheck]
    filling: Sequence[PlacedCheck]
    blank: str
    trim: int | None
    seeds: Sequence[str]
    blocks: BlocksView | None
    address: AddressView | None
    length: LengthView | None
    stuffing: StuffingView | None
    ended: EndedView | None
    idle: tuple[float, float] | None
    preamble: str
    begins_with: str
    header: int
    trailer: int
    max_frame: int
    max_payload: int
    blank_header: str
    blank_trailer: str
    id_start: str
    id_of: str
    id_of_frame: str
    address_of: str
    bare: bool
    verified: bool
    head_checks: Sequence[HeadCheck]
    values: Sequence[str]
    counter: str
    tail_tests: Sequence[str]

    template = "delimited"

    @property
    def main(self) -> PlacedCheck | None:
        """The main check value, None if there is none."""
        return next((each for each in self.checks if each.main), None)

    @property
    def check(self) -> CheckView | None:
        """The algorithm of the main check value, None if there is none."""
        return self.main.view if self.main else None

    @property
    def quick(self) -> bool:
        """Whether a whole frame can be cut out at once: its end and its bytes are not coded."""
        return not (self.ended or self.blocks or (self.stuffing and self.stuffing.whole))

    @property
    def announced(self) -> bool:
        """Whether a whole header with the right constants and length makes the decoder wait for its frame."""
        early = any(each.early for each in self.checks)
        others = any(each.fault and not each.whole for each in self.head_checks)
        return self.quick and self.length is not None and not early and not others

    @property
    def no_frame(self) -> Sequence[HeadCheck]:
        """The conditions for bytes that do not begin a frame."""
        return [each for each in self.head_checks if each.fault]


@dataclass(frozen=True)
class MarkedView:
    """A frame whose header and end have a marker bit."""

    title: str
    check: CheckView | None
    address: AddressView
    marker: str
    address_shift: int
    address_mask: str
    id_shift: int
    id_mask: str
    end: int
    most: int
    checked_default: bool

    template = "marked"


@dataclass(frozen=True)
class PacketView:
    """Packets, which have no delimiter."""

    title: str
    requests: str
    responses: str
    check_size: int = 0
    check_bytes: str = ""
    check_mask: str = ""
    word: int = 1
    total: str = ""
    rejected: str = ""

    template = "packet"


FrameView = UniqueView | PartsView | MarkedView | PacketView


def view_of(plan: Plan, title: str, sizes: Sequence[int]) -> FrameView:
    """The view of the frame of a protocol; ``sizes`` are those of bodies of constant size."""
    receiver = plan.frame.receiver
    match receiver:
        case Hunt():
            return _unique(plan, receiver, title, sizes)
        case Rescan():
            return _parts(plan, receiver, title)
        case Marks():
            return _marked(plan, title)
        case InStep():
            return _packet(plan, title)
        case _:
            assert_never(receiver)


# Unknown requests


@dataclass(frozen=True)
class UnknownView:
    """The reply to a request with an unknown number: its class, and the arguments of that.

    Attributes:
        number: the number in ``frame``.
        address: the address in it, "" if there is none.
        added: what the number of the reply adds to that of the request, None if it has one of its own.
        most: the greatest number.
        by_message: the message tells the end of a frame, so a silence tells that of an unknown one.
    """

    reply: str
    arguments: str
    number: str
    address: str
    added: int | None
    most: str
    by_message: bool


def unknown_view(plan: Plan) -> UnknownView | None:
    """The reply to a request with an unknown number, None if the decoder is not one of requests."""
    unknown = plan.protocol.to_unknown
    if (
        unknown is None
        or "request" not in plan.received_directions
        or unknown.message.name not in plan.by_name
    ):
        return None
    frame = plan.frames["request"]
    envelope, address = frame.envelope, plan.frame.address
    arguments = [f"{address_attribute(address)}=node or 0"] if address else []
    arguments += [f"{attribute(name)}={raw}" for name, raw in unknown.raws]
    return UnknownView(
        reply=class_name(plan.by_name[unknown.message.name]),
        arguments=", ".join(arguments),
        number=pieces.number(envelope, envelope.id, "frame"),
        address=pieces.number(envelope, envelope.address, "frame") if envelope.address else "",
        added=unknown.added,
        most=in_hex((1 << sum(each.bits for each in envelope.id)) - 1),
        by_message=isinstance(frame.end, ByMessage),
    )


# Directions


def decoded_directions(plan: Plan, ways: Ways) -> list[DecodedDirection]:
    """Functions and tables for each decoded direction."""
    return [_decoded_direction(plan, direction, ways) for direction in plan.received_directions]


def _decoded_direction(plan: Plan, direction: Direction, ways: Ways) -> DecodedDirection:
    messages = plan.received(direction)
    whole = direction == "message"
    upper = "" if whole else f"_{direction.upper()}"
    return DecodedDirection(
        direction=direction,
        function="decode" if whole else f"decode_{direction}",
        words="" if whole else f"{direction} ",
        classes="_MESSAGES" if whole else f"{upper}S",
        readers=f"{upper}_READERS",
        asking=", request: Message | None = None" if direction == "response" and plan.asked else "",
        by_id=_by_id(messages),
        readers_by_id=_by_id(messages, ".from_checked"),
        decode=ways.of("_decode", direction),
        ways=[ways.of(name, direction) for name in ("_split", "_judge", "_MAX_FRAME", "_whole")],
    )


def _by_id(messages: Sequence[MessagePlan], attribute: str = "") -> str:
    """A dict of message classes, or of one of their attributes, by message id."""
    rows = (f"{in_hex(each.id)}: {class_name(each)}{attribute}" for each in messages)
    return f"{{{', '.join(rows)}}}"


# Parts of views


def check_view(check: Check, mark: str = "") -> CheckView:
    """The view of a check value."""
    algorithm = check.algorithm
    selectable = isinstance(algorithm, Algorithm) and algorithm.width == 16
    maker, arguments = _algorithm(algorithm)
    definition = wrapped(f"_CHECKSUM{mark} = {maker}(", arguments, ")", 0)
    return CheckView(definition, check.size, check.regular or "", _check_bytes(check), selectable, maker)


def _algorithm(algorithm: Checksum) -> tuple[str, list[str]]:
    """The function of the support module that makes an algorithm, and its arguments."""
    name = f'"{algorithm.name}"'
    init = [] if not algorithm.init else [f"init={algorithm.init}"]
    match algorithm:
        case Sum():
            form = [] if algorithm.form == "plain" else [f'"{algorithm.form}"']
            if algorithm.carry:
                return "carried", [name, *form, *init]
            return "sum_of", [name, str(algorithm.width), *form, *init]
        case Xor():
            return "xor_of", [name, *init]
        case Fletcher(width=32, modulus=65521):
            return "adler", [name, *([] if algorithm.init == 1 else [f"init={algorithm.init}"])]
        case Fletcher():
            return "fletcher", [name, str(algorithm.half), str(algorithm.modulus), *init]
        case Algorithm(width=16) if algorithm in catalogue(16):
            return "find_crc", [name]
        case Algorithm():
            return "crc", [name, *_parameters(algorithm)]
        case _:
            assert_never(algorithm)


def _parameters(algorithm: Algorithm) -> list[str]:
    digits = (algorithm.width + 3) // 4
    numbers = {key: f"0x{getattr(algorithm, key):0{digits}X}" for key in ("poly", "init", "xorout")}
    return [
        f"width={algorithm.width}",
        f"poly={numbers['poly']}",
        f"init={numbers['init']}",
        f"refin={algorithm.refin}",
        f"refout={algorithm.refout}",
        f"xorout={numbers['xorout']}",
    ]


def _check_bytes(check: Check, number: str = "crc") -> str:
    """Expression for the wire bytes of a check value."""
    if check.value.digits:
        return f'b"%0{check.size}X" % {number}'
    if check.regular:
        return f'{number}.to_bytes({check.size}, "{check.regular}")'
    groups = [integers.group_out(number, chunk) for chunk in check.value.chunks]
    return f"bytes(({', '.join(groups)}{',' if len(groups) == 1 else ''}))"


def _address_view(plan: Plan) -> AddressView | None:
    if not plan.frame.address:
        return None
    nodes = plan.protocol.bus.nodes
    bits = next(iter(plan.frame.envelope.address), None)
    placed = f"number << {bits.shift}" if bits and bits.shift else "number"
    if bits and (others := _blank_number(bits.part)):
        placed = f"{placed} | 0x{others:X}"
    placed = placed if placed == "number" else f"({placed})"
    return AddressView(
        name=address_attribute(plan.frame.address),
        parameter=address_argument(plan.frame.address),
        bytes=integers.to_bytes(bits.part.integer, placed) if bits else "",
        default=nodes[0] if nodes else 0,
        limit=f"0x{bits.mask:X}" if bits and not bits.whole else "",
    )


def _blank_header(envelope: Envelope, start: int, address: AddressView | None) -> str:
    """A header for decoding a payload; only its address is used."""
    return _blank(envelope, envelope.front, address, start) or "bytes(0)"


def _blank(envelope: Envelope, parts: Sequence[Part], address: AddressView | None, start: int = 0) -> str:
    """Adjacent parts from an offset on: defaults of values, the address in its place, zeros."""
    numbers = (
        (part.size, part.integer.pack(_blank_number(part)) if isinstance(part, CellPart) else b"")
        for part in parts
    )
    data = b"".join(packed or bytes(size) for size, packed in numbers)[start:]
    part = next((bits.part for bits in envelope.address if bits.part in parts), None)
    if part is None or address is None:
        return _zeros(data)
    before = sum(each.size for each in parts[: parts.index(part)]) - start
    return " + ".join(
        filter(
            None,
            (
                _zeros(data[:before]),
                f"_address(cls, {address.parameter})",
                _zeros(data[before + part.size :]),
            ),
        )
    )


def _zeros(data: bytes) -> str:
    """Bytes as an expression, "" without any."""
    return (literal(data) if any(data) else f"bytes({len(data)})") if data else ""


def _blank_number(part: Part) -> int:
    """The integer of a part with the defaults of its values, and without anything else."""
    if not isinstance(part, CellPart):
        return 0
    return sum((each.number.default & each.number.integer.mask) << each.shift for each in part.values)


def _unique(plan: Plan, receiver: Hunt, title: str, sizes: Sequence[int]) -> UniqueView:
    envelope = plan.frame.envelope
    length, number, check = envelope.length, envelope.id, envelope.check
    assert length is not None
    assert check is not None
    letter = _check_letter(check.check, plan.protocol.byteorder)
    end = envelope.offset(length) + 1
    address = _address_view(plan)
    return UniqueView(
        title=title,
        idle=_idle(plan.frame.idle),
        check=check_view(check.check),
        address=address,
        preamble=literal(envelope.preamble),
        mark=in_hex(receiver.mark),
        insert=in_hex(receiver.insert),
        header=envelope.header_size,
        overhead=envelope.overhead,
        length_end=end,
        uncounted=envelope.overhead - length.bias,
        min_length=length.least,
        max_length=length.most,
        body_start=len(envelope.preamble),
        payload_of_body=slice_of(
            "body", str(envelope.header_size - len(envelope.preamble)), str(-envelope.trailer_size)
        ),
        id_at=envelope.offset(number[0].part),
        blank_header=_blank_header(envelope, end, address),
        trailer=envelope.trailer_size,
        whole_sizes=sizes if letter else (),
        prefix=">" if plan.protocol.byteorder == "big" else "<",
        check_letter=letter,
    )


def _check_letter(check: Check, byteorder: ByteOrder) -> str:
    """Format of the check value in the byte order of the module, "" if struct has none."""
    if check.size > 1 and check.regular != byteorder:
        return ""
    return {1: "B", 2: "H", 4: "I"}.get(check.size, "")


def wrap_lines(view: UniqueView, fixed: int | None) -> list[str]:
    """The last step of an encoder; ``fixed`` is the size of the body if it is constant."""
    size = view.check.size
    parts = [f"crc >> {8 * index}" if index else "crc" for index in range(size)]
    tests = [
        f"{part} == _MARK" if index == size - 1 else f"{part} & 0xFF == _MARK"
        for index, part in enumerate(parts)
    ]
    last = f'return _PREAMBLE + body + crc.to_bytes({size}, "{view.check.order}")'
    if fixed is not None and view.check_letter:
        last = f"return _WHOLE_{fixed}(_PREAMBLE, body, crc)"
    return [
        "crc = _crc(body, _crc_start)",
        f"if _MARK in body or {' or '.join(reversed(tests))}:",
        "    return _stuffed(body, crc)",
        last,
    ]


# Any other delimited frame


def _parts(plan: Plan, receiver: Rescan, title: str) -> PartsView:
    envelope = plan.frame.envelope
    address = _address_view(plan)
    length = _length_view(plan, envelope)
    checks, filling = _all_placed(envelope, early=not isinstance(plan.frame.end, ByTerminator))
    last = envelope.parts[-1]
    return PartsView(
        title=title,
        checks=checks,
        filling=filling,
        blocks=BlocksView(envelope.blocks.every, check_view(envelope.blocks.check, "_BLOCKS"))
        if envelope.blocks
        else None,
        blank=literal(bytes(last.size)) if isinstance(last, CheckPart) else "",
        trim=envelope.payload.trim,
        seeds=sorted({seed_name(seed) for part in envelope.checks for seed in envelope.seeds(part)}),
        address=address,
        length=length,
        stuffing=_stuffing(plan),
        idle=_idle(plan.frame.idle),
        ended=_ended(plan, plan.frame.end, bare=receiver.bare)
        if isinstance(plan.frame.end, ByTerminator)
        else None,
        preamble=literal(envelope.preamble) if envelope.preamble else "",
        begins_with=envelope.preamble.hex(" "),
        header=envelope.header_size,
        trailer=envelope.trailer_size,
        max_frame=plan.frame.longest,
        max_payload=envelope.payload.most,
        blank_header=_blank_header(envelope, 0, address),
        blank_trailer=_blank_trailer(envelope, address),
        id_start=_id_start(envelope),
        id_of=pieces.number(envelope, envelope.id, "head"),
        id_of_frame=_quick_id(envelope),
        address_of=pieces.number(envelope, envelope.address, "head") if _leads(envelope) else "",
        bare=receiver.bare,
        verified=receiver.verified,
        head_checks=list(_head_checks(plan, envelope, bare=receiver.bare)),
        values=[attribute(member.name) for _, member in envelope.values],
        counter=_counter(plan),
        tail_tests=[test for part in envelope.back for test in _tail_tests(envelope, part)],
    )


def _blank_trailer(envelope: Envelope, address: AddressView | None) -> str:
    """A trailer for decoding a payload."""
    holds = any(isinstance(part, CellPart) and part.values for part in envelope.back)
    return _blank(envelope, envelope.back, address) if holds or _trails(envelope) else "bytes(_TRAILER)"


def _counter(plan: Plan) -> str:
    """The counter of frames as a tuple, "" if there is none."""
    counter = plan.protocol.counter
    if counter is None or counter.counting is None:
        return ""
    facts = (attribute(counter.name), 1 << counter.bits, counter.counting.per_frame, counter.counting.echo)
    return f'("{facts[0]}", {facts[1]}, {facts[2]}, {facts[3]})'


def _trails(envelope: Envelope) -> bool:
    """Whether the address follows the payload."""
    return any(bits.part in envelope.back for bits in envelope.address)


def _leads(envelope: Envelope) -> bool:
    """Whether the address precedes the payload."""
    return bool(envelope.address) and not _trails(envelope)


def _id_start(envelope: Envelope) -> str:
    """The offset of the message number, for error texts."""
    if not envelope.id:
        return "0"
    part = envelope.id[0].part
    return str(envelope.offset(part)) if part in envelope.front else f"len(frame) - {envelope.from_end(part)}"


def _tail_tests(envelope: Envelope, part: Part) -> Iterator[str]:
    """Conditions that hold if a part after the payload is wrong."""
    if isinstance(part, ConstantPart):
        yield f"not frame[{-envelope.from_end(part)}:].startswith({literal(part.data)})"
    yield from pieces.wrong(envelope, part, "frame")


def _idle(silence: Silence | None) -> tuple[float, float] | None:
    return (float(silence.byte_times), float(silence.seconds)) if silence else None


def _ended(plan: Plan, end: ByTerminator, *, bare: bool) -> EndedView:
    envelope, coded, part = plan.frame.envelope, plan.frame.transparency, end.part
    assert isinstance(coded, Coded)
    lead, closing = len(envelope.preamble), part.size + end.after
    return EndedView(
        terminator=literal(part.data),
        last=literal(part.data[-1:]),
        pair=literal(part.data[:1]) if end.paired is not None else "",
        kept=plan.frame.kept,
        closing=closing,
        after=end.after,
        limit=plan.frame.max_wire - end.after,
        lead=lead,
        front=coded.front,
        back=coded.back,
        splits=(coded.front, coded.back) != (lead, closing),
        least=envelope.payload.least,
        lines=plan.frame.lines,
        flag=bool(plan.frame.flag),
        checks=list(_ended_checks(envelope, bare=bare)),
        coding=coding_view(coded.stages) if coded.stages else None,
    )


def _ended_checks(envelope: Envelope, *, bare: bool) -> Iterator[tuple[str, str]]:
    """The checks of a decoded frame in wire order, without its check values."""
    for part in envelope.front[int(bool(envelope.preamble)) :]:
        start = envelope.offset(part)
        match part:
            case ConstantPart():
                yield f"frame[{start}:{start + part.size}] != {literal(part.data)}", "frame"
            case LengthPart():
                counted = f"len(frame) - {envelope.overhead - part.bias}"
                seen = pieces.read(envelope, part, "frame")
                yield f"{seen}{f' * {part.scale}' if part.scale > 1 else ''} != {counted}", "length"
            case IdPart() | AddressPart() | CellPart() | EqualPart():
                yield from ((test, "frame") for test in pieces.wrong(envelope, part, "frame"))
                if bare and envelope.identifies(part) and envelope.known_at(part, envelope.id):
                    if any(bits.part is part for bits in envelope.id) or not envelope.id:
                        yield "_number(frame) not in known", "unknown"
                    if envelope.address and envelope.known_at(part, envelope.address):
                        yield "not _allowed(frame, known)", "range"
            case CheckPart():
                pass
            case MarkPart() | PayloadPart() | BlocksPart():
                raise AssertionError(f"{part.name} is not a part of a header")
            case _:
                assert_never(part)


def _length_view(plan: Plan, envelope: Envelope) -> LengthView | None:
    if not isinstance(plan.frame.end, ByLength):
        return None
    part = plan.frame.end.part
    start = envelope.offset(part)
    return LengthView(
        bias=part.bias,
        least=part.least * part.scale,
        most=part.most * part.scale,
        start=start,
        end=start + part.size,
        value=pieces.read(envelope, part, "head") + (f" * {part.scale}" if part.scale > 1 else ""),
        quick=_quick_length(part, start),
        sliced=integers.is_sliced(part.integer),
        bytes=integers.to_bytes(part.integer, "number"),
        scale=part.scale,
        bounded=(part.least, part.most) != (0, part.integer.mask),
    )


def _quick_length(part: LengthPart, start: int) -> str:
    read = integers.read_bytewise(part.integer, "head", start)
    if part.scale == 1:
        return read
    return f"({read}) * {part.scale}" if "|" in read else f"{read} * {part.scale}"


def _quick_id(envelope: Envelope) -> str:
    """The message number in a whole frame."""
    bits = envelope.id[0] if len(envelope.id) == 1 else None
    if bits and bits.whole and not bits.at and bits.part in envelope.front:
        return integers.read_bytewise(bits.part.integer, "frame", envelope.offset(bits.part))
    return pieces.number(envelope, envelope.id, "frame")


def _stuffing(plan: Plan) -> StuffingView | None:
    transparency = plan.frame.transparency
    match transparency:
        case Plain() | SevenBit() | Coded():
            return None
        case FrameStuffing():
            whole, front, back = True, transparency.front, transparency.back
        case PayloadStuffing():
            whole, front, back = False, 0, 0
        case _:
            assert_never(transparency)
    rule = transparency.rule
    return StuffingView(whole, literal(rule.after), literal(bytes((rule.insert,))), front, back)


def _head_checks(plan: Plan, envelope: Envelope, *, bare: bool) -> Iterator[HeadCheck]:
    """The checks of a header, part by part, as far as received."""
    no_frame = '"no_frame", start, b""'
    for part in envelope.front:
        start, end = envelope.offset(part), envelope.offset(part) + part.size
        match part:
            case ConstantPart():
                test = f"not {literal(part.data)}.startswith(head[{start}:{end}])"
                yield HeadCheck(
                    test, no_frame, "constant", f"head[{start or ''}:{end}] != {literal(part.data)}"
                )
            case LengthPart():
                whole = isinstance(plan.frame.transparency, FrameStuffing)
                place = f"_take(buf, start, {end})[1]" if whole else f"start + {end}"
                bounds = "_MIN_LENGTH <= _length(head) <= _MAX_LENGTH"
                yield HeadCheck(f"len(head) >= {end} and not {bounds}", f'"length", {place}, b""')
            case IdPart() | AddressPart() | CellPart() | EqualPart():
                for test in pieces.wrong(envelope, part, "head"):
                    yield HeadCheck(f"len(head) >= {end} and {test}", no_frame, "constant", test)
                if bare and envelope.identifies(part) and envelope.known_at(part, envelope.id):
                    yield from _bare_checks(envelope, part, f"len(head) >= {end} and", no_frame)
            case CheckPart():
                pass
            case MarkPart() | PayloadPart() | BlocksPart():
                raise AssertionError(f"{part.name} is not a part of a header")
            case _:
                assert_never(part)


def _bare_checks(envelope: Envelope, part: Part, reached: str, no_frame: str) -> Iterator[HeadCheck]:
    """The checks of message number and address, as far as known after a part."""
    if any(bits.part is part for bits in envelope.id) or not envelope.id:
        yield HeadCheck(f"{reached} _number(head) not in known", no_frame, "number")
    if envelope.address and envelope.known_at(part, envelope.address):
        yield HeadCheck(f"{reached} not _allowed(head, known)", no_frame, "address")


def placed(envelope: Envelope, part: CheckPart, mark: str, *, early: bool) -> PlacedCheck:
    """The view of a check value."""
    covered = " + ".join(
        f"message.{seed_name(run)}"
        if isinstance(run, Seed)
        else f"frame[{_edge(envelope, run[0])}:{_edge(envelope, run[-1], after=True)}]"
        for run in envelope.coverage(part)
    )
    view = check_view(part.check, mark)
    start, end = _edge(envelope, part), _edge(envelope, part, after=True)
    seeded, main = part in envelope.seeded, part is envelope.check
    checksum = "checksum" if main else f"_CHECKSUM{mark}"
    case = ".upper()" if part.check.value.digits else ""
    if view.order and view.size <= 2 and part.check.otherwise is None:
        place = int(start or "0")
        sent = integers.joined("frame", range(place, place + view.size), view.order)
        result = f"crc = {checksum}.compute({covered}, {checksum}.start)"
        wrong = f"crc != {sent}"
    else:
        given = f"frame{', message' if seeded else ''}{', checksum' if main else ''}"
        result = f"right = _check{mark}({given})"
        wrong = f"right != frame[{start}:{end}]{case}"
    return PlacedCheck(
        name=part.name,
        view=view,
        start=start,
        end=end,
        covered=covered,
        otherwise=part.check.otherwise,
        mark=mark,
        seeded=seeded,
        main=main,
        early=early and part in envelope.header_checks,
        result=result,
        wrong=wrong,
        case=case,
    )


def _all_placed(envelope: Envelope, *, early: bool) -> tuple[list[PlacedCheck], list[PlacedCheck]]:
    """The views of all check values in wire order, and in the order in which they are computed.

    ``early``: those of the header alone are verified before the payload.
    """
    others = [part for part in envelope.checks if part is not envelope.check]
    views = {
        part.name: placed(envelope, part, f"_{others.index(part) + 2}" if part in others else "", early=early)
        for part in envelope.checks
    }
    return list(views.values()), [views[part.name] for part in envelope.filling]


def seed_name(seed: Seed) -> str:
    """The attribute of a message class that holds the bytes of a seed."""
    return f"SEED_{seed.attribute.upper()}"


def _edge(envelope: Envelope, part: Part, *, after: bool = False) -> str:
    """The beginning or end of a part in a slice of the frame."""
    if part is envelope.payload:
        place = -envelope.trailer_size if after else envelope.header_size
    elif part in envelope.front:
        place = envelope.offset(part) + (part.size if after else 0)
        return str(place) if place else ""
    else:
        place = -envelope.from_end(part) + (part.size if after else 0)
    return str(place) if place else ""


# Marked frames and packets


def _marked(plan: Plan, title: str) -> MarkedView:
    end = plan.frame.end
    assert isinstance(end, ByMark)
    assert end.end.end_id is not None
    check, address = plan.frame.check, _address_view(plan)
    assert address is not None
    return MarkedView(
        title=title,
        check=check_view(check) if check else None,
        address=address,
        marker=in_hex(end.header.marker),
        address_shift=end.header.address.shift,
        address_mask=in_hex(end.header.address.mask),
        id_shift=end.header.id.shift,
        id_mask=in_hex(end.header.id.mask),
        end=end.end.end_id,
        most=plan.frame.max_payload + (check.size if check else 0),
        checked_default=all(message.checked for message in plan.messages),
    )


def _packet(plan: Plan, title: str) -> PacketView:
    check = plan.frame.check
    requests = _by_id([message for message in plan.messages if message.direction != "response"])
    responses = _by_id([message for message in plan.messages if message.direction == "response"])
    if check is None:
        return PacketView(title, requests, responses)
    assert isinstance(check.algorithm, Sum)
    return PacketView(
        title=title,
        requests=requests,
        responses=responses,
        check_size=check.size,
        check_bytes=_check_bytes(check, "check"),
        check_mask=f"0x{check.algorithm.mask:X}",
        word=check.word,
        total={"plain": "total", "inverted": "~total", "zero": "-total"}[check.algorithm.form],
        rejected="" if check.rejected is None else f"0x{check.rejected:0{check.size * 2}X}",
    )
