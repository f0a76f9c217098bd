"""Views of delimited frames for the templates: conditions and statements as text."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.c.check_values import BlocksView, ValueView
from qlinkgen.backends.c.coding import EndedView, stage_views
from qlinkgen.backends.c.conditional import ConditionalView
from qlinkgen.backends.c.crc import CheckView
from qlinkgen.backends.c.layout import Layouts
from qlinkgen.backends.c.names import storage, unsigned_type
from qlinkgen.backends.c.parts import PartWriter, length_bounds
from qlinkgen.backends.c.places import id_bits, in_hex, sender_of
from qlinkgen.backends.c.text_ids import numbering
from qlinkgen.plan.coding import Add, Insertion
from qlinkgen.plan.ends import ByMessage, ByTerminator, Gaps, Hunt, InStep, Marks, Rescan
from qlinkgen.plan.framing import FramePlan
from qlinkgen.plan.transparency import Coded, FrameStuffing, PayloadStuffing, Plain, SevenBit
from qlinkgen.plan.tree import Plan


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameView:
    """The view of every frame, `f` in templates.

    Attributes:
        bare: frames do not begin with a constant.
        checks_header: message id and address in the header distinguish a frame from noise.
        sized_by_message: the end of a frame follows from its message.
        body_size: size of the buffer for decoding a frame.
        check_optional: only some messages have a check value.
        max_wire: size of the buffer of a receiver for whole frames, 0 for other receivers.
    """

    id: str
    id_type: str
    id_bits: int
    address: str
    address_type: str
    identity: str
    parameters: str
    arguments: str
    has_values: bool
    needs_direction: bool
    scan_direction: str
    init_direction: str
    pass_direction: str
    pass_decode_direction: str
    direction_unused: bool
    check_name: str
    bare: bool
    checks_header: bool
    sized_by_message: bool
    body_size: int
    check_optional: bool
    max_wire: int
    #: The function that finds the id with which a payload begins, and its call; none if parts hold ids.
    numbering: Sequence[str] = ()
    identify: str = ""
    idle: tuple[int, int] | None
    broken: bool


def own_prefix(prefix: str, way: str) -> str:
    """What the names of functions begin with that are about the frames of a direction alone."""
    return f"{prefix}_{way}" if way else prefix


def frame_view(
    plan: Plan,
    frame: FramePlan | None = None,
    *,
    body_size: int = 0,
    check_optional: bool = False,
    max_wire: int = 0,
) -> FrameView:
    """What every frame has; ``frame`` is that of a direction."""
    frame = frame or plan.frame
    prefix, receiver = plan.protocol.name, frame.receiver
    sender = sender_of(frame, prefix)
    ring, known = plan.protocol.directions == ("message",), directed(plan)
    answered = "request_check" if isinstance(receiver, InStep) else "request_check or _response_check"
    return FrameView(
        id=sender.id,
        id_type=sender.id_type,
        id_bits=id_bits(plan.frame),
        address=sender.address,
        address_type=sender.address_type,
        identity=sender.identity,
        parameters=sender.parameters,
        arguments=sender.arguments,
        has_values=bool(sender.values_type),
        needs_direction=known,
        scan_direction=f"{prefix}_direction_t direction, " if known else "",
        init_direction=f", {prefix}_direction_t direction" if known else "",
        pass_direction="receiver->direction, " if known else "",
        pass_decode_direction="direction, " if known else "",
        direction_unused=known and not _uses_direction(frame),
        check_name="message_check" if ring else answered,
        bare=isinstance(receiver, Rescan) and receiver.bare,
        checks_header=frame.checks_header,
        sized_by_message=isinstance(receiver, Hunt | Rescan)
        and any(isinstance(each.end, ByMessage) for each in frame.every),
        body_size=body_size,
        check_optional=check_optional,
        max_wire=max_wire,
        idle=_idle(plan),
        broken=plan.frame.idle is not None and plan.frame.idle.broken,
    )


def _idle(plan: Plan) -> tuple[int, int] | None:
    """Bits and microseconds of a silence that ends a frame, or of a break that begins one."""
    silence = plan.frame.idle
    if silence is None:
        return None
    bits = math.ceil(silence.byte_times * plan.protocol.bus.bits_per_byte)
    return bits, math.ceil(silence.seconds * 1_000_000)


def directed(plan: Plan) -> bool:
    """Whether a receiver needs the direction to find the end of a frame or to validate it."""
    receiver = plan.frame.receiver
    match receiver:
        case Hunt() | InStep():
            return False
        case Gaps():
            needed = plan.directed or _uses_direction(plan.frame)
        case Rescan():
            apart = plan.directed or plan.parted
            needed = apart or not receiver.verified or _uses_direction(plan.frame)
        case Marks():
            needed = True
        case _:
            assert_never(receiver)
    return needed and plan.protocol.directions != ("message",)


def _uses_direction(frame: FramePlan) -> bool:
    """Whether a function that finds a frame in bytes depends on its direction."""
    by_message = any(isinstance(each.end, ByMessage) for each in frame.every)
    return frame.checks_header or by_message or frame.seeded or bool(frame.texts)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceView:
    """The place of a payload in a buffer: at offset ``header``, or ending ``tail`` bytes before the end."""

    tailed: bool
    tail: int
    header: int
    overhead: int


@dataclass(frozen=True, slots=True, kw_only=True)
class PartsView:
    """The view of every delimited frame.

    Attributes:
        late_insert: an inserted byte may follow the last byte.
        judged: without a check value, only valid contents confirm a frame; the condition, "" if there is one.
        values: functions for check values, none if the only one is computed in passing.
        judges: statements that verify them.
        most: maximum size of a payload.
        identified_late: message id or address follow the payload.
        unused: the parameter for the message id if frames have none, otherwise "".
        refused_values: conditions that hold if a value of the frame cannot be sent.
        get_values: statements that read the values of a received frame.
    """

    late_insert: bool
    judged: str
    head: int
    tail: int
    header: int
    overhead: int
    most: str
    max_frame: str
    index_type: str
    id_value: str
    address_value: str
    wrong_tail: str
    check_differs: str
    values: list[ValueView]
    judges: list[str]
    blocks: BlocksView | None
    identified_late: bool
    unused: str
    refused_values: list[str]
    get_values: list[str]

    @property
    def reads_tail(self) -> bool:
        """Whether bytes after the payload are read."""
        judged = _name("end", self.judges)
        return bool(self.wrong_tail or self.check_differs or self.identified_late or judged)


def _name(variable: str, lines: Sequence[str]) -> bool:
    """Whether statements use a variable."""
    return any(re.search(rf"\b{variable}\b", line) for line in lines)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlainView:
    """Wrap and scan for frames whose header is sent unstuffed; all lists are statements.

    Attributes:
        header: size of the header, a variable if ``before`` is not None.
        least_header: the same of a frame without the parts of ``before``.
        overhead: bytes before and after the payload of a frame without conditional parts.
        added: number added to each byte of the payload before check values are computed, "" without one.
    """

    header: str
    least_header: int
    overhead: int
    before: ConditionalView | None
    after: ConditionalView | None
    put_header: list[str]
    put_trailer: list[str]
    put_check: list[str]
    fills: list[str]
    update_sent: list[str]
    update_received: list[str]
    head_checks: list[str]
    late_checks: list[str]
    added: str = ""

    @property
    def writes_end(self) -> bool:
        """Whether bytes after the payload are written here."""
        return self.after is not None or _name("end", (*self.put_trailer, *self.put_check, *self.fills))

    @property
    def conditional(self) -> list[ConditionalView]:
        """The parts that only some frames have."""
        return [each for each in (self.before, self.after) if each]


@dataclass(frozen=True, slots=True, kw_only=True)
class StuffedView:
    """Wrap and scan for frames stuffed as a whole; ``lead_checks`` are conditions and bytes needed."""

    lead: int
    lead_bytes: list[str]
    head_and_tail: int
    #: The type of the number of its bytes, the fastest of the chip.
    count_type: str
    covers_body: bool
    check_from_end: int
    put_header: list[str]
    put_trailer: list[str]
    put_check: list[str]
    fills: list[str]
    update_before: list[str]
    update_lead: list[str]
    update_received: list[str]
    lead_checks: list[tuple[str, int]]
    head_checks: list[str]
    stuffed_when_sent: str
    stuffed_when_received: str
    due_when_sent: str
    due_when_received: str
    hunts: bool

    @property
    def writes_end(self) -> bool:
        """Whether bytes after the payload are written before the pass over them."""
        return _name("trailer", (*self.put_trailer, *self.put_check, *self.fills))


@dataclass(frozen=True, slots=True, kw_only=True)
class InsertView:
    """The stuffing rule; the conditions hold if an inserted byte is due."""

    insert: str
    mark: str
    pattern: bool
    due_in_payload: str
    due_at_end: str
    due_in_sent: str


@dataclass(frozen=True, slots=True, kw_only=True)
class HuntView:
    """The receiver that processes each byte once; the length is the first byte of the body."""

    mark: str
    insert: str
    position_type: str
    length_bounds: str
    length_value: str
    whole: str
    before_check: str


@dataclass(frozen=True, slots=True)
class BeginsView:
    """The message ids that frames of a kind begin with, as rows of bytes."""

    starts: Sequence[str]
    size: int


OtherView = (
    CheckView
    | PlaceView
    | PartsView
    | PlainView
    | StuffedView
    | InsertView
    | HuntView
    | EndedView
    | BeginsView
)


@dataclass(frozen=True, slots=True, kw_only=True)
class PartsViews:
    """All views of a delimited frame, by name in templates; None if one does not apply.

    ``crc`` is the algorithm of the only check value, None if there are several or none.
    """

    algorithms: Sequence[CheckView]
    crc: CheckView | None
    f: FrameView
    place: PlaceView
    parts: PartsView
    plain: PlainView | None
    stuffed: StuffedView | None
    inserted: InsertView | None
    hunt: HuntView | None
    ended: EndedView | None
    coded: EndedView | None
    begins: BeginsView | None = None
    turned: bool = False

    @property
    def templates(self) -> tuple[str, ...]:
        """The templates of the functions that wrap a frame and find one; nothing looks for a turned one."""
        if self.turned:
            return "place", "wrap_plain"
        made: tuple[str, ...] = ("wrap_plain", "scan_plain")
        if self.stuffed:
            made = ("wrap_stuffed", "scan_stuffed")
        elif self.ended:
            made = (*(("coding", "wrap_coded") if self.ended.stages else ("wrap_plain",)), "scan_ended")
        elif self.coded:
            made = ("coding", "wrap_coded", "scan_coded")
        return ("place", *(("begins",) if self.begins else ()), "values", *made)

    @property
    def others(self) -> Mapping[str, OtherView | None]:
        """All views except `f`."""
        return {
            "crc": self.crc,
            "begins": self.begins,
            "place": self.place,
            "parts": self.parts,
            "plain": self.plain,
            "stuffed": self.stuffed,
            "inserted": self.inserted,
            "hunt": self.hunt,
            "ended": self.ended,
            "coded": self.coded,
        }


def parts_views(whole: Plan, layouts: Layouts) -> dict[str, PartsViews]:
    """The views of a delimited frame for each direction; "" if both have the same."""
    found = {}
    for way, plan in whole.ways.items():
        writer = _writer(whole, plan.frame, way, layouts)
        body_size = _body_size(writer)
        frame = frame_view(whole, plan.frame, body_size=body_size, max_wire=plan.frame.max_wire)
        found[way] = _parts_views(writer, _numbered(frame, whole, own_prefix(writer.prefix, way)))
    return found


def _numbered(frame: FrameView, whole: Plan, own: str) -> FrameView:
    """The view of a frame, with what finds the ids with which payloads begin; ``own`` is its prefix."""
    if not whole.frame.texts:
        return frame
    passed = frame.pass_decode_direction
    return replace(
        frame,
        numbering=numbering(whole, own, frame.id_type, directed=bool(passed)),
        identify=f"frame->{frame.id} = {own}_number_({passed}frame->payload, frame->size);",
    )


def kind_views(whole: Plan, kind: FramePlan, every: FrameView, layouts: Layouts) -> PartsViews:
    """The views of one of several kinds of frame; ``every`` is that of all."""
    writer = _writer(whole, kind, kind.name, layouts)
    frame = replace(
        every,
        parameters=writer.sender.parameters,
        direction_unused=every.needs_direction and not _uses_direction(kind),
        sized_by_message=isinstance(kind.end, ByMessage),
        body_size=_body_size(writer),
    )
    views = _parts_views(writer, frame)
    starts = () if kind.envelope.preamble else kind.envelope.starts
    rows = [f"{{{', '.join(map(in_hex, start))}}}" for start in starts]
    return replace(
        views,
        parts=replace(views.parts, most=f"{kind.max_payload}U"),
        begins=BeginsView(rows, len(starts[0])) if starts else None,
        turned=kind.turned,
    )


def _writer(whole: Plan, frame: FramePlan, way: str, layouts: Layouts) -> PartWriter:
    """Prints the parts of a frame; ``way`` is its kind or its direction, "" if there is one frame."""
    prefix = whole.protocol.name
    every = {"response": whole.frame, **({"request": whole.frames["request"]} if way else {})}
    if whole.frame.kinds:
        every = {each.name: each for each in whole.frame.kinds}
    return PartWriter(
        prefix,
        frame,
        sender_of(frame, prefix),
        layouts,
        seeds=seeds_of(whole),
        directed=directed(whole),
        own=own_prefix(prefix, way),
        every=tuple(each.envelope for each in every.values()),
        id_bits=id_bits(whole.frame) if whole.frame.kinds else 0,
    )


def _body_size(writer: PartWriter) -> int:
    """Size of the buffer for decoding a frame, 0 if its bytes are sent as they are."""
    envelope, transparency = writer.envelope, writer.frame.transparency
    match transparency:
        case Plain():
            return envelope.payload.most if envelope.blocks else 0
        case PayloadStuffing():
            return envelope.payload.most_sent
        case FrameStuffing():
            return writer.head + envelope.trailer_size + envelope.payload.most
        case Coded():
            return envelope.overhead + envelope.payload.most if transparency.stages else 0
        case SevenBit():
            raise AssertionError("a marked frame has no parts that a length or its message ends")
        case _:
            assert_never(transparency)


def _parts_views(writer: PartWriter, frame: FrameView) -> PartsViews:
    envelope, receiver, transparency = writer.envelope, writer.frame.receiver, writer.frame.transparency
    rule, added = None, ""
    if isinstance(transparency, PayloadStuffing | FrameStuffing):
        rule = transparency.rule if isinstance(transparency.rule, Insertion) else None
        added = in_hex(transparency.rule.number) if isinstance(transparency.rule, Add) else ""
    stuffing, alone = writer.stuffing, writer.alone
    passed = frame.pass_decode_direction
    return PartsViews(
        algorithms=list(writer.algorithms.values()),
        crc=writer.algorithms[alone.check.algorithm] if alone else None,
        f=frame,
        place=PlaceView(
            tailed=rule is not None or (frame.body_size > 0 and not added) or envelope.before is not None,
            tail=envelope.trailer_size - (envelope.after.size if envelope.after else 0),
            header=envelope.header_size,
            overhead=envelope.least_overhead,
        ),
        parts=parts_view(writer, writer.frame.max_wire),
        plain=None if stuffing else replace(plain_view(writer, passed), added=added),
        stuffed=_stuffed(writer, stuffing, passed) if stuffing else None,
        inserted=_inserted(rule) if rule else None,
        hunt=_hunted(writer, receiver) if isinstance(receiver, Hunt) else None,
        ended=ended_view(writer, passed) if writer.frame.whole else None,
        coded=None
        if writer.frame.whole or not isinstance(transparency, Coded)
        else replace(
            ended_view(writer, passed), head_checks=list(writer.head_checks("at", passed, all_there=False))
        ),
    )


def seeds_of(plan: Plan) -> tuple[tuple[str, bytes], ...]:
    """The seeds of a message: all that have any have them of the same attributes."""
    return next((each.message.seeds for each in plan.messages if each.message.seeds), ())


def parts_view(writer: PartWriter, max_wire: int) -> PartsView:
    """The view of the parts of a frame."""
    envelope, receiver = writer.envelope, writer.frame.receiver
    return PartsView(
        late_insert=isinstance(receiver, Rescan) and writer.frame.late_insert,
        judged="true" if isinstance(receiver, Rescan) and not receiver.verified else "",
        head=writer.head,
        tail=envelope.trailer_size,
        header=envelope.header_size,
        overhead=envelope.overhead,
        most=f"{writer.prefix.upper()}_MAX_PAYLOAD_SIZE",
        max_frame=f"{writer.frame.longest}U",
        index_type=unsigned_type(max(16, max_wire.bit_length())),
        id_value=writer.message_id(writer.number(envelope.id)),
        address_value=writer.number(envelope.address),
        wrong_tail=writer.wrong_tail("end"),
        check_differs=writer.check_differs("end", "value"),
        values=writer.values,
        judges=writer.judges("body", "end", f"{'sent' if writer.blocks else 'payload'} + {writer.head_text}"),
        blocks=writer.blocks,
        identified_late=writer.reads_tail,
        unused="" if envelope.id else writer.sender.id,
        refused_values=writer.refused_values(),
        get_values=writer.get_values(),
    )


def plain_view(writer: PartWriter, directed: str) -> PlainView:
    """The view of a frame whose header is sent unstuffed."""
    header, received = writer.head_text, "sent" if writer.blocks else "payload"
    return PlainView(
        header=header,
        least_header=writer.least_head,
        overhead=writer.envelope.least_overhead,
        before=writer.conditional(writer.envelope.before, "wire"),
        after=writer.conditional(writer.envelope.after, "end"),
        put_header=writer.put_header("wire", "size" if writer.blocks else "sent"),
        put_trailer=writer.put_trailer("end", "wire"),
        put_check=writer.put_check("end", "value"),
        fills=writer.fills("wire", "end", f"{header} + sent"),
        update_sent=writer.covered_loops("wire", "0", f"{header} + sent"),
        update_received=writer.covered_loops("wire", "0", f"{received} + {header}"),
        head_checks=list(writer.head_checks("size", directed, all_there=True)),
        late_checks=writer.late_checks("size"),
    )


def _stuffed(writer: PartWriter, stuffing: FrameStuffing, directed: str) -> StuffedView:
    tail, both = writer.envelope.trailer_size, writer.head + writer.envelope.trailer_size
    front, back = stuffing.front - len(writer.lead), stuffing.back
    part = writer.alone
    sent = writer.covered_loops("wire", f"(capacity - {both}U - size)", f"(capacity - {tail}U)")
    received = writer.covered_loops("body", "0", f"payload + {writer.head}U")
    sent_from = f"(from > (capacity - {both - front}U - size))" if front else ""
    rule = stuffing.rule
    return StuffedView(
        lead=len(writer.lead),
        lead_bytes=[in_hex(byte) for byte in writer.lead],
        head_and_tail=both,
        count_type=f"uint_fast{max(8, storage((both + writer.envelope.payload.most).bit_length()))}_t",
        covers_body=writer.covers_body,
        check_from_end=writer.envelope.from_end(part) if part else 0,
        put_header=writer.put_header("head", "size"),
        put_trailer=writer.put_trailer("trailer", "head"),
        put_check=writer.put_check("trailer", "value"),
        fills=writer.fills("head", "trailer", f"{writer.head}U + size"),
        update_before=writer.lead_updates + ([] if writer.covers_body else sent),
        update_lead=writer.lead_updates,
        update_received=[] if writer.covers_body else received,
        lead_checks=[(f"wire[{i}] != {in_hex(byte)}", i + 1) for i, byte in enumerate(writer.lead)],
        head_checks=list(writer.head_checks("at", directed, all_there=False)),
        stuffed_when_sent=_both(sent_from, f"(from <= (capacity - {back}U))" if back else ""),
        stuffed_when_received=_both(
            f"(at > {front}U)" if front else "", f"(at <= (total - {back}U))" if back else ""
        ),
        due_when_sent=_due(rule, "wire", "to", "byte"),
        due_when_received=_due(rule, "body", "at", "byte"),
        hunts=isinstance(writer.frame.receiver, Hunt),
    )


def _both(*terms: str) -> str:
    return " && ".join(term for term in terms if term)


def _inserted(rule: Insertion) -> InsertView:
    return InsertView(
        insert=in_hex(rule.insert),
        mark=in_hex(rule.after[0]),
        pattern=len(rule.after) > 1,
        due_in_payload=_due(rule, "payload", "index + 1U", "payload[index]"),
        due_at_end=_due(rule, "wire", "at", "wire[at - 1U]"),
        due_in_sent=_due(rule, "sent", "index + 1U", "sent[index]"),
    )


def _due(rule: Insertion, array: str, end: str, last: str) -> str:
    """The condition for inserting a byte after the one before ``end``; ``since`` counts bytes."""
    size = len(rule.after)
    if size == 1:
        return f"{last} == {in_hex(rule.after[0])}"
    terms = [f"({array}[{end} - {size - at}U] == {in_hex(byte)})" for at, byte in enumerate(rule.after)]
    return " && ".join([f"(since >= {size}U)", *reversed(terms)])


def ended_view(writer: PartWriter, directed: str) -> EndedView:
    """The view of a frame that a terminator or a silence ends."""
    envelope, coded, end = writer.envelope, writer.frame.transparency, writer.frame.end
    assert isinstance(coded, Coded)
    data, after, paired = b"", 0, False
    if isinstance(end, ByTerminator):
        data, after, paired = end.part.data, end.after, end.paired is not None
    lead, closing = envelope.preamble, len(data) + after
    tail, header = envelope.trailer_size, envelope.header_size
    both = header + tail
    return EndedView(
        stages=stage_views(coded.stages),
        lead=len(lead),
        lead_checks=[(f"wire[{at}] != {in_hex(byte)}", at + 1) for at, byte in enumerate(lead)],
        size=len(data),
        closing=closing,
        limit=writer.frame.max_wire - after,
        matches=_matches("wire[stop{}]", data),
        matches_first=_matches("(receiver->wire[receiver->first{}]", data, ")"),
        last=in_hex(data[-1]) if data else "",
        lines=writer.frame.lines,
        partial=" || ".join(
            f"((waiting == {size}U) && {_matches('(receiver->wire[receiver->first{}]', data[:size], ')')})"
            for size in range(1, len(data))
        ),
        step=f"(wire[stop] == {in_hex(data[0])}) ? 2U : 1U" if paired else "",
        kept=writer.frame.kept,
        flag=len(writer.frame.flag),
        front=coded.front,
        back=coded.back,
        splits=(coded.front, coded.back) != (len(lead), closing),
        header=header,
        tail=tail,
        least=envelope.payload.least,
        most=envelope.payload.most,
        checks=list(writer.whole_checks(directed)),
        update_sent=writer.covered_loops("wire", f"(capacity - {both}U - size)", f"(capacity - {tail}U)"),
        update_received=writer.covered_loops("body", "0", f"payload + {header}U"),
        put_header=writer.put_header("head", "size"),
        put_trailer=writer.put_trailer("trailer", "head"),
        put_check=writer.put_check("trailer", "value"),
        fills=writer.fills("head", "trailer", f"{header}U + size"),
    )


def _matches(place: str, data: bytes, closing: str = "") -> str:
    """The condition for bytes at a place; ``{}`` in it is the offset of each."""
    offsets = [f" + {at}U" if at else "" for at in range(len(data))]
    terms = [
        f"{place.format(offset)} == {in_hex(byte)}{closing}"
        for offset, byte in zip(offsets, data, strict=True)
    ]
    if closing or len(terms) == 1:
        return " && ".join(terms)
    return " && ".join(f"({term})" for term in terms)


def _hunted(writer: PartWriter, receiver: Hunt) -> HuntView:
    envelope = writer.envelope
    assert envelope.length is not None
    assert envelope.check is not None
    length, both = envelope.length, writer.head + envelope.trailer_size
    whole = both - length.bias
    return HuntView(
        mark=in_hex(receiver.mark),
        insert=in_hex(receiver.insert),
        position_type=unsigned_type(max(8, (both + envelope.payload.most).bit_length())),
        length_bounds=length_bounds(length, "byte") or "false",
        length_value=writer.payload_size(length),
        whole=_plus(writer.get(length), whole),
        before_check=_plus(writer.get(length), whole - envelope.check.size),
    )


def _plus(value: str, constant: int) -> str:
    if constant == 0:
        return value
    return f"({value} + {constant}U)" if constant > 0 else f"({value} - {-constant}U)"


def judgement(plan: Plan, directions: Sequence[str]) -> str:
    """The expression that checks the contents of ``receiver->frame``."""
    prefix, upper = plan.protocol.name, plan.protocol.name.upper()
    calls = [f"{prefix}_{direction}_check(&receiver->frame)" for direction in directions]
    if len(calls) == len(plan.protocol.directions) == 1:
        return calls[0]
    found = f"{upper}_ERROR_UNKNOWN"
    for direction, call in zip(directions, calls, strict=True):
        other = calls[-1] if len(calls) > 1 else found
        return f"(receiver->direction == {upper}_{direction.upper()}) ? {call} : {other}"
    return found
