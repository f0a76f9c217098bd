"""Frames of parts, lowered to the names, numbers and expressions that their templates place."""

from __future__ import annotations

from typing import Any

from qlinkgen.backends.python import scalars
from qlinkgen.backends.python.checks import check_bytes, checksum_definition, order_of, regular
from qlinkgen.backends.python.place import in_hex, literal
from qlinkgen.model.frame import Checksum, DelimitedFrame, Part, Role
from qlinkgen.model.protocol import Protocol


def is_unique(protocol: Protocol) -> bool:
    """The preamble cannot appear in a frame, and the rest is plain enough for the decoder that relies on it.

    Everything else is received by a decoder that looks again from the next byte on.
    """
    frame = protocol.frame
    if not isinstance(frame, DelimitedFrame) or not frame.unique_preamble or frame.stuffing is None:
        return False
    length, last = frame.parts[1], frame.parts[-1]
    if frame.stuffing.exempt != (frame.parts[0].name,) or length.role != "length" or length.size != 1:
        return False
    if last.checksum is None or not regular(last.checksum):
        return False
    covered = tuple(part.name for part in frame.parts if part.name in last.checksum.over)
    behind = tuple(part.name for part in frame.parts[-1 - len(covered) : -1])
    plain = all(part.role != "constant" for part in frame.parts[1:])
    return plain and bool(covered) and covered == behind and part_of(frame, "message").size == 1


def part_of(frame: DelimitedFrame, role: Role) -> Part:
    """The part of a role that is surely there."""
    part = frame.part(role)
    assert part is not None
    return part


def address_model(protocol: Protocol) -> dict[str, Any]:
    """What the base class of the messages says about the address."""
    name = protocol.address_name or ""
    part = protocol.frame.part("address") if isinstance(protocol.frame, DelimitedFrame) else None
    return {
        "address": name,
        "address_bytes": scalars.to_bytes(part.scalar, "number") if part and part.scalar else "",
        "default_address": protocol.bus.nodes[0] if protocol.bus.nodes else 0,
        "slots": f'"{name}",' if name else "",
        "address_parameter": f", {name}: int | None = None" if name else "",
    }


def _blank_header(frame: DelimitedFrame, start: int = 0) -> str:
    """A header of which only the address counts; the rest is not looked at once a frame was found."""
    part = frame.part("address")
    if part is None:
        return f"bytes({frame.header_size - start})"
    before = frame.offset(part.name) - start
    behind = frame.header_size - start - before - part.size
    pieces = [f"bytes({before})"] if before else []
    pieces.append(f"_address(cls, {part.name})")
    return " + ".join([*pieces, f"bytes({behind})"] if behind else pieces)


def unique_model(protocol: Protocol, sizes: list[int], prefix: str) -> dict[str, Any]:
    """Numbers of a frame whose preamble is unique; ``sizes`` are those of bodies that never vary."""
    frame = protocol.frame
    assert isinstance(frame, DelimitedFrame)
    assert frame.stuffing is not None
    checksum = frame.parts[-1].checksum
    assert checksum is not None
    length_end = frame.offset(frame.parts[1].name) + 1
    id_at = frame.offset(part_of(frame, "message").name)
    letter = _check_letter(checksum, prefix)
    return {
        "preamble": literal(frame.preamble),
        "mark": in_hex(frame.stuffing.after[0]),
        "insert": in_hex(frame.stuffing.insert),
        "header": frame.header_size,
        "overhead": frame.overhead,
        "length_end": length_end,
        "length_at": length_end - 1,
        "uncounted": frame.overhead - frame.length_bias,
        "min_length": frame.length_bias + frame.payload.min_size,
        "max_length": frame.length_bias + frame.payload.max_size,
        "body_start": len(frame.preamble),
        "cover_start": _cover_start(frame, checksum),
        "body_covered": _covered_body(frame, checksum),
        "id_at": id_at,
        "id_in_frame": f"frame[{id_at}]",
        "id_in_body": f"body[{id_at - len(frame.preamble)}]",
        "blank_header": _blank_header(frame, length_end),
        "trailer": frame.overhead - frame.header_size,
        "whole_sizes": sizes if letter else [],
        "prefix": prefix,
        "check_letter": letter,
        "verifies": True,
        "checksum": checksum_definition(checksum),
        "check_size": len(checksum.chunks),
        "check_order": order_of(checksum),
        **address_model(protocol),
    }


def _cover_start(frame: DelimitedFrame, checksum: Checksum) -> int:
    return min(frame.offset(name) for name in checksum.over)


def _covered_body(frame: DelimitedFrame, checksum: Checksum) -> str:
    skipped = _cover_start(frame, checksum) - len(frame.preamble)
    return f"body[{skipped}:]" if skipped else "body"


def _check_letter(checksum: Checksum, prefix: str) -> str:
    """Format of the checksum in the module's byte order, "" where struct has none."""
    order = "big" if prefix == ">" else "little"
    if len(checksum.chunks) > 1 and order_of(checksum) != order:
        return ""
    return {1: "B", 2: "H", 4: "I"}.get(len(checksum.chunks), "")


def seal_lines(frame: DelimitedFrame, fixed: int | None, prefix: str) -> list[str]:
    """The last step of an encoder; ``fixed`` is the size of the body where that is always the same."""
    checksum = frame.parts[-1].checksum
    assert checksum is not None
    size = len(checksum.chunks)
    parts = [f"crc >> {8 * index}" if index else "crc" for index in range(size)]
    tests = [
        f"{part} == _MARK" if index == size - 1 else f"{part} & 0xFF == _MARK"
        for index, part in enumerate(parts)
    ]
    last = f'return _PREAMBLE + body + crc.to_bytes({size}, "{order_of(checksum)}")'
    if fixed is not None and _check_letter(checksum, prefix):
        last = f"return _WHOLE_{fixed}(_PREAMBLE, body, crc)"
    return [
        f"crc = _crc({_covered_body(frame, checksum)}, _crc_start)",
        f"if _MARK in body or {' or '.join(reversed(tests))}:",
        "    return _stuffed(body, crc)",
        last,
    ]


# Any other frame of parts


def delimited_model(protocol: Protocol) -> dict[str, Any]:
    """Numbers and expressions of a frame that a receiver may have to look for again and again."""
    frame = protocol.frame
    assert isinstance(frame, DelimitedFrame)
    trailer = frame.overhead - frame.header_size
    message = part_of(frame, "message")
    assert message.scalar is not None
    model = {
        "preamble": literal(frame.preamble) if frame.preamble else "",
        "header": frame.header_size,
        "trailer": trailer,
        "overhead": frame.overhead,
        "max_frame": frame.overhead + _longest_payload(frame),
        "max_payload": frame.payload.max_size,
        "constants": _constants(frame),
        "blank_header": _blank_header(frame),
        "id_start": frame.offset(message.name),
        "id_end": frame.offset(message.name) + message.size,
        "id_of": _number_at(frame, message, "head"),
        "length": False,
        "checksum": "",
        **_address_at(frame),
        **address_model(protocol),
        **_stuffing(frame),
    }
    return model | _length(frame) | _checksum(frame)


def _longest_payload(frame: DelimitedFrame) -> int:
    most = frame.payload.max_size
    if frame.stuffing and frame.stuffing.before_checksum:
        most += most // len(frame.stuffing.after)
    return most


def _number_at(frame: DelimitedFrame, part: Part, source: str) -> str:
    assert part.scalar is not None
    start = frame.offset(part.name)
    if part.size == 1:
        return f"{source}[{start}]"
    return scalars.from_bytes(part.scalar, f"{source}[{start}:{start + part.size}]")


def _address_at(frame: DelimitedFrame) -> dict[str, Any]:
    part = frame.part("address")
    if part is None:
        return {"address_end": 0, "address_of": ""}
    return {"address_end": frame.offset(part.name) + part.size, "address_of": _number_at(frame, part, "head")}


def _place_in(frame: DelimitedFrame, part: Part) -> int:
    """Where a part begins: from the front, or negative from the end if it stands behind the payload."""
    index = frame.parts.index(part)
    if index < frame.parts.index(frame.payload):
        return frame.offset(part.name)
    return -sum(each.size for each in frame.parts[index:])


def _constants(frame: DelimitedFrame) -> str:
    pairs = [
        f"({_place_in(frame, part)}, {literal(part.constant)})"
        for part in frame.parts
        if part.role == "constant"
    ]
    return f"({', '.join(pairs)}{',' if len(pairs) == 1 else ''})"


def _length(frame: DelimitedFrame) -> dict[str, Any]:
    part = frame.part("length")
    if part is None or part.scalar is None:
        return {}
    start = frame.offset(part.name)
    return {
        "length": True,
        "bias": frame.length_bias,
        "min_length": frame.length_bias + frame.payload.min_size,
        "max_length": min(part.scalar.maximum, frame.length_bias + _longest_payload(frame)),
        "length_start": start,
        "length_end": start + part.size,
        "length_of": _number_at(frame, part, "head"),
        "length_bytes": scalars.to_bytes(part.scalar, "number"),
    }


def _stuffing(frame: DelimitedFrame) -> dict[str, Any]:
    stuffing = frame.stuffing
    if stuffing is None:
        return {"stuffed": ""}
    model: dict[str, Any] = {
        "stuffed": "payload" if stuffing.before_checksum else "frame",
        "after": literal(stuffing.after),
        "insert": literal(bytes((stuffing.insert,))),
    }
    open_parts = [index for index, part in enumerate(frame.parts) if part.name not in stuffing.exempt]
    first, last = open_parts[0], open_parts[-1]
    model["plain_front"] = sum(part.size for part in frame.parts[:first])
    model["plain_back"] = sum(part.size for part in frame.parts[last + 1 :])
    return model


def _checksum(frame: DelimitedFrame) -> dict[str, Any]:
    part = frame.part("checksum")
    if part is None or part.checksum is None:
        return {}
    start = _place_in(frame, part)
    end = start + part.size
    return {
        "checksum": checksum_definition(part.checksum),
        "check_bytes": check_bytes(part.checksum, "crc"),
        "check_size": part.size,
        "check_last": frame.parts[-1] is part,
        "check_start": start,
        "check_end": end or "",
        "covered": _covered(frame, part.checksum),
    }


def _covered(frame: DelimitedFrame, checksum: Checksum) -> str:
    """Expression for the bytes that the checksum covers: as few slices as it takes."""
    runs: list[list[Part]] = []
    for index, part in enumerate(frame.parts):
        if part.name in checksum.over:
            if runs and frame.parts[index - 1] is runs[-1][-1]:
                runs[-1].append(part)
            else:
                runs.append([part])
    return (
        " + ".join(f"frame[{_edge(frame, run[0])}:{_edge(frame, run[-1], behind=True)}]" for run in runs)
        or 'b""'
    )


def _edge(frame: DelimitedFrame, part: Part, *, behind: bool = False) -> str:
    """Where a part begins or ends, for a slice."""
    if part is frame.payload:
        behind_payload = frame.overhead - frame.header_size
        place = -behind_payload if behind else frame.header_size
        return str(place) if place or not behind else ""
    place = _place_in(frame, part) + (part.size if behind else 0)
    if behind and place == 0 and _place_in(frame, part) < 0:
        return ""
    return str(place) if place or behind else ""
