"""Generates the statements that find the size of a walked payload in a frame without a length."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from qlinkgen.backends.c import checks
from qlinkgen.backends.c.checks import refusal
from qlinkgen.backends.c.conditions import condition
from qlinkgen.backends.c.names import scalar_type, unsigned, unsigned_type
from qlinkgen.model.condition import Test
from qlinkgen.model.integer import Integer
from qlinkgen.plan.expr import Within
from qlinkgen.plan.payload import (
    BitsStep,
    CountStep,
    Member,
    PayloadPlan,
    RecordsStep,
    RecordStep,
    RunStep,
    Segment,
    Step,
    ValueStep,
    by_choice,
    deciding,
    holders,
    nested,
    renamed,
    renamed_tests,
)

if TYPE_CHECKING:
    from qlinkgen.backends.c.sizes import Learner


def walked_size_lines(learner: Learner) -> list[str]:
    """Lines of the case, which end with a return."""
    return _Sizer(learner, learner.payload.segments).lines(learner.payload)


class _Sizer:
    """Collects the statements, those of records inside of others in blocks with other locals."""

    def __init__(
        self, learner: Learner, segments: Sequence[Segment], last: Sequence[Test] = (), depth: int = 0
    ) -> None:
        """``last`` tests values of a record."""
        self._learner, self._segments, self._depth = learner, segments, depth
        self._tested = {test.value for test in (*deciding(segments), *last)}
        self._steps = [step for each in segments for step in each.steps]
        self._counted: set[tuple[str, bool]] = set()
        # Received bytes have not been checked: a bool may be any number here.
        values = (each for each in holders(self._steps) if isinstance(each, ValueStep | Member))
        self._numbers = {each.name: replace(each.number, meaning=None) for each in values}

    def lines(self, payload: PayloadPlan) -> list[str]:
        """Lines of the case of a message."""
        upper = self._learner.layouts.prefix.upper()
        lines = ["size_t at = 0U;", *self._locals(), f"*size = {payload.least}U;", *self._walk()]
        if any(segment.records for segment in self._segments):
            lines += refusal([f"*size > {payload.most}U"], f"{upper}_ERROR_LENGTH")
        lines += ["(void)at;", f"return (available < *size) ? {upper}_ERROR_TRUNCATED : {upper}_OK;"]
        return ["{", *(f"    {line}" for line in lines), "}"]

    def _locals(self) -> list[str]:
        names = [each for each in self._numbers if each in self._tested]
        absent = {each.name for each in holders(self._steps) if each.presence}
        lines = [
            f"{scalar_type(self._numbers[name])} {name}_raw{' = 0' if name in absent else ''};"
            for name in names
        ]
        counts = (step for step in self._steps if isinstance(step, CountStep))
        found = dict.fromkeys(f"{step.run}_{'bytes' if step.sized else 'count'}" for step in counts)
        found |= {f"{each.run.name}_count": None for each in self._segments if each.run and each.terminator}
        return [*lines, *(f"size_t {name} = 0U;" for name in found)]

    def _walk(self) -> list[str]:
        lines: list[str] = []
        for segment, cases in by_choice(self._segments):
            if segment.counted:
                lines += [f"*size += {segment.slot}_bytes;", f"at += {segment.slot}_bytes;"]
                continue
            lines += [line for each in cases or (segment,) for line in self._segment(each)]
        return lines

    def _segment(self, segment: Segment) -> list[str]:
        learner, run = self._learner, segment.run
        if run is None and segment.records is None and segment.presence is not None:
            # Before its bytes are read: those of which the size is known belong to the payload.
            learner.lines.append(f"*size += {segment.size}U;")
        for step in segment.steps:
            self._decided(step)
        if segment.records is not None:
            learner.lines += self._records(segment.records, present=segment.presence is None)
        elif run is not None and segment.terminator:
            learner.lines += self._sought(run, segment)
        elif run is not None:
            count = f"{run.name}_count"
            size = f"{run.item_size}U * {count}" if run.item_size > 1 else count
            least = run.item_size * run.length.minimum if segment.presence is None else 0
            learner.lines.append(f"*size += {size}{f' - {least}U' if least else ''};")
            learner.lines.append(f"at += {size};")
        else:
            learner.lines.append(f"at += {segment.size}U;")
        inner, learner.lines = learner.lines, []
        if segment.presence is None:
            return inner
        return ["if (" + self._condition(segment.presence.when) + ") {", *_indented(inner), "}"]

    def _sought(self, run: RunStep, segment: Segment) -> list[str]:
        """Statements that look for the terminator of bytes, all of which is needed until it is there."""
        upper, count = self._learner.layouts.prefix.upper(), f"{run.name}_count"
        least, most = run.length.minimum, run.length.maximum
        end = unsigned(segment.terminator[0], 8, hexadecimal=True)
        short = [f"{count} < {least}U"] if least else []
        left = f"((at + {count}) < available) && ({count} <= {most}U)"
        return [
            *([f"*size += {least + 1}U;"] if segment.presence else []),
            f"while ({left} && (payload[at + {count}] != {end})) {{",
            f"    ++{count};",
            "}",
            *refusal([f"{count} > {most}U"], f"{upper}_ERROR_LENGTH"),
            f"if ((at + {count}) >= available) {{",
            *_indented(self._too_long(f"(at + {count}) >=")),
            "    *size = (*size > available) ? *size : (available + 1U);",
            f"    return {upper}_ERROR_TRUNCATED;",
            "}",
            *(refusal(short, f"{upper}_ERROR_LENGTH") if short else []),
            f"*size += {count}{f' - {least}U' if least else ''};",
            f"at += {count} + 1U;",
        ]

    def _condition(self, tests: Sequence[Test]) -> str:
        return condition(tests, self._numbers, lambda name: f"{name}_raw")

    def _records(self, step: RecordStep | RecordsStep, *, present: bool) -> list[str]:
        """Statements for walked records; some of them are in the minimum of what is ``present``."""
        own, suffix = step.record.payload, nested(self._depth + 1)
        if isinstance(step, RecordStep):
            more = [] if present else [f"*size += {own.least}U;"]
            return ["{", *_indented(self._inside(step, suffix, more)), "}"]
        counted = step.length.minimum if present else 0
        size = f"{step.name}_bytes"
        if (step.name, True) in self._counted:
            least = f" - {counted * own.least}U" if counted else ""
            return [f"*size += {size}{least};", f"at += {size};"]
        more, index = [f"*size += {own.least}U;"], f"index{suffix}"
        if counted:
            more = [f"if ({index} >= {counted}U) {{", *_indented(more), "}"]
        number = f"{step.length.maximum}U" if step.fixed or step.last else f"{step.name}_count"
        if not step.last:
            head = f"for (size_t {index} = 0U; {index} < {number}; ++{index}) {{"
            return [head, *_indented(self._inside(step, suffix, more)), "}"]
        ended = f"ended{suffix}"
        upper = self._learner.layouts.prefix.upper()
        head = f"for (size_t {index} = 0U; !{ended}; ++{index}) {{"
        bound = refusal([f"{index} >= {number}"], f"{upper}_ERROR_LENGTH")
        body = [*bound, *self._inside(step, suffix, more, ended)]
        return ["{", f"    bool {ended} = false;", "", *_indented([head, *_indented(body), "}"]), "}"]

    def _inside(
        self, step: RecordStep | RecordsStep, suffix: str, more: list[str], ended: str = ""
    ) -> list[str]:
        """Statements for one record; ``ended`` is the local that tells whether it is the last one."""
        last = renamed_tests(step.last, suffix) if isinstance(step, RecordsStep) else ()
        inner = _Sizer(self._learner, renamed(step.record.segments, suffix), last, self._depth + 1)
        outer, self._learner.lines = self._learner.lines, []
        lines = [*inner._locals(), *more, *inner._walk()]
        self._learner.lines = outer
        return [*lines, f"{ended} = {inner._condition(last)};"] if ended else lines

    def _decided(self, step: Step) -> None:
        """Statements that read a step which decides later sizes."""
        if not isinstance(step, ValueStep | BitsStep | CountStep):
            return
        names = {each.name for each in step.members} if isinstance(step, BitsStep) else {step.name}
        known = isinstance(step, CountStep) and (step.run, step.sized) in self._counted
        if known or (not isinstance(step, CountStep) and not names & self._tested):
            return
        learner, front = self._learner, step.place.front.fixed
        end = f"(at + {front + step.integer.size}U)"
        learner.lines += self._too_long(f"{end} >")
        learner.refuse([f"available < {end}"], "TRUNCATED")
        raw = self._peek(step.integer, front)
        if isinstance(step, ValueStep):
            self._assign(step.name, raw)
        elif isinstance(step, BitsStep):
            for member in step.members:
                if member.name in self._tested:
                    mask = unsigned((1 << member.bits) - 1, step.integer.bits, hexadecimal=True)
                    kind = unsigned_type(member.bits)
                    self._assign(member.name, f"({kind})(({raw} >> {member.shift}) & {mask})")
        else:
            self._counted.add((step.run, step.sized))
            if step.sized:
                learner.take_sized(step, raw, Within(0, step.integer.mask))
            else:
                learner.take(step, raw)

    def _too_long(self, bytes_and_operator: str) -> list[str]:
        """Refuse what no receiver has room for, where counts of records can add up to more."""
        payload, upper = self._learner.payload, self._learner.layouts.prefix.upper()
        if not any(segment.records for segment in payload.segments):
            return []
        return refusal([f"{bytes_and_operator} {payload.most}U"], f"{upper}_ERROR_LENGTH")

    def _peek(self, integer: Integer, front: int) -> str:
        return self._learner.layouts.peek(integer, "payload", f"at + {front}U" if front else "at")

    def _assign(self, name: str, raw: str) -> None:
        value = checks.from_unsigned(self._numbers[name], raw, self._learner.layouts)
        self._learner.lines.append(f"{name}_raw = {value};")


def _indented(lines: list[str]) -> list[str]:
    return [f"    {line}" if line else "" for line in lines]
