"""Generates the statements of payloads in which fields may be absent: a walk with a moving pointer."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import field

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.c import checks, varied
from qlinkgen.backends.c.conditions import condition, numbers_of, place_of
from qlinkgen.backends.c.decode import Decoder
from qlinkgen.backends.c.encode import Encoder
from qlinkgen.backends.c.members import count_of, member_of
from qlinkgen.backends.c.names import count_type, grouped, unsigned, unsigned_type
from qlinkgen.backends.c.sizes import local, local_size, size_text, term_text
from qlinkgen.model import naming
from qlinkgen.model.types import Scalar
from qlinkgen.plan.expr import Size, Within
from qlinkgen.plan.openings import openings
from qlinkgen.plan.payload import (
    CountStep,
    PayloadPlan,
    Presence,
    RecordsStep,
    RecordStep,
    ReservedStep,
    RunStep,
    Segment,
    Step,
)


def has_member(segment: Segment) -> str:
    """The struct member that tells whether a segment is present, "" if it has none."""
    presence = segment.presence
    return f"has_{presence.field}" if presence and not presence.slot and segment.settable else ""


def size_lines(payload: PayloadPlan, records: Mapping[str, str]) -> list[str]:
    """Body of the function that returns the size of the payload of a struct.

    ``records`` are the prefixes of the functions of records.
    """
    always = sum(each.size or 0 for each in payload.segments if each.presence is None)
    lines = [f"size_t size = {always}U;"]
    for segment in payload.segments:
        if segment.presence is not None or segment.size is None:
            lines += _guarded(_sent(segment.presence, payload), _added(segment, records, "size"))
    return [*lines, "return size;"]


def _added(segment: Segment, records: Mapping[str, str], total: str) -> list[str]:
    """Statements that add the size of a segment of a struct to a local."""
    if segment.records is not None:
        return varied.size_lines(segment.records, records[segment.records.record.name], total)
    return [f"{total} += {f'{segment.size}U' if segment.size is not None else _struct_size(segment)};"]


def _struct_size(segment: Segment) -> str:
    run = segment.run
    assert run is not None
    count = f"(size_t)message->{count_of(run)}"
    if segment.terminator:
        return f"{count} + 1U"
    return f"{run.item_size}U * {count}" if run.item_size > 1 else count


def _sent(presence: Presence | None, payload: PayloadPlan) -> str:
    """The condition under which a segment is sent, "" if it always is."""
    if presence is None:
        return ""
    if presence.optional:
        return f"message->has_{presence.field}"
    return condition(presence.when, numbers_of(payload), place_of(payload))


def _guarded(test: str, lines: Iterable[str]) -> list[str]:
    if not test:
        return list(lines)
    inner = [f"    {line}" for line in lines]
    return [f"if ({test}) {{", *inner, "}"] if inner else []


@dataclass
class WalkedEncoder(Encoder):
    """Collects the statements that encode one message segment by segment."""

    function: str = ""
    #: The arguments of the functions of the message.
    arguments: str = ""

    def statements(self) -> list[str]:
        """Lines of the function body, without the last one."""
        lines: list[str] = []
        for run in self.payload.runs:
            lines.append(self._number_in_struct(run))
        lines += [f"const size_t size = {self.function}_size_({self.arguments.removesuffix(', ')});", ""]
        lines += self._checks()
        if any(segment.records for segment in self.payload.segments):
            self._refuse([f"size > {self.payload.most}U"], "LENGTH")
        self._refuse(["capacity < size"], "CAPACITY")
        lines += self._flushed()
        return [*lines, *self._segments()]

    def checks(self) -> list[str]:
        """Statements that check the values of a record."""
        return self._with_counts(self._checks())

    def writes(self) -> list[str]:
        """Statements that write the bytes of a record."""
        return self._with_counts(self._segments())

    def _with_counts(self, lines: list[str]) -> list[str]:
        """The statements, after the declarations of the numbers of items that they use."""
        found: list[str] = []
        for run in self.payload.runs:
            if any(re.search(rf"\b{local(run.name)}\b", line) for line in lines):
                found.append(self._number_in_struct(run))
        return [*found, *([""] if found else []), *lines]

    def _number_in_struct(self, run: RunStep) -> str:
        """The declaration of a number of items; a member of a union is read only where its case is sent."""
        kind, number = count_type(run.length.maximum), f"message->{count_of(run)}"
        if run.presence is not None and run.presence.slot:
            sent = condition(run.presence.when, numbers_of(self.payload), place_of(self.payload))
            number = f"({kind})(({sent}) ? {number} : 0U)"
        return f"const {kind} {local(run.name)} = {number};"

    def _segments(self) -> list[str]:
        """Statements that write each segment."""
        lines: list[str] = []
        last = self.payload.segments[-1]
        for segment in self.payload.segments:
            for step in segment.steps:
                self._write(step)
            if segment is not last and segment.records is None:
                self.lines.append(f"payload += {_length(segment, local_size)};")
            lines += self._if_sent(segment)
        return lines

    def _write(self, step: Step) -> None:
        if isinstance(step, CountStep) and step.sized:
            self.lines += self._sized(step, [])
        elif isinstance(step, RecordStep | RecordsStep) and step.walked:
            function = self.layouts.records[step.record.name]
            value = f"message->{member_of(step)}"
            if isinstance(step, RecordsStep):
                self.lines += self._loop(step, self._put_walked(step, function, f"{value}[index]"))
            else:
                self.lines += self._put_walked(step, function, value)
        else:
            super()._write(step)

    @staticmethod
    def _put_walked(step: RecordStep | RecordsStep, function: str, value: str) -> list[str]:
        size = varied.record_size(step, function, value)
        return [f"{function}_put_(&{value}, payload);", f"payload += {size};"]

    def _sized(self, step: CountStep, refused: list[str]) -> list[str]:
        """Statements that add up the bytes of records or of a choice, and refuse or write the count."""
        total = f"{step.run}_bytes"
        number = f"({total} + {step.term.more}U)" if step.term.more else total
        lines = refused
        if not refused:
            outer, self.lines = self.lines, []
            self._put(step.place, step.integer, f"({unsigned_type(step.integer.bits)}){number}")
            lines, self.lines = self.lines, outer
        inner = [f"size_t {total} = 0U;", ""]
        for segment in self.payload.counted(step.run):
            test = _sent(segment.presence, self.payload) if segment.counted else ""
            inner += _guarded(test, _added(segment, self.layouts.records, total))
        inner += lines
        return ["{", *(f"    {line}" if line else "" for line in inner), "}"]

    def _check(self, step: Step) -> None:
        if isinstance(step, CountStep) and step.sized:
            most = step.integer.maximum - step.term.more
            upper = self.layouts.prefix.upper()
            refused = checks.refusal([f"{step.run}_bytes > {most}U"], f"{upper}_ERROR_LENGTH")
            if most < min(0xFFFF, self.payload.most):
                self.lines += self._sized(step, refused)
            return
        super()._check(step)
        if isinstance(step, RecordsStep) and step.last:
            value = f"message->{member_of(step)}[index]"
            ends = f"({varied.is_last(step, value)})"
            differs = f"{ends} != ((index + 1U) == {local(step.name)})"
            refusal = checks.refusal([differs], f"{self.layouts.prefix.upper()}_ERROR_RANGE")
            self.lines += self._loop(step, refusal)
        if isinstance(step, RecordsStep) and openings(step):
            test = varied.opened(step, f"message->{member_of(step)}[index]")
            number = f"{step.length.maximum}U" if step.fixed else local(step.name)
            early = f"((index + 1U) < {number}) && ({test})"
            refusal = checks.refusal([early], f"{self.layouts.prefix.upper()}_ERROR_RANGE")
            self.lines += self._loop(step, refusal)

    def _if_sent(self, segment: Segment) -> list[str]:
        """The statements collected so far, for a segment that is sent."""
        return _guarded(_sent(segment.presence, self.payload), self._flushed())

    def _checks(self) -> list[str]:
        """Statements that check numbers of items, then values."""
        lines: list[str] = []
        for segment in self.payload.segments:
            run = segment.run
            if isinstance(segment.records, RecordsStep) and not segment.records.fixed:
                run = segment.records
            if run is not None:
                held = Within(0, (1 << int(count_type(run.length.maximum)[4:-2])) - 1)
                bounds = self.payload.sendable(run)
                self._refuse(checks.broken([bounds], local(run.name), held, 16), "LENGTH")
                lines += self._if_sent(segment)
        before = ""
        for segment in self.payload.segments:
            if segment.presence is not None and segment.presence.optional:
                if before:
                    self._refuse([f"message->{has_member(segment)} && !message->{before}"], "RANGE")
                    lines += self._flushed()
                before = has_member(segment)
            for step in segment.steps:
                self._check(step)
            lines += self._if_sent(segment)
        return lines

    def _flushed(self) -> list[str]:
        lines, self.lines = self.lines, []
        return lines


def _length(segment: Segment, count: Callable[[str], str]) -> str:
    run = segment.run
    if run is None:
        return f"{segment.size}U"
    if segment.terminator:
        return f"{count(run.name)} + 1U"
    return f"{run.item_size}U * {count(run.name)}" if run.item_size > 1 else count(run.name)


@dataclass
class WalkedDecoder(Decoder):
    """Collects the statements that decode one message segment by segment."""

    init: str = ""
    counted: set[str] = field(default_factory=set)

    def statements(self) -> list[str]:
        """Lines of the function body, without the last one."""
        numbers = numbers_of(self.payload)
        # A payload of reserved bytes alone has a size to check, and nothing to read.
        steps = [step for each in self.payload.segments for step in each.steps]
        runs = any(each.run or each.records for each in self.payload.segments)
        self.reads = runs or not all(isinstance(step, ReservedStep) for step in steps)
        kind = self.init.removesuffix("_INIT").lower()
        whole = bool(self.payload.settable)
        lines = [] if self.reads else ["(void)payload;"]
        lines += [f"const {kind}_t defaults = {self.init};"] if whole else []
        lines += self._locals()
        lines += ["*message = defaults;"] if whole else []
        for each in self.payload.decided_by:
            self.refuse(
                checks.refused_when_received(each.number, f"parts->{naming.member(each.name)}"), "RANGE"
            )
        lines += [*self._flushed(), *self._all(numbers)]
        self.refuse(["size != 0U"], "LENGTH")
        return [*lines, *self._flushed()]

    def record(self) -> list[str]:
        """Statements that decode a record of variable size, and tell the bytes that it used."""
        numbers = numbers_of(self.payload)
        kind = self.init.removesuffix("_INIT").lower()
        self.reads = True
        lines = [f"const {kind}_t defaults = {self.init};", "const size_t total = size;"]
        lines += [*self._locals(), "", "*message = defaults;", *self._all(numbers)]
        return [*lines, "*used = total - size;"]

    def _all(self, numbers: dict[str, Scalar]) -> list[str]:
        """Statements that decode every segment."""
        lines: list[str] = []
        for segment, cases in self.payload.by_choice:
            own = [line for each in cases or (segment,) for line in self._segment(each, numbers)]
            lines += self._within(segment.slot, own) if segment.counted else own
        return lines

    def _within(self, slot: str, lines: list[str]) -> list[str]:
        """The statements of a choice that fills its bytes."""
        size, error = f"{slot}_bytes", f"{self.layouts.prefix.upper()}_ERROR_LENGTH"
        return [
            *checks.refusal([f"size < {size}"], error),
            "{",
            f"    const size_t after = size - {size};",
            "",
            f"    size = {size};",
            *(f"    {line}" if line else "" for line in lines),
            *(f"    {line}" for line in checks.refusal(["size != 0U"], error)),
            "    size = after;",
            "}",
        ]

    def _locals(self) -> list[str]:
        """Declarations of numbers of items, and of bytes of records and choices."""
        choices = dict.fromkeys(each.slot for each in self.payload.segments if each.counted)
        lines = [f"size_t {slot}_bytes = 0U;" for slot in choices]
        for segment in self.payload.segments:
            run, records = segment.run, segment.records
            if run is not None:
                lines.append(f"size_t {local(run.name)} = 0U;")
            elif isinstance(records, RecordsStep):
                if varied.is_counted(self.payload, records.name):
                    lines.append(f"size_t {local(records.name)} = 0U;")
                if varied.is_sized(self.payload, records.name):
                    lines.append(f"size_t {records.name}_bytes = 0U;")
        return lines

    def _flushed(self) -> list[str]:
        lines, self.lines = self.lines, []
        return lines

    def _segment(self, segment: Segment, numbers: dict[str, Scalar]) -> list[str]:
        run = segment.run
        if segment.records is not None:
            self.lines += self._walked_records(segment, segment.records)
        else:
            if run is not None and segment.terminator:
                self._find_end(run, segment.terminator[0])
            elif run is not None and segment.rest is not None:
                self._infer_rest(run, segment.rest)
            else:
                self.refuse([f"size < {_length(segment, local)}"], "LENGTH")
            for step in segment.steps:
                self._read(step)
            self.lines += [f"payload += {_length(segment, local)};"] * self.reads
            self.lines.append(f"size -= {_length(segment, local)};")
        inner, presence = self._flushed(), segment.presence
        if presence is None:
            return inner
        test = "size > 0U" if presence.optional else condition(presence.when, numbers, place_of(self.payload))
        member = has_member(segment)
        if not member:
            return _guarded(test, inner)
        return [f"message->{member} = {test};", *_guarded(f"message->{member}", inner)]

    def _find_end(self, run: RunStep, terminator: int) -> None:
        """Find the terminator of a text."""
        length, name = run.length, local(run.name)
        end = unsigned(terminator, 8, hexadecimal=True)
        self.lines += [
            f"while (({name} < size) && ({name} <= {length.maximum}U) && (payload[{name}] != {end})) {{",
            f"    ++{name};",
            "}",
        ]
        low = [f"{name} < {length.minimum}U"] if length.minimum else []
        self.refuse([f"{name} == size", *low, f"{name} > {length.maximum}U"], "LENGTH")

    def _walked_records(self, segment: Segment, step: RecordStep | RecordsStep) -> list[str]:
        upper = self.layouts.prefix.upper()
        reader = varied.Reader(self.layouts.records[step.record.name], upper)
        if isinstance(step, RecordStep):
            return reader.one(step)
        if step.last:
            return reader.ended(step)
        exact, lines = "", list[str]()
        if segment.rest is not None:
            rest = grouped(size_text(segment.rest, local))
            exact = f"size - {rest}" if rest != "0U" else "size"
            lines = checks.refusal([f"size < {rest}"] if rest != "0U" else [], f"{upper}_ERROR_LENGTH")
        elif varied.is_sized(self.payload, step.name):
            exact = f"{step.name}_bytes"
            lines = checks.refusal([f"size < {exact}"], f"{upper}_ERROR_LENGTH")
        if step.fixed:
            return [*lines, *reader.counted(step, f"{step.length.maximum}U")]
        if varied.is_counted(self.payload, step.name):
            return [*lines, *reader.counted(step, local(step.name), exact=exact)]
        return [*lines, *reader.filled(step, exact)]

    def _infer_rest(self, run: RunStep, after: Size) -> None:
        length, name = run.length, local(run.name)
        rest = grouped(size_text(after, local))
        self.refuse([f"size < {rest}"] if rest != "0U" else [], "LENGTH")
        left = f"size - {rest}" if rest != "0U" else "size"
        if run.item_size > 1:
            left = grouped(left)
            self.refuse([f"({left} % {run.item_size}U) != 0U"], "LENGTH")
            left = f"{left} / {run.item_size}U"
        self.lines.append(f"{name} = {left};")
        low = [f"{name} < {length.minimum}U"] if length.minimum else []
        self.refuse([*low, f"{name} > {length.maximum}U"], "LENGTH")

    def _read(self, step: Step) -> None:
        if not isinstance(step, CountStep):
            super()._read(step)
            return
        self._get(step.place, step.integer)
        number = self.number(step)
        if step.sized:
            self._sized(step, number)
        elif step.run in self.counted:
            items = term_text(step.term, local(step.run))
            own = Within(0, step.integer.maximum)
            negative = checks.broken([own], number, Within(0, step.integer.mask), step.integer.bits)
            self.refuse([f"{number} != {items}", *negative], "LENGTH")
        else:
            self.counted.add(step.run)
            self.take(step, number)

    def _sized(self, step: CountStep, number: str) -> None:
        """Take the bytes of records from a count, or compare them."""
        size, more, held = f"{step.run}_bytes", step.term.more, Within(0, step.integer.mask)
        if size in self.counted:
            told = f"({size} + {more}U)" if more else size
            self.refuse([f"{number} != {told}"], "LENGTH")
            return
        self.counted.add(size)
        self.take_sized(step, number, held)
