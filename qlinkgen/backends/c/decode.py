"""Generates the statements that decode a payload: sizes first, then each step in wire order."""

from __future__ import annotations

from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.c import checks, filled
from qlinkgen.backends.c.encode import item_offset, loop, wide_bytes
from qlinkgen.backends.c.layout import pointer
from qlinkgen.backends.c.members import count_of, member_of
from qlinkgen.backends.c.names import count_type, grouped, unsigned, unsigned_type
from qlinkgen.backends.c.sizes import Learner, index_of, local, size_text, term_text
from qlinkgen.model.integer import Integer
from qlinkgen.model.types import Scalar
from qlinkgen.plan.expr import Within
from qlinkgen.plan.payload import (
    BitsStep,
    BytesStep,
    Compare,
    ConstantStep,
    CountStep,
    FilledStep,
    Infer,
    ItemsStep,
    Learn,
    Member,
    Place,
    RecordPlan,
    RecordsStep,
    RecordStep,
    ReservedStep,
    RunStep,
    Sizing,
    Step,
    ValueStep,
)


@dataclass
class Decoder(Learner):
    """Collects the statements for one message; afterwards `known` holds all runs of variable size.

    A count is read only after a check that its bytes have been received.
    """

    #: Whether any byte of the payload is read.
    reads: bool = False

    def statements(self) -> list[str]:
        """Lines of the function body, without the last one."""
        self._check_size()
        for each in self.payload.sizing:
            self._size(each)
        filled = len(self.lines)
        for step in self.payload.steps:
            self._read(step)
        if self.payload.trim is not None and self.reads:
            self.lines[filled:filled] = self._filling()
        return self.lines

    def _filling(self) -> list[str]:
        """Statements that add the zeros at the end that were not sent."""
        return [
            f"uint8_t whole[{self.payload.most}U] = {{0}};",
            f"{self.layouts.prefix}_copy_(whole, payload, size);",
            "payload = whole;",
        ]

    def record(self) -> list[str]:
        """Statements that decode a record, whose bytes are all there."""
        for step in self.payload.steps:
            self._read(step)
        return self.lines

    # Sizes

    def _check_size(self) -> None:
        plan = self.payload
        if plan.fixed:
            self.refuse([f"size {'!=' if plan.trim is None else '>'} {plan.most}U"], "LENGTH")
            return
        known = 1 if plan.empty_is_default else 0  # an empty payload has been handled before
        terms = [f"size < {plan.least}U"] if plan.least > known else []
        self.refuse([*terms, f"size > {plan.most}U"], "LENGTH")

    def _size(self, each: Sizing) -> None:
        match each:
            case Learn():
                self.learn(each.count)
                whole = len(self.known) == len(self.payload.runs)
                self.refuse([f"size {'!=' if whole else '<'} {grouped(self.least)}"], "LENGTH")
            case Compare():
                count = each.count
                items = term_text(count.term, local(count.run))
                number, own = self.number(count), Within(0, count.integer.maximum)
                negative = checks.broken([own], number, Within(0, count.integer.mask), count.integer.bits)
                self.refuse([f"{number} != {items}", *negative], "LENGTH")
            case Infer():
                self._infer(each.run, size_text(each.others, local))
            case _:
                assert_never(each)

    def _infer(self, run: RunStep, others: str) -> None:
        left, length = "size" if others == "0U" else f"size - {grouped(others)}", run.length
        if run.item_size > 1:
            left = grouped(left)
            self.refuse([f"({left} % {run.item_size}U) != 0U"], "LENGTH")
            left = f"{left} / {run.item_size}U"
        self.lines.append(f"const size_t {local(run.name)} = {left};")
        if self.known:  # otherwise implied by the bounds of the size
            self.refuse([f"{local(run.name)} > {length.maximum}U"], "LENGTH")
        self.known.append(run.name)

    # Values

    def _read(self, step: Step) -> None:
        target = f"message->{member_of(step)}"
        match step:
            case ValueStep():
                self._assign(target, step.number, self._get(step.place, step.integer))
            case ConstantStep() if step.integer.bits > 64:
                self.reads = True
                self.refuse([f"payload[{at}] != {octet}" for at, octet in wide_bytes(step, local)], "RANGE")
            case ConstantStep():
                self.refuse([other_than(step, self._get(step.place, step.integer))], "RANGE")
            case FilledStep():
                number = self._get(step.place, step.integer)
                self.refuse([filled.differs(step, number, self.layouts, local)], step.fault.upper())
            case ReservedStep():
                pass
            case CountStep():
                self._get(step.place, step.integer)
            case BitsStep():
                raw = self._get(step.place, step.integer)
                outer, self.lines = self.lines, [f"const {unsigned_type(step.integer.bits)} bits = {raw};"]
                for member in step.members:
                    self._member(member, step.integer.bits)
                self.lines = [*outer, "{", *(f"    {line}" for line in self.lines), "}"]
            case BytesStep() | ItemsStep() | RecordStep() | RecordsStep():
                self._read_run(step, target)
            case _:
                assert_never(step)

    def _read_run(self, step: RunStep | RecordStep, target: str) -> None:
        match step:
            case BytesStep():
                count, place = self._number_of(step), pointer("payload", index_of(step.place, local))
                prefix = self.layouts.prefix
                self.lines.append(f"{prefix}_copy_({target}, {place}, {count});")
                if step.text:
                    barred = [self.layouts.has_octet(target, count, each) for each in step.barred]
                    self.refuse([f"!{prefix}_is_text_({target}, {count})", *barred], "RANGE")
            case ItemsStep():
                count = self._number_of(step)
                outer, self.lines = self.lines, []
                self._assign(f"{target}[index]", step.number, self._item(step))
                self.lines = outer + loop(count, self.lines)
            case RecordStep():
                self.lines += self._record(step.record, target, step.place)
            case RecordsStep():
                count = self._number_of(step)
                self.lines += loop(
                    count, self._record(step.record, f"{target}[index]", step.place, item_offset(step))
                )
            case _:
                assert_never(step)

    def _record(self, record: RecordPlan, target: str, place: Place, further: str = "") -> list[str]:
        self.reads = True
        at, upper = pointer("payload", index_of(place, local, further)), self.layouts.prefix.upper()
        call = f"{self.layouts.records[record.name]}_get_(&{target}, {at})"
        if not filled.has_checks(record.payload):
            return checks.refusal([f"{call} != {upper}_OK"], f"{upper}_ERROR_RANGE")
        refusal = checks.refusal([f"status != (int){upper}_OK"], "status")
        return ["{", *(f"    {line}" for line in [f"const int status = {call};", "", *refusal]), "}"]

    def _item(self, step: ItemsStep) -> str:
        """The bits of the item at an index."""
        if not step.packed:
            return self._get(step.place, step.item, item_offset(step))
        self.reads = True
        start = pointer("payload", index_of(step.place, local))
        return self.layouts.get_row(step.item, step.packed, start, "index")

    def _get(self, place: Place, integer: Integer, further: str = "") -> str:
        """The bits of an integer; adds the check of its unused bits."""
        index = index_of(place, local, further)
        self.reads = True
        if unused := self.layouts.unused_bits(integer, "payload", index):
            self.refuse([unused], "RANGE")
        return self.layouts.get(integer, "payload", index)

    def _assign(self, target: str, number: Scalar, raw: str) -> None:
        if number.meaning == "bool":  # check the bits, since a C bool is always valid
            self.refuse(checks.refused_when_received(number, raw), "RANGE")
        self.lines.append(f"{target} = {checks.from_unsigned(number, raw, self.layouts)};")
        if number.meaning != "bool":
            self.refuse(checks.refused_when_received(number, target), "RANGE")

    def _member(self, member: Member, bits: int) -> None:
        mask = unsigned((1 << member.bits) - 1, bits, hexadecimal=True)
        raw = f"({f'(bits >> {member.shift})' if member.shift else 'bits'} & {mask})"
        kind = "" if member.number.meaning == "bool" else f"({unsigned_type(member.bits)})"
        self._assign(f"message->{member_of(member)}", member.number, f"{kind}{raw}")

    def _number_of(self, run: RunStep) -> str:
        """The number of items; if it varies, it is stored in the message."""
        self.reads = True
        if run.fixed:
            return f"{run.length.maximum}U"
        kind, number = count_type(run.length.maximum), local(run.name)
        self.lines.append(f"message->{count_of(run)} = ({kind}){number};")
        return number


def other_than(step: ConstantStep, number: str) -> str:
    """The condition for a number that is none of a constant."""
    patterns = [
        unsigned(each & step.integer.mask, step.integer.bits, hexadecimal=True)
        for each in (step.value, *step.accepted)
    ]
    terms = [f"{number} != {each}" for each in patterns]
    return terms[0] if len(terms) == 1 else " && ".join(f"({each})" for each in terms)
