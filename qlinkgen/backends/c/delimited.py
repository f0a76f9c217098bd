"""Delimited frames: preamble, length, stuffing and check value as the statements that the templates place."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

from qlinkgen.backends.c.layout import Layouts
from qlinkgen.backends.c.names import unsigned, unsigned_type
from qlinkgen.model.frame import Checksum, DelimitedFrame, Part
from qlinkgen.model.naming import address_member
from qlinkgen.model.protocol import Protocol


@dataclass(frozen=True, slots=True)
class Run:
    """Bytes in a row, as the bounds of a loop."""

    first: str
    end: str


class DelimitedWriter:
    """Lowers a delimited frame.

    The unstuffed frame behind the lead (the constants in front that are not stuffed) is called its body:
    ``head`` bytes, the payload, ``tail`` bytes.
    """

    def __init__(self, protocol: Protocol, frame: DelimitedFrame, layouts: Layouts) -> None:
        """Find the lead, the head and the tail."""
        self.prefix = protocol.name
        self.bias = frame.length_bias
        self._frame = frame
        self._layouts = layouts
        names = [part.role for part in frame.parts]
        self._payload_at = names.index("payload")
        self._check = frame.part("checksum")
        self.id_name, self.address_name = frame_names(protocol)
        self._lead_parts = self._find_lead()
        self.lead = sum(part.size for part in self._lead_parts)
        self.head = frame.header_size - self.lead
        self.tail = sum(part.size for part in frame.parts[self._payload_at :])

    @property
    def lead_bytes(self) -> list[str]:
        """The constants in front."""
        return [_hex(byte) for part in self._lead_parts for byte in part.constant]

    @property
    def lead_covered(self) -> bool:
        """The check value covers the constants in front."""
        return any(self._covered(part) for part in self._lead_parts)

    @property
    def update_lead(self) -> list[str]:
        """Statements that take the lead into the check value, none where it is not covered."""
        lines = [f"value = {self.prefix}_check_update(value, {byte});" for byte in self.lead_bytes]
        return lines if self.lead_covered else []

    @property
    def check_from_payload(self) -> int:
        """Bytes between payload and check value; the whole tail where there is no check value."""
        return self._behind_payload(self._check) if self._check else self.tail

    @property
    def stuffed_whole(self) -> bool:
        """The finished frame is stuffed, so a body has to be unpacked before it can be looked at."""
        return self._frame.stuffing is not None and not self._frame.stuffing.before_checksum

    @property
    def plain_head(self) -> int:
        """Bytes at the front of the body that are not stuffed."""
        return sum(part.size for part in itertools.takewhile(self._exempt, self._head_parts()))

    @property
    def plain_tail(self) -> int:
        """Bytes at the end of the body that are not stuffed."""
        return sum(part.size for part in itertools.takewhile(self._exempt, reversed(self._tail_parts())))

    @property
    def streamed(self) -> bool:
        """Each byte can be taken as it comes: the preamble is unique, and the length stands first."""
        frame = self._frame
        length, stuffing = frame.part("length"), frame.stuffing
        if not frame.unique_preamble or length is None or stuffing is None or length.size != 1:
            return False
        bounded = frame.length_bias + frame.payload.max_size < stuffing.after[0]
        exempt = {part.name for part in frame.parts if part.name in stuffing.exempt} <= {
            frame.parts[0].name,
            length.name,
        }
        return frame.parts[1] is length and bounded and exempt and self.covers_body

    def put_header(self, place: str, length: str) -> list[str]:
        """Statements that write the parts between lead and payload; ``place`` is the body."""
        lines, offset = [], 0
        for part in self._head_parts():
            lines += self._put_part(part, place, offset, length)
            offset += part.size
        return lines

    def put_trailer(self, place: str) -> list[str]:
        """Statements that write the constants behind the payload; ``place`` is where the payload ends."""
        lines, offset = [], 0
        for part in self._frame.parts[self._payload_at + 1 :]:
            lines += [
                f"{place}[{offset + index}] = {_hex(byte)};" for index, byte in enumerate(part.constant)
            ]
            offset += part.size
        return lines

    def put_check(self, place: str, value: str) -> list[str]:
        """Statements that write the check value; ``place`` is where the payload ends."""
        if self._check is None or self._check.checksum is None:
            return []
        chunks, base = self._check.checksum.chunks, self._behind_payload(self._check)
        return [
            f"{place}[{base + index}] = (uint8_t)({_piece(value, chunk.shift, chunk.mask)});"
            for index, chunk in enumerate(chunks)
        ]

    def check_differs(self, place: str, value: str) -> str:
        """A condition that holds where the check value that was received is not ``value``."""
        if self._check is None or self._check.checksum is None:
            return ""
        base = self._behind_payload(self._check)
        return differs(self._check.checksum, place, base, value)

    def wrong_constants(self, place: str, *, header: bool) -> str:
        """A condition that holds where a constant of the body is wrong, "" without constants."""
        parts, offset, terms = (self._head_parts() if header else self._tail_parts()), 0, []
        for part in parts:
            terms += [
                f"{place}[{offset + index}] != {_hex(byte)}" for index, byte in enumerate(part.constant)
            ]
            offset += part.size
        return " || ".join(f"({term})" for term in terms) if len(terms) > 1 else "".join(terms)

    def field(self, role: str, place: str) -> str:
        """The expression for length, message id or address in a body, 0 where the frame has none."""
        offset = 0
        for part in self._head_parts():
            if part.role == role and part.scalar is not None:
                return self._layouts.get(part.scalar, place, str(offset))
            offset += part.size
        return "0U"

    def runs(self, start: str, payload_end: str) -> list[Run]:
        """Covered bytes of the body as loops over an index; ``start`` is the index of the body."""
        runs: list[Run] = []
        position, behind = 0, False
        for part in self._frame.parts[len(self._lead_parts) :]:
            first = _at(payload_end if behind else start, position)
            if part.role == "payload":
                behind, position = True, 0
            else:
                position += part.size
            end = _at(payload_end if behind else start, position)
            if self._covered(part):
                if runs and runs[-1].end == first:
                    runs[-1] = Run(runs[-1].first, end)
                else:
                    runs.append(Run(first, end))
        return runs

    def _find_lead(self) -> list[Part]:
        lead = []
        for part in self._frame.parts:
            if part.role != "constant" or (self.stuffed_whole and not self._exempt(part)):
                break
            lead.append(part)
        covered = [self._covered(part) for part in lead]
        # Part of the lead covered, part not: simpler to treat the constants as body.
        return lead if len(set(covered)) <= 1 else []

    def _head_parts(self) -> tuple[Part, ...]:
        return self._frame.parts[len(self._lead_parts) : self._payload_at]

    def _tail_parts(self) -> tuple[Part, ...]:
        return self._frame.parts[self._payload_at + 1 :]

    def _covered(self, part: Part) -> bool:
        return bool(self._check and self._check.checksum and part.name in self._check.checksum.over)

    def _exempt(self, part: Part) -> bool:
        stuffing = self._frame.stuffing
        return stuffing is None or part.name in stuffing.exempt

    @property
    def covers_body(self) -> bool:
        """Everything from the body's first byte to the check value is covered."""
        if self._check is None:
            return False
        until = self._frame.parts.index(self._check)
        return all(self._covered(part) for part in self._frame.parts[len(self._lead_parts) : until])

    def _behind_payload(self, wanted: Part) -> int:
        return sum(
            part.size for part in self._frame.parts[self._payload_at + 1 : self._frame.parts.index(wanted)]
        )

    @property
    def most_payload(self) -> int:
        """Most payload bytes that a length may announce, inserted ones included where it counts them."""
        stuffing, most = self._frame.stuffing, self._frame.payload.max_size
        return most + most // len(stuffing.after) if stuffing and stuffing.before_checksum else most

    def _put_part(self, part: Part, place: str, offset: int, length: str) -> list[str]:
        if part.role == "constant":
            return [f"{place}[{offset + index}] = {_hex(byte)};" for index, byte in enumerate(part.constant)]
        assert part.scalar is not None
        width = unsigned_type(part.scalar.bits)
        value = {"length": f"({width})({length})", "message": self.id_name, "address": self.address_name}[
            part.role
        ]
        return [self._layouts.put(part.scalar, place, str(offset), value)]


def frame_names(protocol: Protocol) -> tuple[str, str]:
    """What message id and address are called in C; an address that is itself called id keeps its name."""
    address = address_member(protocol.address_name or "")
    part = protocol.frame.part("message") if isinstance(protocol.frame, DelimitedFrame) else None
    return (address_member(part.name) if part and address == "id" else "id"), address


def differs(checksum: Checksum, place: str, base: int, value: str) -> str:
    """A condition that holds where received check bytes are not those of ``value``."""
    terms = [
        f"{place}[{base + index}] != (uint8_t)({_piece(value, chunk.shift, chunk.mask)})"
        for index, chunk in enumerate(checksum.chunks)
    ]
    return " || ".join(f"({term})" for term in terms) if len(terms) > 1 else terms[0]


def _piece(value: str, shift: int, mask: int) -> str:
    shifted = f"{value} >> {shift}" if shift else value
    return shifted if mask == 0xFF else f"({shifted}) & {_hex(mask)}"


def _hex(byte: int) -> str:
    return unsigned(byte, 8, hexadecimal=True)


def _at(base: str, offset: int) -> str:
    return f"{offset}U" if base == "0" else f"{base} + {offset}U" if offset else base
