"""Prints the check values of a frame: how they are computed, written and verified."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cached_property

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.c.conditional import holds
from qlinkgen.backends.c.crc import CheckView, render
from qlinkgen.backends.c.names import grouped, unsigned
from qlinkgen.backends.c.places import Places, any_of, in_hex, indented, refusal
from qlinkgen.model.checksum import Checksum
from qlinkgen.model.frame import ATTRIBUTE
from qlinkgen.plan.check import Check
from qlinkgen.plan.parts import CheckPart, Seed


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
class CheckWriter(Places):
    """Prints the check values of a frame."""

    @property
    def alone(self) -> CheckPart | None:
        """The only check value, if it follows the payload: wrapping and scanning compute it in passing."""
        checks = self.envelope.checks
        if len(checks) != 1 or checks[0] not in self.envelope.back or self.envelope.seeded:
            return None
        if self.envelope.conditional_checks:
            return None
        if checks[0].check.otherwise is not None:
            return None
        return checks[0]

    def put_check(self, place: str, value: str) -> list[str]:
        """Statements that write the check value; the payload ends at ``place``."""
        part = self.alone
        return put_check(part.check, place, self._at(part), value) if part else []

    def check_differs(self, place: str, value: str) -> str:
        """The condition for a received check value other than ``value``."""
        part = self.alone
        return differs(part.check, place, self._at(part), value) if part else ""

    # The check value

    @property
    def lead_updates(self) -> list[str]:
        """Statements that update the only check value with the lead, none if it is not covered."""
        if self.alone is None:
            return []
        return self._lead_updates(self.alone, self.algorithms[self.alone.check.algorithm].key)

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
        if self.alone is None:
            return []
        key = self.algorithms[self.alone.check.algorithm].key
        return self._loops(self.alone, key, array, start, payload_end)

    def _loops(
        self, check: CheckPart, key: str, array: str, start: str, payload_end: str, *, lead: bool = False
    ) -> list[str]:
        """Statements that update a check value with the covered bytes; ``lead``: those of the lead too."""
        lines: list[str] = []
        for run in self.envelope.coverage(check):
            if isinstance(run, Seed):
                lines += self._seed_updates(run, key)
                continue
            if lead and self.envelope.parts[0] in run:
                lines += self._lead_updates(check, key)
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
        """Each algorithm of frames, the main one first."""
        mains = (each.check for each in self.every)
        found = dict.fromkeys(each.check.algorithm for each in mains if each)
        for envelope in self.every:
            found |= dict.fromkeys(each.algorithm for each in envelope.algorithms)
        return {each: render(each, number) for number, each in enumerate(found, 1)}

    @property
    def values(self) -> list[ValueView]:
        """The functions that compute check values; none if the only one is computed in passing."""
        if self.alone is not None:
            return []
        return [self._value(part) for part in (*self.envelope.filling, *self.envelope.conditional_checks)]

    def _value(self, part: CheckPart) -> ValueView:
        algorithm = self.algorithms[part.check.algorithm]
        loops = self._loops(part, algorithm.key, "body", "0", "payload_end", lead=True)
        updates = self._empty(part) + loops
        if self.envelope.before and any(re.search(r"\bhead\b", line) for line in updates):
            test = holds(self, self.envelope.before, "body")
            updates.insert(0, f"const size_t head = ({test}) ? {self.head}U : {self.least_head}U;")
        if not any("payload_end" in line for line in updates):
            updates.insert(0, "(void)payload_end;")
        seeded = part in self.envelope.seeded
        return ValueView(self._function(part), part.name, algorithm, updates, seeded=seeded)

    def _empty(self, part: CheckPart) -> list[str]:
        """The statement that returns the value where the payload, which alone is covered, is empty."""
        if part.check.otherwise is None:
            return []
        return refusal(
            f"payload_end == {self.head_text}", unsigned(part.check.otherwise, part.check.algorithm.width)
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
            put_check(part.check, "block", 0, "sum"),
            differs(part.check, "block", 0, "sum"),
        )

    def _function(self, part: CheckPart) -> str:
        checks = (*self.envelope.checks, *self.envelope.conditional_checks)
        return f"{self.own}_value_{checks.index(part) + 1}_"

    def fills(self, body: str, end: str, payload_end: str) -> list[str]:
        """Statements that compute and write the check values of a body; ``end`` is the end of its payload."""
        lines: list[str] = []
        for part in self.envelope.filling if self.alone is None else ():
            filled = self.fill(part, body, end, payload_end)
            if part in self.envelope.seeded:
                known = f"{self.prefix}_seeds_({self.message_id(self.sender.id)})"
                filled = self._with_seeds(known, filled)
            lines += filled
        return lines

    def fill(self, part: CheckPart, body: str, end: str, payload_end: str) -> list[str]:
        """Statements that compute and write a check value."""
        place = end if part in self.envelope.back else body
        put = indented(put_check(part.check, place, self._at(part), "value"))
        return [*self._computed(part, body, payload_end), *put, "}"]

    def _with_seeds(self, known: str, lines: list[str]) -> list[str]:
        """Statements that use the seeds of a message, after one that refuses an id without any."""
        unknown = refusal("seeds == NULL", f"{self.prefix.upper()}_ERROR_UNKNOWN")
        return ["{", *indented([f"const uint8_t *const seeds = {known};", *unknown, *lines]), "}"]

    def judges(self, body: str, end: str, payload_end: str) -> list[str]:
        """Statements that verify the check values that are not verified before the payload."""
        if self.alone is not None:
            return []
        early = () if self.frame.whole else self.envelope.header_checks
        seeded = self.envelope.seeded
        late = [part for part in self.envelope.checks if part not in (*early, *seeded)]
        lines = [line for part in late for line in self.judge(part, body, end, payload_end)]
        if (after := self.envelope.after) and after.checks:
            judged = [line for part in after.checks for line in self.judge(part, body, end, payload_end)]
            lines += [f"if ({holds(self, after, body)}) {{", *indented(judged), "}"]
        if seeded:
            directed = "direction, " if self.directed else ""
            known = f"{self.prefix}_known_seeds_({directed}{self.message_id(self.number(self.envelope.id))})"
            judged = [line for part in seeded for line in self.judge(part, body, end, payload_end)]
            lines += self._with_seeds(known, judged)
        return lines

    def judge(self, part: CheckPart, body: str, end: str, payload_end: str) -> list[str]:
        """Statements that verify a check value."""
        place = end if part in self.envelope.back else body
        test = differs(part.check, place, self._at(part), "value")
        wrong = refusal(test, f"{self.prefix.upper()}_ERROR_CRC")
        return [*self._computed(part, body, payload_end), *(f"    {line}" for line in wrong), "}"]

    def _computed(self, part: CheckPart, body: str, payload_end: str) -> list[str]:
        kind = self.algorithms[part.check.algorithm].type
        more = ", seeds" if part in self.envelope.seeded else ""
        return ["{", f"    const {kind} value = {self._function(part)}({body}, {payload_end}{more});"]


def put_check(check: Check, place: str, at: int, value: str) -> list[str]:
    """Statements that write a check value."""
    if check.value.base:
        return [f"{place}[{at + index}] = {digit};" for index, digit in enumerate(_digits(check, value))]
    return [
        f"{place}[{at + index}] = (uint8_t)({_piece(value, chunk.shift, chunk.mask)});"
        for index, chunk in enumerate(check.value.chunks)
    ]


def differs(check: Check, place: str, at: int, value: str) -> str:
    """The condition for received check bytes that differ from ``value``; digits may have either case."""
    if check.value.base:
        found = [(f"{place}[{at + index}]", digit) for index, digit in enumerate(_digits(check, value))]
        if check.value.base == 10:
            return any_of(f"{seen} != {digit}" for seen, digit in found)
        return any_of(f"({seen} != {digit}) && ({seen} != ({digit} | 0x20U))" for seen, digit in found)
    return any_of(
        f"{place}[{at + index}] != (uint8_t)({_piece(value, chunk.shift, chunk.mask)})"
        for index, chunk in enumerate(check.value.chunks)
    )


def _digits(check: Check, value: str) -> list[str]:
    """The digits of a value as characters."""
    if check.value.base == 10:
        width = max(16, check.algorithm.width)
        places = [10**power for power in reversed(range(check.size))]
        most = check.algorithm.mask
        parts = [value if power == 1 else f"({value} / {unsigned(power, width)})" for power in places]
        found = zip(places, parts, strict=True)
        return [f"(uint8_t)(0x30U + ({part} % 10U))" if most >= power else "0x30U" for power, part in found]
    pieces = [f"({_piece(value, chunk.shift, chunk.mask)})" for chunk in check.value.chunks]
    return [f"(uint8_t)({each} + (({each} > 9U) ? 0x37U : 0x30U))" for each in pieces]


def _piece(value: str, shift: int, mask: int) -> str:
    shifted = f"{value} >> {shift}" if shift else value
    return shifted if mask == 0xFF else f"{grouped(shifted)} & {in_hex(mask)}"
