"""Prints the statements, conditions and loops for the parts of a frame."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.c import filled
from qlinkgen.backends.c.check_values import CheckWriter
from qlinkgen.backends.c.checks import as_unsigned, from_unsigned, refused_before_sending
from qlinkgen.backends.c.conditional import ConditionalView, holds, refused
from qlinkgen.backends.c.layout import pointer
from qlinkgen.backends.c.names import unsigned, unsigned_type
from qlinkgen.backends.c.places import any_of, in_hex, refusal, shifted
from qlinkgen.model.naming import member
from qlinkgen.model.types import Characters
from qlinkgen.plan.conditional import Conditional
from qlinkgen.plan.envelope import Envelope
from qlinkgen.plan.parts import (
    AddressPart,
    AddressSlot,
    BlocksPart,
    CellPart,
    CheckPart,
    ConstantPart,
    ConstantSlot,
    EqualPart,
    IdPart,
    IdSlot,
    LengthPart,
    MarkPart,
    Part,
    PayloadPart,
    Slot,
)
from qlinkgen.plan.payload import Member


@dataclass(frozen=True)
class PartWriter(CheckWriter):
    """Prints the parts of a frame."""

    # To the wire

    def put_header(self, place: str, sent: str) -> list[str]:
        """Statements that write the header; ``place`` is the body."""
        return [line for part in self._always(self._front()) for line in self._put(part, place, place, sent)]

    def put_trailer(self, place: str, header: str) -> list[str]:
        """Statements that write parts after the payload, which ends at ``place``."""
        return [
            line for part in self._always(self.envelope.back) for line in self._put(part, place, header, "")
        ]

    def _always(self, parts: Iterable[Part]) -> list[Part]:
        """Those parts that each frame has."""
        return [part for part in parts if all(part not in each.parts for each in self.envelope.conditional)]

    def conditional(self, found: Conditional | None, place: str) -> ConditionalView | None:
        """Parts that only some frames have; those after the payload begin at ``place``."""
        if found is None:
            return None
        filled = [self.fill(part, "wire", place, f"{self.head_text} + sent") for part in found.checks]
        return ConditionalView(
            sent=holds(self, found, "wire"),
            received=holds(self, found, "body"),
            size=found.size,
            put=[
                *(line for part in found.parts for line in self._put(part, place, "wire", "sent")),
                *(line for lines in filled for line in lines),
            ],
            refused=refused(found),
        )

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
                if part.otherwise is not None:
                    counted = f"(({counted}) > {part.most}U) ? {part.otherwise}U : ({counted})"
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
        terms = [shifted(self._slot(slot, kind), slot.shift, kind) for slot in part.slots]
        return terms[0] if len(terms) == 1 else f"({kind})({' | '.join(terms)})"

    def _slot(self, slot: Slot, kind: str) -> str:
        match slot:
            case IdSlot():
                shifted = f"({self.sender.id} >> {slot.at})" if slot.at else self.sender.id
            case AddressSlot():
                shifted = self.sender.address
            case ConstantSlot():
                return f"({kind}){unsigned(slot.values[0], slot.bits, hexadecimal=True)}"
            case Member() if isinstance(slot.number.meaning, Characters):
                return self.layouts.get(slot.number.integer, f"parts->{member(slot.name)}", "0")
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
        """Statements that read the values of a received frame; those that it does not have get defaults."""
        lines = []
        others = {name for each in self.every for name in _names(each)} != _names(self.envelope)
        if others or any(each.values for each in self.envelope.conditional):
            lines += ["{", f"    const {self.prefix}_parts_t initial = {self.prefix.upper()}_PARTS_INIT;"]
            lines += ["    frame->parts = initial;", "}"]
        for part, each in self.envelope.values:
            kind = unsigned_type(each.bits)
            found = self.taken(self.get(part), each, whole=each.bits == part.integer.bits)
            raw = found if each.number.meaning == "bool" else f"({kind}){found}"
            value = from_unsigned(each.number, raw, self.layouts)
            line = f"frame->parts.{member(each.name)} = {value};"
            if isinstance(each.number.meaning, Characters):
                line = self.layouts.put(part.integer, f"frame->parts.{member(each.name)}", "0", found)
            tests = [holds(self, one, "body") for one in self.envelope.conditional if part in one.parts]
            lines += [f"if ({tests[0]}) {{", f"    {line}", "}"] if tests else [line]
        return lines

    # From the wire

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
        for part in self._always(self._front()):
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
                case IdPart() | AddressPart() | CellPart() if part.numbers:
                    test = f"!{self.own}_begins_(body, {counted})"
                    test = test if all_there else f"({counted} <= {end}U) && {test}"
                    yield from refusal(test, f"{self.prefix.upper()}_ERROR_FRAME")
                case IdPart() | AddressPart() | CellPart() | EqualPart():
                    yield from self._number_checks(part, f"{reached}{end}U", directed)
                case CheckPart():
                    pass
                case PayloadPart() | MarkPart() | BlocksPart():
                    raise AssertionError(f"{part.name} is not a part of a header")
                case _:
                    assert_never(part)
        if self.envelope.header_checks and not self.envelope.before:
            yield f"if ({reached}{self.head}U) {{"
            yield from (f"    {line}" for line in self._judged_header())
            yield "}"

    def late_checks(self, counted: str) -> list[str]:
        """Statements that check the end of a header of `head` bytes: its length, its check values."""
        before = self.envelope.before
        if before is None or not (before.length or self.envelope.header_checks):
            return []
        upper = self.prefix.upper()
        lines = [
            f"if ({counted} < head) {{",
            "    *used = head;",
            f"    return {upper}_ERROR_TRUNCATED;",
            "}",
        ]
        if before.length:
            lines.append(f"if (head > {self.least_head}U) {{")
            lines += [f"    {line}" for line in self._announced(before.length, all_there=True)]
            lines.append("}")
        return [*lines, *self._judged_header()]

    def _judged_header(self) -> Iterator[str]:
        for check in self.envelope.header_checks:
            yield from self.judge(check, "body", "body", "0U")

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
        found = [
            test for part in self._always(self.envelope.back) for test in self._wrong_at_end(part, place)
        ]
        if after := self.envelope.after:
            held = [test for part in after.parts for test in self._wrong_at_end(part, place)]
            wrong = f"({any_of(held)})" if len(held) > 1 else f"({held[0]})" if held else ""
            found += [f"({holds(self, after, 'body')}) && {wrong}"] if wrong else []
        return any_of(found)

    def _wrong_at_end(self, part: Part, place: str) -> Iterator[str]:
        """Conditions that hold if a part after the payload, which ends at ``place``, is wrong."""
        if isinstance(part, ConstantPart):
            for index, byte in enumerate(part.data, self._at(part)):
                yield f"{place}[{index}] != {in_hex(byte)}"
        yield from self._wrong(part)

    def _wrong(self, part: Part) -> Iterator[str]:
        """Conditions that hold if a constant, a derived number or a digit in an integer is wrong."""
        match part:
            case AddressPart() if part.digits:
                place, at = "end" if part in self.envelope.back else "body", self._at(part)
                if part.digits.base == 16:
                    yield self.layouts.wrong(
                        part.integer, part.digits, pointer(place, str(at)), f"{part.size}U"
                    )
                    return
                for each in (f"{place}[{at + index}]" for index in range(part.size)):
                    yield f"({each} < 0x30U) || ({each} > 0x39U)"
            case CellPart():
                for slot in part.constants:
                    found = self.taken(self.get(part), slot, whole=slot.bits == part.integer.bits)
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


def _names(envelope: Envelope) -> set[str]:
    """The values of a frame."""
    return {each.name for _, each in envelope.values}


def derived(part: EqualPart, other: str) -> str:
    """The value of a derived number."""
    return filled.derived(
        part.integer.bits, part.integer.mask, other, inverted=part.inverted, added=part.added
    )


def _signed(number: int) -> str:
    """A number that is added, with its sign."""
    return f"{'-' if number < 0 else '+'} {abs(number)}U"


def length_bounds(length: LengthPart, value: str) -> str:
    """The condition for a length out of range."""
    bits = length.integer.bits
    terms = [f"{value} < {unsigned(length.least, bits)}"] if length.least else []
    if length.otherwise is None:
        terms += [f"{value} > {unsigned(length.most, bits)}"] if length.most < length.integer.maximum else []
    elif (length.most + 1, length.otherwise) != (length.otherwise, length.integer.maximum):
        other = f"({value} != {unsigned(length.otherwise, bits)})"
        terms.append(f"({value} > {unsigned(length.most, bits)}) && {other}")
    return any_of(terms)
