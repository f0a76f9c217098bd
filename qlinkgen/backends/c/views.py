"""What the templates place of a frame of parts: every condition and statement ready made."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, assert_never

from qlinkgen.backends.c.layout import Layouts
from qlinkgen.backends.c.names import unsigned_type
from qlinkgen.backends.c.parts import PartWriter, in_hex, length_bounds, sender_of
from qlinkgen.plan.framing import ByLength, ByMessage, Hunt, InStep, Marks, Rescan
from qlinkgen.plan.transparency import FrameStuffing, Insertion, PayloadStuffing, Plain, SevenBit
from qlinkgen.plan.tree import Plan


def common_view(plan: Plan) -> dict[str, Any]:
    """What every frame has."""
    prefix, sender = plan.protocol.name, sender_of(plan.frame)
    ring, directed = plan.protocol.directions == ("message",), _directed(plan)
    return {
        "id": sender.id,
        "id_type": sender.id_type,
        "address": sender.address,
        "address_type": sender.address_type,
        "parameters": sender.parameters,
        "arguments": sender.arguments,
        "needs_direction": directed,
        "scan_direction": f"{prefix}_direction_t direction, " if directed else "",
        "init_direction": f", {prefix}_direction_t direction" if directed else "",
        "pass_direction": "receiver->direction, " if directed else "",
        "pass_decode_direction": "direction, " if directed else "",
        "check_name": "message_check" if ring else "request_check or _response_check",
        "bare": False,
        "needs_extent": False,
        "body_size": 0,
        "seal_checked": False,
        "max_wire": 0,
    }


def _directed(plan: Plan) -> bool:
    """To find the end of a frame, or to prove it, a receiver has to know whose it is."""
    receiver = plan.frame.receiver
    match receiver:
        case Hunt() | InStep():
            return False
        case Rescan():
            by_length = isinstance(plan.frame.end, ByLength)
            needed = receiver.bare or not receiver.verified or not by_length
        case Marks():
            needed = True
        case _:
            assert_never(receiver)
    return needed and plan.protocol.directions != ("message",)


def parts_view(plan: Plan, layouts: Layouts) -> dict[str, Any]:
    """The view of a frame of parts, whatever stuffs it."""
    writer = PartWriter(plan.protocol.name, plan.frame, sender_of(plan.frame), layouts)
    envelope, receiver, transparency = plan.frame.envelope, plan.frame.receiver, plan.frame.transparency
    bare = isinstance(receiver, Rescan) and receiver.bare
    view = common_view(plan) | {
        "bare": bare,
        "late_insert": False,
        "judged": isinstance(receiver, Rescan) and not receiver.verified,
        "has_length": envelope.length is not None,
        "needs_extent": isinstance(plan.frame.end, ByMessage),
        "lead": len(writer.lead),
        "lead_bytes": [in_hex(byte) for byte in writer.lead],
        "head": writer.head,
        "tail": envelope.trailer_size,
        "head_and_tail": writer.head + envelope.trailer_size,
        "header": envelope.header_size,
        "overhead": envelope.overhead,
        "tailed": not isinstance(transparency, Plain),
        "max_frame": envelope.max_frame,
        "max_wire": plan.frame.max_wire,
        "index_type": unsigned_type(max(16, plan.frame.max_wire.bit_length())),
        "id_value": writer.get(envelope.id),
        "address_value": writer.get(envelope.address),
        "wrong_tail": writer.wrong_tail("end"),
        "check_differs": writer.check_differs("end", "value"),
    }
    view["reads_tail"] = bool(view["wrong_tail"] or view["check_differs"])
    directed = view["pass_decode_direction"]
    match transparency:
        case Plain():
            return view | _unstuffed(writer, directed) | {"stuffed_payload": False}
        case PayloadStuffing():
            more = {"body_size": envelope.payload.most_sent, "stuffed_payload": True}
            return view | _unstuffed(writer, directed) | _inserted(transparency.rule) | more
        case FrameStuffing():
            view |= _stuffed(writer, transparency, directed) | _inserted(transparency.rule)
        case SevenBit():
            raise AssertionError("a marked frame has no parts that a length or its message ends")
        case _:
            assert_never(transparency)
    return view | _hunted(writer, receiver) if isinstance(receiver, Hunt) else view


def _unstuffed(writer: PartWriter, directed: str) -> dict[str, Any]:
    """Seal and scan where the header is on the wire as it is."""
    header = writer.envelope.header_size
    return {
        "put_header": writer.put_header("wire", "sent"),
        "put_trailer": writer.put_trailer("end"),
        "put_check": writer.put_check("end", "value"),
        "update_sent": writer.covered_loops("wire", "0", f"{header}U + sent"),
        "update_received": writer.covered_loops("wire", "0", f"payload + {header}U"),
        "head_checks": list(writer.head_checks("size", directed, all_there=True)),
    }


def _stuffed(writer: PartWriter, stuffing: FrameStuffing, directed: str) -> dict[str, Any]:
    """Seal and scan where the finished frame is stuffed."""
    trailer, check = writer.put_trailer("trailer"), writer.put_check("trailer", "value")
    tail, both = writer.envelope.trailer_size, writer.head + writer.envelope.trailer_size
    front, back = stuffing.front - len(writer.lead), stuffing.back
    part = writer.envelope.check
    sent = writer.covered_loops("wire", f"(capacity - {both}U - size)", f"(capacity - {tail}U)")
    received = writer.covered_loops("body", "0", f"payload + {writer.head}U")
    sent_from = f"(from > (capacity - {both - front}U - size))" if front else ""
    rule = stuffing.rule
    return {
        "body_size": both + writer.envelope.payload.most,
        "stuffed_payload": False,
        "covers_body": writer.covers_body,
        "check_from_end": writer.envelope.from_end(part) if part else 0,
        "put_header": writer.put_header("head", "size"),
        "put_trailer": trailer,
        "put_check": check,
        "seal_trailer": bool(trailer or check),
        "update_before": writer.lead_updates + ([] if writer.covers_body else sent),
        "update_lead": writer.lead_updates,
        "update_received": [] if writer.covers_body else received,
        "lead_checks": [(f"wire[{i}] != {in_hex(byte)}", i + 1) for i, byte in enumerate(writer.lead)],
        "head_checks": list(writer.head_checks("at", directed, all_there=False)),
        "stuffed_when_sent": _both(sent_from, f"(from <= (capacity - {back}U))" if back else ""),
        "stuffed_when_received": _both(
            f"(at > {front}U)" if front else "", f"(at <= (total - {back}U))" if back else ""
        ),
        "due_when_sent": _due(rule, "wire", "to", "byte"),
        "due_when_received": _due(rule, "body", "at", "byte"),
        "late_insert": isinstance(writer.frame.receiver, Rescan) and not back,
        "hunts": isinstance(writer.frame.receiver, Hunt),
    }


def _both(*terms: str) -> str:
    return " && ".join(term for term in terms if term)


def _inserted(rule: Insertion) -> dict[str, Any]:
    return {
        "insert": in_hex(rule.insert),
        "mark": in_hex(rule.after[0]),
        "pattern": len(rule.after) > 1,
        "due_in_payload": _due(rule, "payload", "index + 1U", "payload[index]"),
        "due_at_end": _due(rule, "wire", "at", "wire[at - 1U]"),
        "due_in_sent": _due(rule, "sent", "index + 1U", "sent[index]"),
    }


def _due(rule: Insertion, array: str, end: str, last: str) -> str:
    """A byte has to be inserted after the last one, which is before ``end``; ``since`` counts bytes."""
    size = len(rule.after)
    if size == 1:
        return f"{last} == {in_hex(rule.after[0])}"
    terms = [f"({array}[{end} - {size - at}U] == {in_hex(byte)})" for at, byte in enumerate(rule.after)]
    return " && ".join([f"(since >= {size}U)", *reversed(terms)])


def _hunted(writer: PartWriter, receiver: Hunt) -> dict[str, Any]:
    """The receiver that looks at each byte once; the length is the body's first byte."""
    envelope = writer.envelope
    assert envelope.length is not None
    assert envelope.check is not None
    length, both = envelope.length, writer.head + envelope.trailer_size
    whole = both - length.bias
    return {
        "mark": in_hex(receiver.mark),
        "insert": in_hex(receiver.insert),
        "position_type": unsigned_type(max(8, (both + envelope.payload.most).bit_length())),
        "length_bounds": length_bounds(length, "byte") or "false",
        "length_value": writer.payload_size(length),
        "whole": _plus(writer.get(length), whole),
        "before_check": _plus(writer.get(length), whole - envelope.check.size),
    }


def _plus(value: str, constant: int) -> str:
    if constant == 0:
        return value
    return f"({value} + {constant}U)" if constant > 0 else f"({value} - {-constant}U)"


def judgement(plan: Plan, heard: Sequence[str]) -> str:
    """The expression for what is wrong with the contents of ``receiver->frame``."""
    prefix, upper = plan.protocol.name, plan.protocol.name.upper()
    calls = [f"{prefix}_{direction}_check(&receiver->frame)" for direction in heard]
    if len(calls) == len(plan.protocol.directions) == 1:
        return calls[0]
    found = f"{upper}_ERROR_UNKNOWN"
    for direction, call in zip(heard, calls, strict=True):
        other = calls[-1] if len(calls) > 1 else found
        return f"(receiver->direction == {upper}_{direction.upper()}) ? {call} : {other}"
    return found
