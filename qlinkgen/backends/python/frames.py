"""Makes the views of frames from their plans."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import assert_never

from qlinkgen.backends.python import integers, pieces
from qlinkgen.backends.python.coding import coding_view
from qlinkgen.backends.python.conditional import before_view
from qlinkgen.backends.python.frame_checks import all_placed, check_bytes, check_view, seed_name
from qlinkgen.backends.python.frame_directions import by_id
from qlinkgen.backends.python.frame_views import (
    AddressView,
    BlocksView,
    EndedView,
    FrameView,
    HeadCheck,
    LengthView,
    MarkedView,
    OfKind,
    PacketView,
    PartsView,
    StuffingView,
    UniqueView,
)
from qlinkgen.backends.python.layout import in_hex, literal, slice_of, wrapped
from qlinkgen.backends.python.names import attribute
from qlinkgen.backends.python.values import counter_fact
from qlinkgen.model.checksum import Sum
from qlinkgen.model.frame import Silence
from qlinkgen.model.integer import ByteOrder
from qlinkgen.model.naming import address_argument, address_attribute
from qlinkgen.plan.check import Check
from qlinkgen.plan.coding import Add, Escaping, Insertion
from qlinkgen.plan.ends import ByLength, ByMark, ByTerminator, Gaps, Hunt, InStep, Marks, Rescan
from qlinkgen.plan.envelope import Envelope
from qlinkgen.plan.expr import OneOf, Within
from qlinkgen.plan.framing import FramePlan
from qlinkgen.plan.parts import (
    AddressPart,
    Bits,
    BlocksPart,
    CellPart,
    CheckPart,
    ConstantPart,
    EqualPart,
    IdPart,
    LeadingPart,
    LengthPart,
    MarkPart,
    Numeric,
    Part,
    PayloadPart,
)
from qlinkgen.plan.transparency import Coded, FrameStuffing, PayloadStuffing, Plain, SevenBit
from qlinkgen.plan.tree import Plan


def view_of(plan: Plan, title: str, sizes: Sequence[int]) -> FrameView:
    """The view of the frame of a protocol; ``sizes`` are those of bodies of constant size."""
    receiver = plan.frame.receiver
    match receiver:
        case Hunt():
            return _unique(plan, receiver, title, sizes)
        case Rescan():
            return _parts(plan, title, bare=receiver.bare, verified=receiver.verified)
        case Gaps():
            return _parts(plan, title, bare=False, verified=True)
        case Marks():
            return _marked(plan, title)
        case InStep():
            return _packet(plan, title)
        case _:
            assert_never(receiver)


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
        limit=_limit(bits) if bits else "",
    )


def _limit(bits: Bits) -> str:
    """The greatest address, "" if the conversion to bytes refuses a greater one."""
    if not bits.whole:
        return f"0x{bits.mask:X}"
    return str(bits.part.integer.maximum) if bits.part.digits else ""


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
    return part.initial if isinstance(part, CellPart) else 0


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
        broken=plan.frame.idle is not None and plan.frame.idle.broken,
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
    if check.value.base or (check.size > 1 and check.regular != byteorder):
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


def finish_lines(view: PartsView) -> list[str]:
    """The last steps of an encoder."""
    lines, frame = [], f"_wrapped(body{', self' if view.seeds else ''})"
    if view.last and view.main:
        if view.before_check:
            condition, change = view.before_check
            lines += [f"if {condition}:", f"    body = {change}(body)"]
        lines.append(f"crc = _CHECKSUM.compute({view.main.ahead}, _CHECKSUM.start)")
        frame = f"body + {view.main.view.bytes}"
    if not view.after:
        return [*lines, f"return {frame}"]
    completed = f"_complete(frame{', self' if view.after.values else ''})"
    lines += [f"frame = {frame}", f"if {view.after.needed}:", f"    frame = {completed}"]
    return [*lines, f"return {'_sent(frame)' if view.before else 'frame'}"]


def _parts(plan: Plan, title: str, *, bare: bool, verified: bool) -> PartsView:
    whole = plan.frame.envelope
    envelope = whole.inner
    address = _address_view(plan)
    length = _length_view(plan, envelope)
    checks, filling = all_placed(envelope, early=not plan.frame.whole)
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
        broken=plan.frame.idle is not None and plan.frame.idle.broken,
        ended=ended_view(plan.frame, bare=bare) if plan.frame.whole else None,
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
        id_of_buffer=pieces.number(envelope, envelope.id, *pieces.BUFFER),
        id_of_frame="_number(frame, known)" if plan.frame.texts else _quick_id(envelope),
        address_of=pieces.number(envelope, envelope.address, "head") if _leads(envelope) else "",
        bare=bare,
        verified=verified,
        head_checks=list(_head_checks(plan.frame, envelope, bare=bare)),
        values=[attribute(member.name) for _, member in whole.values],
        counter=_counter(plan),
        counts_some=any(not plan.protocol.counts(each.message) for each in plan.messages),
        restarts=plan.protocol.restarts,
        master=_master(plan),
        tail_tests=[test for part in envelope.back for test in pieces.tail_tests(envelope, part)],
        before=before_view(envelope),
        texts=_texts(plan),
        folded=any(each.folded for each in map(plan.texts, plan.received_directions) if each),
    )


def parts_of_kind(plan: Plan, frame: FramePlan, result: str) -> PartsView:
    """The view of one of several kinds of frame; ``result`` as in `OfKind`."""
    envelope = frame.envelope.inner
    view = _parts(replace(plan, frames=dict.fromkeys(plan.frames, frame)), "", bare=False, verified=True)
    base = f"{frame.base} + " if frame.base else ""
    numbers = [pieces.number(envelope, envelope.id, source) for source in ("head", "frame")]
    in_head, in_frame = (f"{base}({each})" if base and " " in each else base + each for each in numbers)
    return replace(
        view,
        blank="",
        id_of=in_head,
        id_of_frame=in_frame,
        kind=OfKind(result, begun=list(_begun(envelope)), passes=True),
    )


def _texts(plan: Plan) -> list[str]:
    """The tables of the ids that payloads begin with; [] if parts hold ids."""
    known = [each for each in map(plan.texts, plan.received_directions) if each is not None]
    found = {text: number for each in known for text, number in each.numbers}
    if not found:
        return []
    pairs = [f"{literal(text)}: {number}" for text, number in sorted(found.items(), key=lambda each: each[1])]
    sizes = [str(size) for size in sorted({len(text) for text in found}, reverse=True)]
    return [
        "#: Ids that payloads begin with, and their numbers; the sizes of these ids.",
        *wrapped("_IDS = {", pairs, "}", 0),
        *wrapped("_ID_SIZES = (", sizes if len(sizes) > 1 else [f"{sizes[0]},"], ")", 0),
    ]


def _blank_trailer(envelope: Envelope, address: AddressView | None) -> str:
    """A trailer for decoding a payload."""
    holds = any(isinstance(part, CellPart) and part.values for part in envelope.back)
    return _blank(envelope, envelope.back, address) if holds or _trails(envelope) else "bytes(_TRAILER)"


def _counter(plan: Plan) -> str:
    """The counter of frames as a tuple, "" if there is none."""
    counter = plan.protocol.counter
    return counter_fact(counter) if counter else ""


def _master(plan: Plan) -> str:
    """The attribute with the number of the master, and its default, as a tuple; "" if there is none."""
    found = plan.protocol.master
    if found is None:
        return ""
    assert found.type is not None
    return f'("{attribute(found.name)}", {found.type.default})'


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


def _idle(silence: Silence | None) -> tuple[float, float] | None:
    return (float(silence.byte_times), float(silence.seconds)) if silence else None


def ended_view(frame: FramePlan, *, bare: bool, mark: str = "") -> EndedView:
    """The view of a terminator, or of a frame that a silence ends; ``mark`` is that of its kind."""
    envelope, coded, end = frame.envelope, frame.transparency, frame.end
    assert isinstance(coded, Coded)
    last, after, paired = b"", 0, False
    if isinstance(end, ByTerminator):
        last, after, paired = end.part.data, end.after, end.paired is not None
    lead, closing = len(envelope.preamble), len(last) + after
    return EndedView(
        terminator=literal(last) if last else "",
        last=literal(last[-1:]),
        pair=literal(last[:1]) if paired else "",
        kept=frame.kept,
        closing=closing,
        after=after,
        limit=frame.max_wire - after,
        lead=lead,
        front=coded.front,
        back=coded.back,
        splits=(coded.front, coded.back) != (lead, closing),
        least=envelope.payload.least,
        lines=frame.lines,
        flag=bool(frame.flag),
        checks=list(_ended_checks(envelope, bare=bare)),
        coding=coding_view(coded.stages, mark) if coded.stages else None,
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
    longer = envelope.before.length if envelope.before else None
    start = envelope.offset(part)
    value = pieces.read(envelope, part, "head") + (f" * {part.scale}" if part.scale > 1 else "")
    if longer:
        value = f"{pieces.read(envelope, longer, 'head')} if _has_before(head) else {value}"
    return LengthView(
        bias=part.bias,
        least=part.least * part.scale,
        most=(longer or part).most * part.scale,
        start=start,
        end=start + part.size,
        lead=literal(envelope.preamble) if len(envelope.preamble) == start else "",
        value=value,
        quick=_quick_length(part, start),
        sliced=integers.is_sliced(part.integer),
        bytes=integers.to_bytes(part.integer, "number"),
        scale=part.scale,
        bounded=(part.least, part.most) != (0, part.integer.mask),
        last=part.most if longer else None,
    )


def _quick_length(part: LengthPart, start: int) -> str:
    source, base = pieces.BUFFER
    read = integers.read_bytewise(part.integer, source, start, base)
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
        case Plain() | SevenBit():
            return None
        case Coded():
            if plan.frame.whole:
                return None
            stage = transparency.bytewise
            reveals = literal(bytes((stage.escape,))) if isinstance(stage, Escaping) else ""
            front, back, coding = transparency.front, transparency.back, coding_view(transparency.stages)
            steady = isinstance(stage, Add)
            return StuffingView(True, "", "", front, back, coding=coding, reveals=reveals, steady=steady)
        case FrameStuffing():
            whole, front, back = True, transparency.front, transparency.back
        case PayloadStuffing(Add()):
            return StuffingView(False, "", "", 0, 0, coding=coding_view((transparency.rule,)), steady=True)
        case PayloadStuffing():
            whole, front, back = False, 0, 0
        case _:
            assert_never(transparency)
    rule = transparency.rule
    assert isinstance(rule, Insertion)
    after, insert = literal(rule.after), literal(bytes((rule.insert,)))
    return StuffingView(whole, after, insert, front, back, last=in_hex(rule.after[-1]))


def _begun(envelope: Envelope) -> Iterator[str]:
    """The message ids that frames begin with, as far as received; none if a constant begins them."""
    if not envelope.preamble and envelope.starts:
        sizes = range(1, len(envelope.starts[0]) + 1)
        yield from map(literal, sorted({start[:size] for start in envelope.starts for size in sizes}))


def _head_checks(frame: FramePlan, envelope: Envelope, *, bare: bool) -> Iterator[HeadCheck]:
    """The checks of a header, part by part, as far as received."""
    for part in envelope.front:
        start, end = envelope.offset(part), envelope.offset(part) + part.size
        match part:
            case ConstantPart():
                test = f"not {literal(part.data)}.startswith(head[{start}:{end}])"
                yield HeadCheck(test, '"no_frame", start, b""', "constant", _differs(part.data, start, end))
            case LengthPart() if envelope.before and envelope.before.length:
                yield _one_of_two(envelope, part, longer=part is envelope.before.length)
            case LengthPart():
                yield _length_check(frame, part, end)
            case IdPart() | AddressPart() | CellPart() | EqualPart():
                yield from _number_checks(envelope, part, bare=bare)
            case CheckPart():
                pass
            case MarkPart() | PayloadPart() | BlocksPart():
                raise AssertionError(f"{part.name} is not a part of a header")
            case _:
                assert_never(part)


def _number_checks(envelope: Envelope, part: Numeric, *, bare: bool) -> Iterator[HeadCheck]:
    no_frame, end = '"no_frame", start, b""', envelope.offset(part) + part.size
    if isinstance(part, LeadingPart) and part.numbers:
        yield HeadCheck(f"head[:{end}] not in _BEGUN", no_frame, "constant")
    tests = (pieces.wrong(envelope, part, *source) for source in (("head",), pieces.BUFFER))
    # A slice at the end of the buffer may be another number, and a right one.
    sliced = part.size > 1 and not isinstance(part, AddressPart)
    cut = f"len(buf) < start + {end} or " if sliced else ""
    for test, whole in zip(*tests, strict=True):
        yield HeadCheck(f"len(head) >= {end} and {test}", no_frame, "constant", cut + whole)
    if bare and envelope.identifies(part) and envelope.known_at(part, envelope.id):
        yield from _bare_checks(envelope, part, f"len(head) >= {end} and", no_frame)


def _length_check(frame: FramePlan, part: LengthPart, end: int) -> HeadCheck:
    coded = isinstance(frame.transparency, FrameStuffing | Coded) and end > frame.transparency.front
    place = f"_take(buf, start, {end})[1]" if coded else f"start + {end}"
    bounds = "_MIN_LENGTH <= _length(head) <= _MAX_LENGTH"
    if frame.name:  # of several kinds: a call costs time
        bounds = f"{part.least} <= {pieces.read(frame.envelope, part, 'head')} <= {part.most}"
    return HeadCheck(f"len(head) >= {end} and not {bounds}", f'"length", {place}, b""')


def _differs(data: bytes, start: int, end: int) -> str:
    """Whether other bytes are in the header of the frame in the buffer."""
    source, base = pieces.BUFFER
    return pieces.differs(data, source, integers.index_of(base, start), integers.index_of(base, end))


def _one_of_two(envelope: Envelope, part: LengthPart, *, longer: bool) -> HeadCheck:
    """The check of one of two lengths; the first one may hand over to the other."""
    end, seen = envelope.offset(part) + part.size, pieces.read(envelope, part, "head")
    legal = [Within(part.least, part.most)]
    if part.otherwise is not None:
        legal.append(Within(part.otherwise, part.otherwise))
    reached = f"len(head) >= {end} and{' _has_before(head) and' if longer else ''}"
    wrong = integers.broken(OneOf(tuple(legal)), seen)
    return HeadCheck(f"{reached} {wrong}", f'"length", start + {end}, b""')


def _bare_checks(envelope: Envelope, part: Part, reached: str, no_frame: str) -> Iterator[HeadCheck]:
    """The checks of message number and address, as far as known after a part."""
    if any(bits.part is part for bits in envelope.id) or not envelope.id:
        yield HeadCheck(f"{reached} _number(head) not in known", no_frame, "number")
    if envelope.address and envelope.known_at(part, envelope.address):
        yield HeadCheck(f"{reached} not _allowed(head, known)", no_frame, "address")


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
    requests = by_id([message for message in plan.messages if message.direction != "response"])
    responses = by_id([message for message in plan.messages if message.direction == "response"])
    if check is None:
        return PacketView(title, requests, responses)
    assert isinstance(check.algorithm, Sum)
    return PacketView(
        title=title,
        requests=requests,
        responses=responses,
        check_size=check.size,
        check_bytes=check_bytes(check, "check"),
        check_mask=f"0x{check.algorithm.mask:X}",
        word=check.word,
        total={"plain": "total", "inverted": "~total", "zero": "-total"}[check.algorithm.form],
        rejected="" if check.rejected is None else f"0x{check.rejected:0{check.size * 2}X}",
    )
