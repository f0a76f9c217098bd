"""Descriptions of faults: the rule broken, the bytes seen, and the likely cause."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import assert_never

from qlinkgen.cli.crc_search import Coverage, coverages, explain_mismatch, explain_sum
from qlinkgen.cli.describe import addresses_text
from qlinkgen.cli.span_text import check_number
from qlinkgen.plan.coding import Insertion
from qlinkgen.plan.describe import (
    bytes_text,
    check_text,
    constant_text,
    digits_text,
    filled_number,
    filled_text,
    id_text,
    limits_text,
    number_of,
    part_text,
    span_text,
    transparency_text,
    unread_text,
    value_text,
)
from qlinkgen.plan.ends import ByLength, ByMark
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
)
from qlinkgen.plan.payload import ConstantStep, FilledStep, Member, Step
from qlinkgen.plan.spans import Dissection, Fault, Rule
from qlinkgen.plan.transparency import Coded, FrameStuffing, PayloadStuffing, Plain, SevenBit
from qlinkgen.plan.tree import MessagePlan

Words = tuple[str, str]

_LOST = "the capture was cut, or bytes were lost"


def notes(found: Dissection) -> list[str]:
    """Return remarks on a frame that are not errors."""
    message = found.message
    if message is None:
        return []
    text = []
    payload, check = found.cells[message.envelope.payload.name], message.envelope_in(found.frame).check
    if message.payload.empty_is_default and not payload.data:
        text.append("an empty payload means every field at its default")
    if check and check.check.chained and not found.cells[check.name].data:
        text.append("reading the check value is optional, but without it the response is not verified")
    return text


def finding(found: Dissection, fault: Fault, start: int = 0) -> Words:  # noqa: C901, PLR0912  # a case a rule
    """Return rule and cause; ``start`` is the offset of the frame in all bytes."""
    of, at, name = fault.of, fault.at + start, found.frame.address
    match fault.rule:
        case Rule.BEGINNING:
            return _beginning(found, fault)
        case Rule.FIRST:
            cause = "the capture begins inside another frame, or the beginning of one was lost"
            return f"{counted(fault.seen)} before the {_start(found)}, outside a frame", cause
        case Rule.CONSTANT:
            return _constant(found, fault)
        case Rule.WHOLE:
            return _missing(found, fault)
        case Rule.ALONE:
            return _interrupted(found, at)
        case Rule.STUFFING:
            return _stuffing(found, fault, at)
        case Rule.LENGTH:
            assert isinstance(of, LengthPart)
            cause = "a bit was flipped, or the bytes before it are data, not a preamble"
            return f"{of.name} is {fault.seen}, allowed are {span_text(of.least, of.most)}", cause
        case Rule.TERMINATOR:
            assert isinstance(of, ConstantPart)
            most = found.frame.max_wire
            return f"no {of.data.hex(' ')} within {most} bytes, the longest frame", _LOST
        case Rule.COUNTED:
            assert isinstance(of, LengthPart)
            size = of.number(len(found.cells[found.frame.envelope.payload.name].data))
            rule = f"{of.name} is {fault.seen}, but up to the terminator it is {size}"
            return rule, "bytes were lost or added"
        case Rule.LAST:
            cause = (
                "the capture contains more frames, or bytes were added; `qlinkgen decode` reads whole streams"
            )
            return f"{counted(fault.seen)} after the end of the frame", cause
        case Rule.MESSAGE:
            return _unknown(found, fault)
        case Rule.SIZE:
            return _size(found, fault)
        case Rule.END:
            cause = "a node decremented only one of the two, or the end belongs to another frame"
            return f"the end has {name} {fault.seen}, the header {found.address}", cause
        case Rule.ADDRESS:
            return _address(found, fault)
        case Rule.CHECK:
            return _check(found, fault)
        case Rule.REFUSED:
            assert isinstance(of, CheckPart)
            cause = "the device does not know the command, or does not accept it now"
            return f"{of.name} is {fault.seen}: the command was refused as illegal", cause
        case Rule.VALUE:
            return _value(found, fault)
        case Rule.PROOF:
            assert isinstance(of, Step)
            rule = f"the request and the bytes before it give {fault.right:#x}"
            cause = "bytes were corrupted, or it answers another request"
            return f"{of.name} is {fault.seen:#x}, but {rule}", cause
        case _:
            assert_never(fault.rule)


def counted(number: int | None) -> str:
    """``1 byte``, ``2 bytes``."""
    return bytes_text(number or 0, number or 0)


def _beginning(found: Dissection, fault: Fault) -> Words:
    if isinstance(fault.of, MarkPart):
        end = found.frame.envelope.parts[-1]
        other = end.end_id if isinstance(end, MarkPart) else 0
        rule = f"no byte with 0x{fault.of.marker:02X} set and {fault.of.id_name} other than {other}"
        return f"header missing: {rule}", "the capture began late, or the header was lost"
    if isinstance(fault.of, IdPart | AddressPart):
        known = " or ".join(each.hex(" ") for each in fault.of.starts)
        return (
            f"{fault.of.name} missing: it is {known}",
            "the capture began late, or noise precedes the frame",
        )
    preamble = found.frame.envelope.preamble.hex(" ")
    cause = "the capture began late, or a byte of the preamble was lost"
    return f"preamble {preamble} missing", cause


def _constant(found: Dissection, fault: Fault) -> Words:
    part = fault.of
    if isinstance(part, AddressPart) and part.digits:
        seen = found.cells[part.name].data
        return f"{part.name} is {seen.hex(' ')}, must be {digits_text(part.digits)}", ""
    assert isinstance(part, ConstantPart | CellPart | EqualPart)
    right = part.data.hex(" ") if isinstance(part, ConstantPart) else part_text(part, found.frame)
    if isinstance(part, EqualPart):
        other = part.of.integer.unpack(found.cells[part.of.name].data)
        right = f"{right}: {part.integer.pack(part.value(other)).hex(' ')}"
    return f"{part.name} is {found.cells[part.name].data.hex(' ')}, must be {right}", ""


def _start(found: Dissection) -> str:
    """Return the name of the first part of a frame."""
    return "header" if isinstance(found.frame.end, ByMark) else "preamble"


def _interrupted(found: Dissection, at: int) -> Words:
    if isinstance(found.frame.end, ByMark):
        cause = "the end byte was lost, or two nodes sent at once"
        return f"a header at offset {at}, before the end of the frame", cause
    cause = "the sender was interrupted or bytes were lost: this frame is truncated"
    return f"a new preamble begins at offset {at}, inside the frame", cause


def _unknown(found: Dissection, fault: Fault) -> Words:
    frame, number = found.frame, fault.seen or 0
    if frame.texts:
        texts = sorted(each.message.text or b"" for each in found.plan.known(found.direction).values())
        known = ", ".join(id_text(frame, frame.texts.index(each)) for each in texts)
        return f"the payload does not begin with a {frame.id_name}: known are {known}", ""
    near = _nearest(number, list(found.plan.known(found.direction).values()))
    cause = f"the nearest known is {near.message.command}, {id_text(frame, near.id)}" if near else ""
    return f"{frame.id_name} {id_text(frame, number)} is unknown", cause


def _address(found: Dissection, fault: Fault) -> Words:
    assert found.message is not None
    cause = "the sender has a wrong address, or the message does not allow this address"
    if isinstance(fault.of, MarkPart):
        cause = "no node has this address; the destination node has forwarded the frame"
    allowed = addresses_text(found.message.message)
    return f"{found.frame.address} is {fault.seen}; {found.message.name} has {allowed}", cause


def _missing(found: Dissection, fault: Fault) -> Words:
    end, number = found.frame.end, counted(fault.seen)
    what = "packet" if found.frame.needs_request else "frame"
    if isinstance(end, ByMark):
        return "end byte missing", _LOST
    if isinstance(end, ByLength):
        data = found.cells[end.part.name].data
        if len(data) == end.part.size:
            cause = "the capture was cut, bytes were lost, or the length is wrong"
            length = end.part.integer.unpack(data)
            return f"{end.part.name} {length} announces {number} more than received", cause
    if found.message is None:
        return f"the {what} ends {number} too early", _LOST
    payload, check = found.message.payload, found.message.envelope_in(found.frame).check
    beside = f", and {check.size} of {check.name}" if check else ""
    sizes = bytes_text(payload.least, payload.most)
    return f"the {what} ends {number} too early; {found.message.name} has {sizes}{beside}", _LOST


def _stuffing(found: Dissection, fault: Fault, at: int) -> Words:
    way = found.frame.transparency
    if isinstance(way, Coded):
        seen = "the end of the coded bytes" if fault.seen is None else f"{fault.seen:02x}"
        return f"{seen} at offset {at} is wrong: {transparency_text(found.frame)}", _LOST
    assert isinstance(way, FrameStuffing | PayloadStuffing)
    assert isinstance(way.rule, Insertion)
    seen = "the end of the payload" if fault.seen is None else f"{fault.seen:02x}"
    after = f"{way.rule.after.hex(' ')} at offset {at - len(way.rule.after)}"
    rule = f"{after} is followed by {seen}, not by {way.rule.insert:02x}"
    return rule, "the sender does not stuff, or a byte was lost or corrupted"


def _size(found: Dissection, fault: Fault) -> Words:
    message, lost = found.message, "bytes were lost or added"
    size = fault.seen or 0
    if message is None:
        return f"payload of {counted(size)}, the frame allows {found.frame.max_payload}", lost
    envelope, payload = message.envelope, message.payload
    if isinstance(found.frame.end, ByMark):
        check = envelope.check
        beside = check.size if check else 0
        between = size + (len(found.cells[check.name].data) if check else 0)
        sizes = span_text(payload.least + beside, payload.most + beside)
        what = f"{message.name} has {sizes}{' with its checksum' if beside else ''}"
        return f"{counted(between)} between header and end; {what}", lost
    if payload.least <= size <= payload.most:
        rule = f"payload of {counted(size)}, which does not agree with the counts in it"
        return rule, "a count was corrupted, or bytes were lost or added"
    cause = f"{lost}, or the other side has another revision of the protocol"
    if envelope.length and payload.fixed:
        length = envelope.length
        right, seen = length.number(payload.most), length.number(size)
        cause = f"{message.name} has {length.name} {right}, this is {seen}; {cause}"
    return f"payload of {counted(size)}; {message.name} has {span_text(payload.least, payload.most)}", cause


def _check(found: Dissection, fault: Fault) -> Words:
    part, received = fault.of, fault.seen or 0
    assert isinstance(part, CheckPart | BlocksPart)
    expected = found.expected[part.name]
    if isinstance(part, BlocksPart):
        return _block(found, part, fault, expected)
    text = check_text(part.check, found.frame)
    rule = f"{part.name} is {check_number(part, received)}, but {text} gives {check_number(part, expected)}"
    if part.check.chained:
        payload = found.cells[found.frame.envelope.payload.name].data
        return rule, explain_sum(part.check, found.frame.id_name, found.request, payload, received)
    if received == expected:
        return rule, "unused bits of its bytes are set"
    over = part.check.over
    cells = {name: cell for name, cell in found.cells.items() if name != part.name}
    plain = {name: cell.data for name, cell in cells.items()}
    own = [pair for name in over for pair in zip(cells[name].places, plain[name], strict=True)]
    return rule, explain_mismatch(part.check, received, _coverages(found, plain, over), own)


def _block(found: Dissection, part: BlocksPart, fault: Fault, expected: int) -> Words:
    index = found.cells[part.name].places.index(fault.at) // part.check.size
    payload = found.cells[found.frame.envelope.payload.name]
    block = slice(index * part.every, (index + 1) * part.every)
    own = list(zip(payload.places[block], payload.data[block], strict=True))
    received = fault.seen or 0
    what = f"{check_number(part, received)}, but {part.check.algorithm.name}"
    rule = f"{part.name} is {what} over block {index + 1} gives {check_number(part, expected)}"
    return rule, explain_mismatch(part.check, received, [Coverage(payload.data[block], "", 0)], own)


def _coverages(found: Dissection, plain: Mapping[str, bytes], over: Sequence[str]) -> list[Coverage]:
    """Return possible coverages of the check value."""
    way = found.frame.transparency
    match way:
        case PayloadStuffing():
            name = found.frame.envelope.payload.name
            bare = way.unstuff(plain[name])
            others = plain if bare is None else {**plain, name: bare}
            return coverages(plain, over, others, " without the stuffing")
        case FrameStuffing():
            sent = {name: found.cells[name].sent for name in plain}
            return coverages(plain, over, sent, " with the stuffing")
        case Coded():
            sent = {name: found.cells[name].sent for name in plain}
            return coverages(plain, over, sent, " as coded")
        case Plain() | SevenBit():
            return coverages(plain, over, plain, "")
        case _:
            assert_never(way)


def _value(found: Dissection, fault: Fault) -> Words:
    assert isinstance(fault.of, Step | Member)
    scalar = number_of(fault.of)
    seen = fault.seen or 0
    if isinstance(fault.of, FilledStep):
        received, right = (filled_number(fault.of, each) for each in (seen, fault.right or 0))
        rule = f"{fault.inside}{fault.of.name} is {received}, but {filled_text(fault.of)} gives {right}"
        return rule, "bytes were corrupted, or the sender computes another value"
    if scalar is None:
        return (
            f"{fault.inside}{fault.of.name} has an invalid byte 0x{seen:02X}",
            "bytes were corrupted on the wire",
        )
    same = (each for each in found.spans if (each.of, each.inside) == (fault.of, fault.inside))
    unread = next((text for each in same if (text := unread_text(fault.of, each.raw))), "")
    if isinstance(fault.of, ConstantStep):
        always = constant_text(fault.of)
        cause = "another message or revision of the protocol"
        return f"{fault.inside}{fault.of.name} is {unread or seen}, but is always {always}", cause
    shown = unread or value_text(scalar, seen)
    rule = f"{fault.inside}{fault.of.name} is {shown}, allowed are {limits_text(scalar)}"
    return rule, "the sender does not observe the range"


def _nearest(wanted: int, messages: Sequence[MessagePlan]) -> MessagePlan | None:
    """Return the known message whose number differs in the fewest bits."""

    def distance(message: MessagePlan) -> tuple[int, int, int]:
        return (message.id ^ wanted).bit_count(), abs(message.id - wanted), message.id

    return min(messages, key=distance, default=None)
