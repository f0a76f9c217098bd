"""Generates the statements that encode a payload: checks of sizes and values, then bytes in wire order."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import field
from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.c import checks, filled
from qlinkgen.backends.c.layout import Layouts, pointer
from qlinkgen.backends.c.members import count_of, member_of
from qlinkgen.backends.c.names import count_type, unsigned, unsigned_type
from qlinkgen.backends.c.sizes import index_of, local, local_size, plus, size_text, term_text
from qlinkgen.model.integer import BitOrder, Integer, packed_size
from qlinkgen.model.types import Scalar
from qlinkgen.plan.expr import Within
from qlinkgen.plan.payload import (
    BitsStep,
    BytesStep,
    ConstantStep,
    CountStep,
    FilledStep,
    ItemsStep,
    Member,
    PayloadPlan,
    Place,
    RecordPlan,
    RecordsStep,
    RecordStep,
    ReservedStep,
    RunStep,
    Step,
    ValueStep,
    term_of,
)


@dataclass
class Encoder:
    """Collects the statements for one message; counts are read from the struct once."""

    payload: PayloadPlan
    layouts: Layouts
    lines: list[str] = field(default_factory=list)

    def statements(self) -> list[str]:
        """Lines of the function body, without the last one."""
        for run in self.payload.runs:
            kind = count_type(run.length.maximum)
            self.lines.append(f"const {kind} {local(run.name)} = message->{count_of(run)};")
        size = f"{self.payload.most}U"
        if not self.payload.fixed:
            self.lines += [f"const size_t size = {size_text(self.payload.size, local_size)};", ""]
            size = "size"
        for run in self.payload.runs:
            held = Within(0, (1 << int(count_type(run.length.maximum)[4:-2])) - 1)
            bounds = self.payload.sendable(run)
            self._refuse(checks.broken([bounds], local(run.name), held, 16), "LENGTH")
        for step in self.payload.steps:
            self._check(step)
        self._refuse([f"capacity < {size}"], "CAPACITY")
        for step in self.payload.steps:
            self._write(step)
        return self.lines

    def checks(self) -> list[str]:
        """Statements that check the values of a record."""
        for step in self.payload.steps:
            self._check(step)
        return self.lines

    def writes(self) -> list[str]:
        """Statements that write the bytes of a record."""
        for step in self.payload.steps:
            self._write(step)
        return self.lines

    def _refuse(self, terms: list[str], status: str) -> None:
        self.lines += checks.refusal(terms, f"{self.layouts.prefix.upper()}_ERROR_{status}")

    # Checks

    def _check(self, step: Step) -> None:
        match step:
            case ValueStep():
                self._check_value(step)
            case BitsStep():
                for member in step.members:
                    self._check_value(member)
            case BytesStep():
                self._check_octets(step)
            case ItemsStep():
                terms = checks.refused_before_sending(step.number, f"message->{member_of(step)}[index]")
                refusal = checks.refusal(terms, f"{self.layouts.prefix.upper()}_ERROR_RANGE")
                self.lines += self._loop(step, refusal) if refusal else []
            case RecordStep():
                self.lines += self._checked(step.record, f"message->{member_of(step)}")
            case RecordsStep():
                refusal = self._checked(step.record, f"message->{member_of(step)}[index]")
                self.lines += self._loop(step, refusal) if refusal else []
            case ConstantStep() | ReservedStep() | CountStep() | FilledStep():
                pass
            case _:
                assert_never(step)

    def _check_octets(self, step: BytesStep) -> None:
        octets, count = f"message->{member_of(step)}", self._number_of(step)
        if step.excluded:
            barred = [self.layouts.has_octet(octets, count, each) for each in step.excluded]
            self._refuse(barred, "RANGE")
        if step.text:
            self._refuse([f"!{self.layouts.prefix}_is_text_({octets}, {count})"], "RANGE")

    def _check_value(self, value: ValueStep | Member) -> None:
        self._refuse(checks.refused_before_sending(value.number, f"message->{member_of(value)}"), "RANGE")

    def _checked(self, record: RecordPlan, value: str) -> list[str]:
        """The statement that checks a record; empty if all its values are legal."""
        encoder = type(self) if record.payload.walked else Encoder
        if not encoder(record.payload, self.layouts).checks():
            return []
        function = f"{self.layouts.records[record.name]}_check_"
        upper = self.layouts.prefix.upper()
        return checks.refusal([f"{function}(&{value}) != {upper}_OK"], f"{upper}_ERROR_RANGE")

    # Bytes

    def _write(self, step: Step) -> None:  # noqa: C901  # a case a step
        match step:
            case ValueStep():
                self._put(
                    step.place,
                    step.integer,
                    checks.as_unsigned(step.number, f"message->{member_of(step)}"),
                )
            case ConstantStep() | ReservedStep():
                self._write_fixed(step)
            case CountStep():
                number = (
                    f"({local(step.run)} * {step.term.factor}U)" if step.term.factor > 1 else local(step.run)
                )
                number = f"((({number}) + 7U) / 8U)" if step.term.packed else number
                number = plus(number, step.term.more)
                self._put(step.place, step.integer, f"({unsigned_type(step.integer.bits)}){number}")
            case FilledStep():
                self._put(step.place, step.integer, filled.right(step, self.layouts, local_size))
            case BitsStep():
                self._put(step.place, step.integer, _whole(step))
            case BytesStep():
                self._write_octets(step)
            case ItemsStep() if step.packed:
                self._write_row(step, step.packed)
            case ItemsStep():
                item = checks.as_unsigned(step.number, f"message->{member_of(step)}[index]")
                index = index_of(step.place, local_size, item_offset(step))
                self.lines += self._loop(step, [self.layouts.put(step.item, "payload", index, item)])
            case RecordStep():
                place = pointer("payload", index_of(step.place, local_size))
                name = member_of(step)
                self.lines.append(f"{self._put_record(step.record)}(&message->{name}, {place});")
            case RecordsStep():
                place = pointer("payload", index_of(step.place, local_size, item_offset(step)))
                name = member_of(step)
                call = f"{self._put_record(step.record)}(&message->{name}[index], {place});"
                self.lines += self._loop(step, [call])
            case _:
                assert_never(step)

    def _write_octets(self, step: BytesStep) -> None:
        index = index_of(step.place, local_size, "index")
        self.lines += self._loop(step, [f"payload[{index}] = message->{member_of(step)}[index];"])
        if step.terminator:
            end = unsigned(step.terminator[0], 8, hexadecimal=True)
            self.lines.append(f"payload[{local(step.name)}] = {end};")

    def _write_fixed(self, step: ConstantStep | ReservedStep) -> None:
        if step.integer.bits > 64:
            self.lines += [f"payload[{at}] = {octet};" for at, octet in wide_bytes(step, local_size)]
            return
        pattern = unsigned(step.value & step.integer.mask, step.integer.bits, hexadecimal=True)
        self._put(step.place, step.integer, pattern)

    def _put_record(self, record: RecordPlan) -> str:
        return f"{self.layouts.records[record.name]}_put_"

    def _write_row(self, step: ItemsStep, order: BitOrder) -> None:
        """Clear the bytes, and set the bits of each item."""
        most = packed_size(step.length.maximum, step.item.bits)
        size = f"{most}U" if step.fixed else term_text(term_of(step), local_size(step.name))
        place = index_of(step.place, local_size)
        octet = index_of(step.place, local_size, "index")
        self.lines += loop(size, [f"payload[{octet}] = 0U;"])
        item = checks.as_unsigned(step.number, f"message->{member_of(step)}[index]")
        put = self.layouts.put_row(step.item, order, pointer("payload", place), "index", item)
        self.lines += self._loop(step, [put])

    def _put(self, place: Place, integer: Integer, value: str) -> None:
        self.lines.append(self.layouts.put(integer, "payload", index_of(place, local_size), value))

    def _loop(self, run: RunStep, body: list[str]) -> list[str]:
        return loop(self._number_of(run), body, count_type(run.length.maximum))

    @staticmethod
    def _number_of(run: RunStep) -> str:
        return f"{run.length.maximum}U" if run.fixed else local(run.name)


def wide_bytes(step: ConstantStep | ReservedStep, count: Callable[[str], str]) -> Iterator[tuple[str, str]]:
    """Index and value of each byte of a number of more than 64 bits."""
    for at, byte in enumerate(step.integer.pack(step.value)):
        octet = unsigned(byte, 8, hexadecimal=True)
        yield index_of(step.place, count, f"{at}U") if at else index_of(step.place, count), octet


def item_offset(run: ItemsStep | RecordsStep) -> str:
    """Offset of an item in its run."""
    return "index" if run.item_size == 1 else f"({run.item_size}U * index)"


def loop(count: str, body: list[str], kind: str = "size_t") -> list[str]:
    """Statements for each item of a run."""
    return [f"for ({kind} index = 0U; index < {count}; ++index) {{", *(f"    {line}" for line in body), "}"]


def _whole(step: BitsStep) -> str:
    """The integer composed of its members."""
    bits = step.integer.bits
    terms = [_in_place(each.number, each.shift, f"message->{member_of(each)}", bits) for each in step.members]
    return terms[0] if len(terms) == 1 else f"({unsigned_type(bits)})({' | '.join(terms)})"


def _in_place(number: Scalar, shift: int, value: str, bits: int) -> str:
    kind = unsigned_type(bits)
    if number.meaning == "bool":
        return f"({value} ? {unsigned(1 << shift, bits, hexadecimal=True)} : {unsigned(0, bits)})"
    if number.signed and kind != unsigned_type(number.bits):
        value = f"({unsigned_type(number.bits)}){value}"  # prevents sign extension
    taken = f"({kind})(({kind}){value} & {unsigned(number.integer.mask, bits, hexadecimal=True)})"
    return f"({kind})({taken} << {shift})" if shift else taken
