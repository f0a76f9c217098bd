"""Generates the statements that find the size of a walked payload in a frame without a length."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from qlinkgen.backends.c import checks
from qlinkgen.backends.c.conditions import condition, numbers_of
from qlinkgen.backends.c.names import scalar_type, unsigned, unsigned_type
from qlinkgen.model.integer import Integer
from qlinkgen.plan.payload import BitsStep, CountStep, Segment, Step, ValueStep

if TYPE_CHECKING:
    from qlinkgen.backends.c.sizes import Learner


def walked_size_lines(learner: Learner) -> list[str]:
    """Lines of the case, which end with a return."""
    return _Sizer(learner).lines()


class _Sizer:
    def __init__(self, learner: Learner) -> None:
        self._learner, self._payload = learner, learner.payload
        self._tested = {
            t.value for each in self._payload.segments if each.presence for t in each.presence.when
        }
        self._counted: set[str] = set()
        # Received bytes have not been checked: a bool may be any number here.
        numbers = numbers_of(self._payload)
        self._numbers = {name: replace(number, meaning=None) for name, number in numbers.items()}

    def lines(self) -> list[str]:
        """Lines of the case."""
        upper = self._learner.layouts.prefix.upper()
        names = [each for each in self._numbers if each in self._tested]
        lines = ["size_t at = 0U;"]
        lines += [f"{scalar_type(self._numbers[name])} {name}_raw;" for name in names]
        lines += [f"size_t {each.run}_count = 0U;" for each in self._counts()]
        lines.append(f"*size = {self._payload.least}U;")
        for segment in self._payload.segments:
            lines += self._segment(segment)
        lines += ["(void)at;", f"return (available < *size) ? {upper}_ERROR_TRUNCATED : {upper}_OK;"]
        return ["{", *(f"    {line}" for line in lines), "}"]

    def _counts(self) -> list[CountStep]:
        counts = (step for step in self._payload.steps if isinstance(step, CountStep))
        return list({step.run: step for step in counts}.values())

    def _segment(self, segment: Segment) -> list[str]:
        learner, run = self._learner, segment.run
        for step in segment.steps:
            self._decided(step)
        size = f"{segment.size}U"
        if run is not None:
            count = f"{run.name}_count"
            size = f"{run.item_size}U * {count}" if run.item_size > 1 else count
        least = run.item_size * run.length.minimum if run is not None and segment.presence is None else 0
        if run is not None or segment.presence is not None:
            learner.lines.append(f"*size += {size}{f' - {least}U' if least else ''};")
        learner.lines.append(f"at += {size};")
        inner, learner.lines = learner.lines, []
        if segment.presence is None:
            return inner
        test = condition(segment.presence.when, self._numbers, lambda name: f"{name}_raw")
        return [f"if ({test}) {{", *(f"    {line}" for line in inner), "}"]

    def _decided(self, step: Step) -> None:
        """Statements that read a step which decides later sizes."""
        if not isinstance(step, ValueStep | BitsStep | CountStep):
            return
        names = {each.name for each in step.members} if isinstance(step, BitsStep) else {step.name}
        if step.run in self._counted if isinstance(step, CountStep) else not names & self._tested:
            return
        learner, front = self._learner, step.place.front.fixed
        learner.refuse([f"available < (at + {front + step.integer.size}U)"], "TRUNCATED")
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
            self._counted.add(step.run)
            learner.take(step, raw)

    def _peek(self, integer: Integer, front: int) -> str:
        return self._learner.layouts.peek(integer, "payload", f"at + {front}U" if front else "at")

    def _assign(self, name: str, raw: str) -> None:
        value = checks.from_unsigned(self._numbers[name], raw, self._learner.layouts)
        self._learner.lines.append(f"{name}_raw = {value};")
