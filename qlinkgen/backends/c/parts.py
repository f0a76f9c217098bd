"""Prints the statements, conditions and loops for the parts of a frame."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import assert_never

from qlinkgen.backends.c.checks import as_unsigned, from_unsigned, refused_before_sending
from qlinkgen.backends.c.crc import CheckView, render
from qlinkgen.backends.c.layout import Layouts
from qlinkgen.backends.c.names import grouped, unsigned, unsigned_type
from qlinkgen.model.checksum import Checksum
from qlinkgen.model.frame import ATTRIBUTE
from qlinkgen.model.naming import address_member, member
from qlinkgen.plan.check import Check
from qlinkgen.plan.framing import (
    AddressPart,
    AddressSlot,
    Bits,
    BlocksPart,
    ByTerminator,
    CellPart,
    CheckPart,
    ConstantPart,
    ConstantSlot,
    Envelope,
    EqualPart,
    FramePlan,
    IdPart,
    IdSlot,
    LengthPart,
    MarkPart,
    Numeric,
    Part,
    PayloadPart,
    Seed,
    Slot,
)
from qlinkgen.plan.payload import Member
from qlinkgen.plan.transparency import FrameStuffing


@dataclass(frozen=True, slots=True)
class Sender:
    """Message number, address and values of a frame: their C names and types; "" without them."""

    id: str
    id_type: str
    address: str
    address_type: str
    values_type: str

    @property
    def identity(self) -> str:
        """Message number and address as parameters."""
        address = f", {self.address_type} {self.address}" if self.address else ""
        return f"{self.id_type} {self.id}{address}"

    @property
    def parameters(self) -> str:
        """All as parameters."""
        return f"{self.identity}, const {self.values_type} *parts" if self.values_type else self.identity

    @property
    def arguments(self) -> str:
        """All as arguments."""
        parts = ("parts",) if self.values_type else ()
        return ", ".join((self.id, *((self.address,) if self.address else ()), *parts))


def sender_of(frame: FramePlan, prefix: str) -> Sender:
    """The sender of a frame; names are "id" and that of the address, changed if taken."""
    envelope = frame.envelope
    address = address_member(frame.address)
    address_type = unsigned_type(envelope.address[0].bits if envelope.address else 8)
    return Sender(
        address_member(frame.id_name) if address == "id" else "id",
        unsigned_type(sum(bits.bits for bits in envelope.id) or 8),
        address,
        address_type if address else "",
        f"{prefix}_parts_t" if envelope.values else "",
    )


@dataclass(frozen=True, slots=True)
class ValueView:
    """A function that computes a check value: its name, the name of the part, and statements.

    Attributes:
        seeded: it needs the bytes of the attributes of the message.
    """

    function: str
    part: str
    algorithm: CheckView
    updates: list[str]
    seeded: bool


@dataclass(frozen=True, slots=True)
class BlocksView:
    """Check values of blocks of a payload; ``put`` and ``differs`` are about the bytes after a block."""

    every: int
    size: int
    algorithm: CheckView
    put: list[str]
    differs: str


@dataclass(frozen=True)
class PartWriter:
    """Prints the envelope of a frame.

    A frame without its ``lead``, the constant at its front that is never stuffed, is called a body.
    """

    prefix: str
    frame: FramePlan
    sender: Sender
    layouts: Layouts
    #: Names and bytes of the attributes of any message that check values cover.
    seeds: tuple[tuple[str, bytes], ...] = ()
    #: A receiver knows the direction.
    directed: bool = False

    @property
    def envelope(self) -> Envelope:
        """Its parts."""
        return self.frame.envelope

    @property
    def stuffing(self) -> FrameStuffing | None:
        """The stuffing of whole frames."""
        found = self.frame.transparency
        return found if isinstance(found, FrameStuffing) else None

    @property
    def lead(self) -> bytes:
        """The unstuffed constant before the body; b"" if the body is the whole frame."""
        preamble, stuffing = self.envelope.preamble, self.stuffing
        return preamble if stuffing and len(preamble) <= stuffing.front else b""

    @property
    def head(self) -> int:
        """Size of the header of a body."""
        return self.envelope.header_size - len(self.lead)

    def parts(self) -> tuple[Part, ...]:
        """The parts of a body."""
        return self.envelope.parts[1:] if self.lead else self.envelope.parts

    @property
    def alone(self) -> CheckPart | None:
        """The only check value, if it follows the payload: wrapping and scanning compute it in passing."""
        checks = self.envelope.checks
        if len(checks) != 1 or checks[0] not in self.envelope.back or self.envelope.seeded:
            return None
        if checks[0].check.otherwise is not None:
            return None
        return checks[0]

    # To the wire

    def put_header(self, place: str, sent: str) -> list[str]:
        """Statements that write the header; ``place`` is the body."""
        return [line for part in self._front() for line in self._put(part, place, place, sent)]

    def put_trailer(self, place: str, header: str) -> list[str]:
        """Statements that write parts after the payload, which ends at ``place``."""
        return [line for part in self.envelope.back for line in self._put(part, place, header, "")]

    @property
    def reads_tail(self) -> bool:
        """Whether message id, address or a value follow the payload."""
        held = [bits.part for bits in (*self.envelope.id, *self.envelope.address)]
        return any(
            part in self.envelope.back for part in (*held, *(part for part, _ in self.envelope.values))
        )

    def _put(self, part: Part, place: str, header: str, sent: str) -> list[str]:
        at = self._at(part)
        match part:
            case ConstantPart():
                return [f"{place}[{at + index}] = {in_hex(byte)};" for index, byte in enumerate(part.data)]
            case LengthPart():
                counted = f"{sent} {_signed(part.bias)}"
                counted = f"({counted}) / {part.scale}U" if part.scale > 1 else counted
                total = f"({unsigned_type(part.integer.bits)})({counted})"
                return [self.layouts.put(part.integer, place, str(at), total)]
            case IdPart():
                return [self.layouts.put(part.integer, place, str(at), self.sender.id)]
            case AddressPart():
                return [self.layouts.put(part.integer, place, str(at), self.sender.address)]
            case CellPart():
                return [self.layouts.put(part.integer, place, str(at), self._cell(part))]
            case EqualPart():
                source = place if part.of in self.envelope.back else header
                return [
                    self.layouts.put(part.integer, place, str(at), derived(part, self.get(part.of, source)))
                ]
            case CheckPart() | BlocksPart() | PayloadPart() | MarkPart():
                return []
            case _:
                assert_never(part)

    def _cell(self, part: CellPart) -> str:
        """The integer of a part whose bits have several roles."""
        kind = unsigned_type(part.integer.bits)
        terms = [_shifted(self._slot(slot, kind), slot.shift, kind) for slot in part.slots]
        return terms[0] if len(terms) == 1 else f"({kind})({' | '.join(terms)})"

    def _slot(self, slot: Slot, kind: str) -> str:
        match slot:
            case IdSlot():
                shifted = f"({self.sender.id} >> {slot.at})" if slot.at else self.sender.id
            case AddressSlot():
                shifted = self.sender.address
            case ConstantSlot():
                return f"({kind}){unsigned(slot.values[0], slot.bits, hexadecimal=True)}"
            case Member():
                shifted = as_unsigned(slot.number, f"parts->{member(slot.name)}")
            case _:
                assert_never(slot)
        mask = unsigned((1 << slot.bits) - 1, slot.bits, hexadecimal=True)
        return f"({kind})({shifted} & {mask})"

    def refused_values(self, owner: str = "parts->") -> list[str]:
        """Conditions that hold if a value of the frame cannot be sent."""
        return [
            test
            for _, each in self.envelope.values
            for test in refused_before_sending(each.number, f"{owner}{member(each.name)}")
        ]

    def get_values(self) -> list[str]:
        """Statements that read the values of a received frame."""
        lines = []
        for part, each in self.envelope.values:
            kind = unsigned_type(each.bits)
            found = self._taken(self.get(part), each, whole=each.bits == part.integer.bits)
            raw = found if each.number.meaning == "bool" else f"({kind}){found}"
            value = from_unsigned(each.number, raw, self.layouts)
            lines.append(f"frame->parts.{member(each.name)} = {value};")
        return lines

    def put_check(self, place: str, value: str) -> list[str]:
        """Statements that write the check value; the payload ends at ``place``."""
        part = self.alone
        return put_check(part.check, place, self._at(part), value) if part else []

    # From the wire

    def number(self, pieces: tuple[Bits, ...]) -> str:
        """The message id or address in these pieces of a received frame, 0 if there are none."""
        kind = unsigned_type(sum(each.bits for each in pieces) or 8)
        if len(pieces) == 1 and pieces[0].whole:
            return self.get(pieces[0].part)
        terms = [_shifted(self._piece(each, kind), each.at, kind) for each in pieces]
        return (f"({kind})({' | '.join(terms)})" if len(terms) > 1 else terms[0]) if terms else "0U"

    def _piece(self, bits: Bits, kind: str) -> str:
        return f"({kind}){self._taken(self.get(bits.part), bits, whole=bits.whole)}"

    def get(self, part: Numeric, place: str = "") -> str:
        """The expression for the integer of a part, in a body or after the payload."""
        place = place or ("end" if part in self.envelope.back else "body")
        found, mask = self.layouts.get(part.integer, place, str(self._at(part))), part.integer.chunks[0].mask
        return found if part.size > 1 or mask == 0xFF else f"({found} & {in_hex(mask)})"

    def payload_size(self, length: LengthPart) -> str:
        """The payload size given by a length."""
        found = self.get(length)
        if length.scale > 1:
            found = f"((size_t){found} * {length.scale}U)"
        return f"{found} {_signed(-length.bias)}" if length.bias else found

    def head_checks(self, counted: str, directed: str, *, all_there: bool) -> Iterator[str]:
        """Statements that check a header, part by part in wire order.

        ``counted`` bytes of the body have been received: any number, or one more in each pass.
        """
        reached = f"{counted} {'>=' if all_there else '=='} "
        for part in self._front():
            end = self._at(part) + part.size
            match part:
                case ConstantPart():
                    for index, byte in enumerate(part.data, end - part.size):
                        test = f"({reached}{index + 1}U) && (body[{index}] != {in_hex(byte)})"
                        yield from refusal(test, f"{self.prefix.upper()}_ERROR_FRAME")
                case LengthPart():
                    yield f"if ({reached}{end}U) {{"
                    yield from (f"    {line}" for line in self._announced(part, all_there=all_there))
                    yield "}"
                case IdPart() | AddressPart() | CellPart() | EqualPart():
                    yield from self._number_checks(part, f"{reached}{end}U", directed)
                case CheckPart():
                    pass
                case PayloadPart() | MarkPart() | BlocksPart():
                    raise AssertionError(f"{part.name} is not a part of a header")
                case _:
                    assert_never(part)
        if self.envelope.header_checks:
            yield f"if ({reached}{self.head}U) {{"
            for check in self.envelope.header_checks:
                yield from (f"    {line}" for line in self.judge(check, "body", "body", "0U"))
            yield "}"

    def _number_checks(self, part: Part, reached: str, directed: str) -> Iterator[str]:
        for test in self._wrong(part):
            yield from refusal(f"({reached}) && ({test})", f"{self.prefix.upper()}_ERROR_FRAME")
        if self.frame.checks_header and self.envelope.identifies(part):
            yield from self._header_check(reached, part, directed)

    def whole_checks(self, directed: str) -> Iterator[str]:
        """Statements that check the header of a decoded frame in wire order, without its first constant."""
        upper = self.prefix.upper()
        for part in self.envelope.front[int(bool(self.envelope.preamble)) :]:
            match part:
                case ConstantPart():
                    for at, byte in enumerate(part.data, self._at(part)):
                        yield from refusal(f"body[{at}] != {in_hex(byte)}", f"{upper}_ERROR_FRAME")
                case LengthPart():
                    counted = f"(payload {_signed(part.bias)})" if part.bias else "payload"
                    seen = f"((size_t){self.get(part)} * {part.scale}U)" if part.scale > 1 else self.get(part)
                    yield from refusal(f"{seen} != {counted}", f"{upper}_ERROR_LENGTH")
                case IdPart() | AddressPart() | CellPart() | EqualPart():
                    for test in self._wrong(part):
                        yield from refusal(test, f"{upper}_ERROR_FRAME")
                    if self.frame.checks_header and self.envelope.identifies(part):
                        lines = list(self._header_check("true", part, directed))
                        yield from (line.removeprefix("    ") for line in lines[1:-1])
                case CheckPart():
                    pass
                case PayloadPart() | MarkPart() | BlocksPart():
                    raise AssertionError(f"{part.name} is not a part of a header")
                case _:
                    assert_never(part)

    def _announced(self, length: LengthPart, *, all_there: bool) -> Iterator[str]:
        if test := length_bounds(length, self.get(length)):
            yield from refusal(test, f"{self.prefix.upper()}_ERROR_LENGTH")
        yield f"payload = (size_t)({self.payload_size(length)});"
        if not all_there:
            yield f"total = payload + {self.head + self.envelope.trailer_size}U;"

    def _header_check(self, reached: str, part: Part, directed: str) -> Iterator[str]:
        """Statements that check number and address as far as received with a part."""
        envelope = self.envelope
        if not envelope.known_at(part, envelope.id):
            return
        found, located = self.number(envelope.id), envelope.known_at(part, envelope.address)
        if envelope.address:
            found += f", {self.number(envelope.address) if located else '0U'}"
        yield f"if ({reached}) {{"
        yield f"    status = {self.prefix}_header_check_({directed}{found});"
        wrong = f"!= {self.prefix.upper()}_OK"
        if not located:
            wrong = f"== {self.prefix.upper()}_ERROR_UNKNOWN"
        yield from (f"    {line}" for line in refusal(f"status {wrong}", "status"))
        yield "}"

    def wrong_tail(self, place: str) -> str:
        """The condition for a wrong constant or derived number after the payload, which ends at ``place``."""
        return any_of(
            test
            for part in self.envelope.back
            for test in (
                (
                    f"{place}[{self._at(part) + index}] != {in_hex(byte)}"
                    for index, byte in enumerate(part.data)
                )
                if isinstance(part, ConstantPart)
                else self._wrong(part)
            )
        )

    def _wrong(self, part: Part) -> Iterator[str]:
        """Conditions that hold if a constant or a derived number in an integer is wrong."""
        match part:
            case CellPart():
                for slot in part.constants:
                    found = self._taken(self.get(part), slot, whole=slot.bits == part.integer.bits)
                    tests = [
                        f"{found} != {unsigned(each, slot.bits, hexadecimal=True)}" for each in slot.values
                    ]
                    yield " && ".join(f"({test})" for test in tests) if len(tests) > 1 else tests[0]
            case EqualPart(inverted=True):
                # In this form gcc has no objection to the promotion of a complement.
                kind, every = (
                    unsigned_type(part.integer.bits),
                    unsigned(part.integer.mask, part.integer.bits, hexadecimal=True),
                )
                seen = self.get(part)
                if part.added:
                    less = unsigned(-part.added & part.integer.mask, part.integer.bits)
                    seen = f"({kind})(({seen} + {less}) & {every})"
                yield f"({seen} ^ {self.get(part.of)}) != {every}"
            case EqualPart():
                yield f"{self.get(part)} != {derived(part, self.get(part.of))}"
            case _:
                pass

    @staticmethod
    def _taken(found: str, bits: Bits | Slot, *, whole: bool) -> str:
        """The bits of an integer."""
        if whole:
            return found
        shifted = f"({found} >> {bits.shift})" if bits.shift else found
        return f"({shifted} & {unsigned((1 << bits.bits) - 1, bits.bits, hexadecimal=True)})"

    def check_differs(self, place: str, value: str) -> str:
        """The condition for a received check value other than ``value``."""
        part = self.alone
        return differs(part.check, place, self._at(part), value) if part else ""

    # The check value

    @property
    def lead_updates(self) -> list[str]:
        """Statements that update the only check value with the lead, none if it is not covered."""
        return self._lead_updates(self.alone, "check") if self.alone else []

    def _lead_updates(self, check: CheckPart, key: str) -> list[str]:
        covered = self.lead and self.envelope.parts[0].name in check.check.over
        return [f"value = {self.prefix}_{key}_update(value, {in_hex(b)});" for b in self.lead if covered]

    @property
    def covers_body(self) -> bool:
        """Whether the only check value covers the whole body before it and can be computed byte by byte."""
        check, parts = self.alone, self.parts()
        covered = tuple(part for part in parts if self.envelope.covered(part))
        return check is not None and covered == parts[: parts.index(check)]

    def covered_loops(self, array: str, start: str, payload_end: str) -> list[str]:
        """Loops that update the only check value with the covered bytes of an array."""
        return self._loops(self.alone, "check", array, start, payload_end) if self.alone else []

    def _loops(self, check: CheckPart, key: str, array: str, start: str, payload_end: str) -> list[str]:
        lines: list[str] = []
        for run in self.envelope.coverage(check):
            if isinstance(run, Seed):
                lines += self._seed_updates(run, key)
                continue
            parts = [part for part in run if part in self.parts()]
            if parts:
                first = self._place(parts[0], start, payload_end)
                end = self._place(parts[-1], start, payload_end, after=True)
                lines += [
                    f"for (size_t covered = {first}; covered < ({end}); ++covered) {{",
                    f"    value = {self.prefix}_{key}_update(value, {array}[covered]);",
                    "}",
                ]
        return lines

    def _place(self, part: Part, start: str, payload_end: str, *, after: bool = False) -> str:
        if after and part is self.envelope.payload:
            return payload_end
        base = payload_end if part in self.envelope.back else start
        return _sum(base, self._at(part) + (part.size if after else 0))

    def _seed_updates(self, seed: Seed, key: str) -> list[str]:
        """Statements that update a check value with a seed; ``seeds`` are the bytes of all of a message."""
        if not self.seeds:  # no messages
            return ["(void)seeds;"]
        names = [name.removeprefix(ATTRIBUTE) for name, _ in self.seeds]
        at = sum(len(data) for _, data in self.seeds[: names.index(seed.attribute)])
        size = len(self.seeds[names.index(seed.attribute)][1])
        return [f"value = {self.prefix}_{key}_update(value, seeds[{at + each}]);" for each in range(size)]

    # Several check values, or one before the payload

    @cached_property
    def algorithms(self) -> Mapping[Checksum, CheckView]:
        """Each algorithm of the frame, the main one first."""
        parts = sorted(self.envelope.checks, key=lambda part: part is not self.envelope.check)
        found = dict.fromkeys(part.check.algorithm for part in parts)
        if self.envelope.blocks:
            found[self.envelope.blocks.check.algorithm] = None
        return {each: render(each, number) for number, each in enumerate(found, 1)}

    @property
    def values(self) -> list[ValueView]:
        """The functions that compute check values; none if the only one is computed in passing."""
        return [self._value(part) for part in self.envelope.filling] if self.alone is None else []

    def _value(self, part: CheckPart) -> ValueView:
        algorithm = self.algorithms[part.check.algorithm]
        loops = self._loops(part, algorithm.key, "body", "0", "payload_end")
        updates = self._empty(part) + self._lead_updates(part, algorithm.key) + loops
        if not any("payload_end" in line for line in updates):
            updates.insert(0, "(void)payload_end;")
        seeded = part in self.envelope.seeded
        return ValueView(self._function(part), part.name, algorithm, updates, seeded=seeded)

    def _empty(self, part: CheckPart) -> list[str]:
        """The statement that returns the value where the payload, which alone is covered, is empty."""
        if part.check.otherwise is None:
            return []
        return refusal(
            f"payload_end == {self.head}U", unsigned(part.check.otherwise, part.check.algorithm.width)
        )

    @property
    def blocks(self) -> BlocksView | None:
        """The check values of the blocks of the payload, None if there are none."""
        part = self.envelope.blocks
        if part is None:
            return None
        return BlocksView(
            part.every,
            part.check.size,
            self.algorithms[part.check.algorithm],
            put_check(part.check, "block", 0, "value"),
            differs(part.check, "block", 0, "value"),
        )

    def _function(self, part: CheckPart) -> str:
        return f"{self.prefix}_value_{self.envelope.checks.index(part) + 1}_"

    def fills(self, body: str, end: str, payload_end: str) -> list[str]:
        """Statements that compute and write the check values of a body; ``end`` is the end of its payload."""
        lines: list[str] = []
        for part in self.envelope.filling if self.alone is None else ():
            place = end if part in self.envelope.back else body
            lines += self._computed(part, body, payload_end, f"{self.prefix}_seeds_({self.sender.id})")
            lines += [f"    {line}" for line in put_check(part.check, place, self._at(part), "value")]
            lines.append("}")
        return lines

    def judges(self, body: str, end: str, payload_end: str) -> list[str]:
        """Statements that verify the check values that are not verified before the payload."""
        if self.alone is not None:
            return []
        early = () if isinstance(self.frame.end, ByTerminator) else self.envelope.header_checks
        seeded = self.envelope.seeded
        late = [part for part in self.envelope.checks if part not in (*early, *seeded)]
        lines = [line for part in late for line in self.judge(part, body, end, payload_end)]
        if seeded:
            directed = "direction, " if self.directed else ""
            known = f"{self.prefix}_known_seeds_({directed}{self.number(self.envelope.id)})"
            lines += ["{", f"    const uint8_t *const seeds = {known};"]
            lines += indented(refusal("seeds == NULL", f"{self.prefix.upper()}_ERROR_UNKNOWN"))
            for part in seeded:
                lines += indented(self.judge(part, body, end, payload_end))
            lines.append("}")
        return lines

    def judge(self, part: CheckPart, body: str, end: str, payload_end: str) -> list[str]:
        """Statements that verify a check value."""
        place = end if part in self.envelope.back else body
        test = differs(part.check, place, self._at(part), "value")
        wrong = refusal(test, f"{self.prefix.upper()}_ERROR_CRC")
        return [*self._computed(part, body, payload_end), *(f"    {line}" for line in wrong), "}"]

    def _computed(self, part: CheckPart, body: str, payload_end: str, seeds: str = "seeds") -> list[str]:
        kind = self.algorithms[part.check.algorithm].type
        more = f", {seeds}" if part in self.envelope.seeded else ""
        return ["{", f"    const {kind} value = {self._function(part)}({body}, {payload_end}{more});"]

    # Places

    def _front(self) -> tuple[Part, ...]:
        return self.envelope.front[1:] if self.lead else self.envelope.front

    def _at(self, part: Part) -> int:
        """Offset of a part in the body, or after the payload."""
        trailing = part in self.envelope.back
        return self.envelope.offset(part) - (self.envelope.header_size if trailing else len(self.lead))


def derived(part: EqualPart, other: str) -> str:
    """The value of a derived number."""
    kind, mask = unsigned_type(part.integer.bits), part.integer.mask
    every = unsigned(mask, part.integer.bits, hexadecimal=True)
    value = f"({kind})({every} - {other})" if part.inverted else other
    if not part.added:
        return value
    added = f"{value} + {unsigned(part.added & mask, part.integer.bits)}"
    return f"({kind})(({added}) & {every})"


def _signed(number: int) -> str:
    """A number that is added, with its sign."""
    return f"{'-' if number < 0 else '+'} {abs(number)}U"


def _shifted(value: str, shift: int, kind: str) -> str:
    return f"({kind})({value} << {shift})" if shift else value


def length_bounds(length: LengthPart, value: str) -> str:
    """The condition for a length out of range."""
    bits = length.integer.bits
    terms = [f"{value} < {unsigned(length.least, bits)}"] if length.least else []
    terms += [f"{value} > {unsigned(length.most, bits)}"] if length.most < length.integer.maximum else []
    return any_of(terms)


def any_of(terms: Iterator[str] | list[str]) -> str:
    """The disjunction of conditions, "" without conditions."""
    found = list(terms)
    return " || ".join(f"({term})" for term in found) if len(found) > 1 else "".join(found)


def refusal(test: str, status: str) -> list[str]:
    """A statement that returns a status if a condition holds."""
    return [f"if ({test}) {{", f"    return {status};", "}"]


def put_check(check: Check, place: str, at: int, value: str) -> list[str]:
    """Statements that write a check value."""
    return [
        f"{place}[{at + index}] = (uint8_t)({_piece(value, chunk.shift, chunk.mask)});"
        for index, chunk in enumerate(check.value.chunks)
    ]


def differs(check: Check, place: str, at: int, value: str) -> str:
    """The condition for received check bytes that differ from ``value``."""
    return any_of(
        f"{place}[{at + index}] != (uint8_t)({_piece(value, chunk.shift, chunk.mask)})"
        for index, chunk in enumerate(check.value.chunks)
    )


def indented(lines: list[str]) -> list[str]:
    """Lines one level deeper."""
    return [f"    {line}" for line in lines]


def in_hex(byte: int) -> str:
    """A byte as a constant."""
    return unsigned(byte, 8, hexadecimal=True)


def _piece(value: str, shift: int, mask: int) -> str:
    shifted = f"{value} >> {shift}" if shift else value
    return shifted if mask == 0xFF else f"{grouped(shifted)} & {in_hex(mask)}"


def _sum(base: str, offset: int) -> str:
    return f"{offset}U" if base == "0" else f"{base} + {offset}U" if offset else base
