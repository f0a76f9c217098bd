"""What the templates of delimited frames place: every condition and statement ready made."""

from __future__ import annotations

from typing import Any

from qlinkgen.backends.c.delimited import DelimitedWriter, Run
from qlinkgen.backends.c.names import unsigned, unsigned_type
from qlinkgen.model.frame import DelimitedFrame
from qlinkgen.model.protocol import Protocol


def render(protocol: Protocol, frame: DelimitedFrame, writer: DelimitedWriter) -> dict[str, Any]:
    """Everything that frame and receiver templates need."""
    message, address = frame.part("message"), frame.part("address")
    bare = not frame.preamble or frame.parts[0].role != "constant"
    has_length = frame.part("length") is not None
    view: dict[str, Any] = {
        "lead": writer.lead,
        "lead_bytes": list(enumerate(writer.lead_bytes)),
        "head": writer.head,
        "tail": writer.tail,
        "head_and_tail": writer.head + writer.tail,
        "overhead": frame.overhead,
        "header": frame.header_size,
        "has_length": has_length,
        "needs_extent": not has_length,
        "needs_direction": (bare or not has_length) and len(protocol.directions) > 1,
        "reports_runs": bare,
        "stuffed_payload": frame.stuffing is not None and not writer.stuffed_whole,
        "max_payload": frame.payload.max_size,
        "id": writer.id_name,
        "id_type": unsigned_type(message.scalar.bits if message and message.scalar else 8),
        "address": writer.address_name,
        "address_type": unsigned_type(address.scalar.bits) if address and address.scalar else "",
        "id_value": writer.field("message", "body"),
        "address_value": writer.field("address", "body"),
        "wrong_head": writer.wrong_constants("body", header=True),
        "max_frame": frame.overhead + writer.most_payload,
        "max_wire": _max_wire(frame, writer),
        "index_type": unsigned_type(max(16, _max_wire(frame, writer).bit_length())),
        "header_constants": _header_constants(frame),
        "length_end": _end_of(frame, "length"),
        "body_size": _body_size(frame, writer),
    }
    view["parameters"] = ", ".join(
        [f"{view['id_type']} {writer.id_name}"]
        + ([f"{view['address_type']} {writer.address_name}"] if address else [])
    )
    view["arguments"] = ", ".join(name for name in (writer.id_name, writer.address_name) if name)
    view |= _public(view, writer, protocol)
    view |= (
        _length(frame, writer) | _lead(protocol, writer) | _stuffing(frame) | _directions(view, protocol.name)
    )
    if writer.stuffed_whole:
        return view | _stuffed(writer) | _streamed(frame, writer)
    return view | _plain(writer)


def _public(view: dict[str, Any], writer: DelimitedWriter, protocol: Protocol) -> dict[str, Any]:
    directed = view["needs_direction"]
    view["pass_decode_direction"] = "direction, " if directed else ""
    return {
        "tailed": writer.stuffed_whole or view["stuffed_payload"],
        "encode_trailer": "",
        "seal_checked": False,
        "decode_direction": f"{protocol.name}_direction_t direction, " if directed else "",
        "check_name": "message_check"
        if protocol.directions == ("message",)
        else "request_check or _response_check",
        "check_sender": _check_sender(view, protocol) if view["reports_runs"] else [],
    }


def _check_sender(view: dict[str, Any], protocol: Protocol) -> list[str]:
    values = ", ".join([view["id_value"]] + ([view["address_value"]] if view["address"] else []))
    refused = f"!{protocol.name}_admits_({view['pass_decode_direction']}{values})"
    return [f"if ({refused}) {{", f"    return {protocol.name.upper()}_ERROR_FRAME;", "}"]


def _max_wire(frame: DelimitedFrame, writer: DelimitedWriter) -> int:
    """Most bytes that a frame can claim to have, whether a message is so long or not."""
    most = frame.overhead + writer.most_payload
    if not writer.stuffed_whole or frame.stuffing is None:
        return most
    return most + (most - writer.lead) // len(frame.stuffing.after)


def _header_constants(frame: DelimitedFrame) -> list[tuple[int, str]]:
    """Place and value of each constant byte in front of the payload."""
    found, offset = [], 0
    for part in frame.parts:
        if part.role == "payload":
            break
        found += [(offset + i, unsigned(byte, 8, hexadecimal=True)) for i, byte in enumerate(part.constant)]
        offset += part.size
    return found


def _end_of(frame: DelimitedFrame, role: str) -> int:
    part = frame.part(role)  # type: ignore[arg-type]  # a Role each
    return frame.offset(part.name) + part.size if part else 0


def _body_size(frame: DelimitedFrame, writer: DelimitedWriter) -> int:
    if writer.stuffed_whole:
        return writer.head + frame.payload.max_size + writer.tail
    return writer.most_payload if frame.stuffing else 0


def _length(frame: DelimitedFrame, writer: DelimitedWriter) -> dict[str, Any]:
    length = frame.part("length")
    if length is None or length.scalar is None:
        return {"length_bounds": "", "length_value": ""}
    value, bias, scalar = writer.field("length", "body"), frame.length_bias, length.scalar
    least, most = bias + frame.payload.min_size, bias + writer.most_payload
    terms = [("<", least)] if least else []
    terms += [(">", most)] if most < scalar.natural_maximum else []

    def bounds(what: str) -> str:
        found = [f"{what} {sign} {unsigned(bound, scalar.bits)}" for sign, bound in terms]
        return " || ".join(f"({term})" for term in found) if len(found) > 1 else "".join(found)

    return {
        "length_bounds": bounds(value),
        "length_byte_bounds": bounds("byte") or "false",
        "length_value": f"{value} - {bias}U" if bias else value,
    }


def _lead(protocol: Protocol, writer: DelimitedWriter) -> dict[str, Any]:
    pairs = [(f"wire[{index}] != {byte}", index + 1) for index, byte in enumerate(writer.lead_bytes)]
    updates = [f"value = {protocol.name}_check_update(value, {byte});" for byte in writer.lead_bytes]
    return {
        "lead_checks": pairs,
        "update_lead": updates if writer.lead_covered else [],
        "update_lead_received": [_received(line) for line in updates] if writer.lead_covered else [],
    }


def _received(line: str) -> str:
    return line.replace("value = ", "receiver->check = ").replace("(value,", "(receiver->check,")


def _stuffing(frame: DelimitedFrame) -> dict[str, Any]:
    if frame.stuffing is None:
        return {"pattern": False, "insert": ""}
    after = [unsigned(byte, 8, hexadecimal=True) for byte in frame.stuffing.after]
    return {
        "insert": unsigned(frame.stuffing.insert, 8, hexadecimal=True),
        "mark": after[0],
        "pattern": len(after) > 1,
        "due_when_sent": _due(after, "wire[to - {}U]"),
        "due_when_received": _due_body(after, "body", "at"),
        "due_in_payload": _due_body(after, "payload", "index + 1U"),
        "due_at_end": _due(after, "wire[at - {}U]", single="wire[at - 1U]"),
        "due_in_sent": _due_body(after, "payload", "index").replace("payload[", "sent["),
    }


def _due(after: list[str], place: str, single: str = "byte") -> str:
    """A byte has to be inserted behind what was written last."""
    if len(after) == 1:
        return f"{single} == {after[0]}"
    terms = [f"({place.format(len(after) - index)} == {byte})" for index, byte in enumerate(after)]
    return " && ".join([f"(since >= {len(after)}U)", *reversed(terms)])


def _due_body(after: list[str], array: str, end: str) -> str:
    if len(after) == 1:
        return f"{array}[{'index' if array == 'payload' else f'{end} - 1U'}] == {after[0]}"
    terms = []
    for index, byte in enumerate(after):
        back = len(after) - index - (1 if array == "payload" else 0)
        name = "index" if array == "payload" else end
        terms.append(f"({array}[{name}{f' - {back}U' if back else ''}] == {byte})")
    return " && ".join([f"(since >= {len(after)}U)", *reversed(terms)])


def _directions(view: dict[str, Any], prefix: str) -> dict[str, Any]:
    directed = view["needs_direction"]
    return {
        "scan_direction": f"{prefix}_direction_t direction, " if directed else "",
        "init_direction": f", {prefix}_direction_t direction" if directed else "",
        "pass_direction": "receiver->direction, " if directed else "",
        "pass_body": ", receiver->body" if view["body_size"] else "",
        "scan_buffer": ", uint8_t *buffer" if view["body_size"] else "",
    }


def _stuffed(writer: DelimitedWriter) -> dict[str, Any]:
    """Seal and scan where the finished frame is stuffed."""
    trailer, check = writer.put_trailer("trailer"), writer.put_check("trailer", "value")
    wrong, differs = writer.wrong_constants("end", header=False), writer.check_differs("end", "value")
    start = f"(capacity - {writer.head + writer.tail}U - size)"
    sent = writer.runs(start, f"(capacity - {writer.tail}U)")
    return {
        "covers_body": writer.covers_body,
        "check_from_end": writer.tail - writer.check_from_payload,
        "put_header": writer.put_header("head", f"size + {writer.bias}U"),
        "put_trailer": trailer,
        "put_check": check,
        "seal_trailer": bool(trailer or check),
        "stuffed_when_sent": _stuffed_part(
            "from",
            f"capacity - {writer.head + writer.tail - writer.plain_head}U - size"
            if writer.plain_head
            else "",
            f"capacity - {writer.plain_tail}U" if writer.plain_tail else "",
        ),
        "stuffed_when_received": _stuffed_part(
            "at",
            f"{writer.plain_head}U" if writer.plain_head else "",
            f"total - {writer.plain_tail}U" if writer.plain_tail else "",
        ),
        "update_before": writer.update_lead
        + ([] if writer.covers_body else loops(sent, writer.prefix, array="wire")),
        "wrong_tail": wrong,
        "check_differs": differs,
        "reads_tail": bool(wrong or differs),
        "update_received": []
        if writer.covers_body
        else loops(writer.runs("0", f"payload + {writer.head}U"), writer.prefix, array="body"),
    }


def _stuffed_part(place: str, first: str, last: str) -> str:
    """A condition that holds where the byte before a place is stuffed, "" where every byte is."""
    terms = [f"({place} > ({first}))" if " " in first else f"({place} > {first})"] if first else []
    terms += [f"({place} <= ({last}))"] if last else []
    return " && ".join(terms)


def _streamed(frame: DelimitedFrame, writer: DelimitedWriter) -> dict[str, Any]:
    """The receiver that looks at each byte once; the length is the body's first byte."""
    largest = writer.head + frame.payload.max_size + writer.tail
    length = writer.field("length", "body")
    whole = writer.head + writer.tail - writer.bias
    before = whole - (writer.tail - writer.check_from_payload)
    constants = [
        writer.wrong_constants("body", header=True),
        writer.wrong_constants("end", header=False),
    ]
    return {
        "position_type": unsigned_type(max(8, largest.bit_length())),
        "whole": _sum(length, whole),
        "before_check": _sum(length, before),
        "has_trailer": writer.tail > 0,
        "wrong_constants": " || ".join(term for term in constants if term),
        "check_differs_streamed": writer.check_differs("end", "value"),
    }


def _sum(value: str, constant: int) -> str:
    if constant == 0:
        return value
    return f"({value} + {constant}U)" if constant > 0 else f"({value} - {-constant}U)"


def _plain(writer: DelimitedWriter) -> dict[str, Any]:
    """Seal and scan where the frame lies on the wire as it is."""
    body = writer.lead
    wrong, differs = writer.wrong_constants("end", header=False), writer.check_differs("end", "value")
    return {
        "put_header": writer.put_header("body" if body else "wire", f"sent + {writer.bias}U"),
        "put_trailer": writer.put_trailer("end"),
        "put_check": writer.put_check("end", "value"),
        "update_sent": writer.update_lead
        + loops(writer.runs(str(body), f"{writer.lead + writer.head}U + sent"), writer.prefix, array="wire"),
        "update_received": writer.update_lead
        + loops(writer.runs("0", f"payload + {writer.head}U"), writer.prefix, array="body"),
        "wrong_tail": wrong,
        "check_differs": differs,
        "reads_tail": bool(wrong or differs),
    }


def loops(runs: list[Run], prefix: str, *, array: str) -> list[str]:
    """Loops that take the covered bytes into the check value."""
    lines: list[str] = []
    for run in runs:
        lines.append(f"for (size_t covered = {run.first}; covered < ({run.end}); ++covered) {{")
        lines.append(f"    value = {prefix}_check_update(value, {array}[covered]);")
        lines.append("}")
    return lines
