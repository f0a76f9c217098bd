"""Bit diagrams: the meaning of each bit of an integer."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from qlinkgen._dataclass import dataclass
from qlinkgen.model.texts import one_line
from qlinkgen.model.types import Flags
from qlinkgen.plan.parts import MarkPart
from qlinkgen.plan.payload import BitsStep


@dataclass(frozen=True, slots=True)
class Run:
    """Bits ``shift .. shift + bits - 1`` and their meaning."""

    shift: int
    bits: int
    label: str


def runs_of_flags(flags: Flags) -> list[Run]:
    """One bit a flag."""
    return [Run(member.value, 1, _labelled(member.name, member.doc)) for member in flags.members]


def runs_of_bits(step: BitsStep, docs: Mapping[str, str]) -> list[Run]:
    """The members of an integer; ``docs`` by name."""
    return [
        Run(each.shift, each.bits, _labelled(each.name, docs.get(each.name, ""))) for each in step.members
    ]


def runs_of_header(header: MarkPart, end_id: int | None) -> list[Run]:
    """Marker, address and message id of a header."""
    marker = header.marker.bit_length() - 1
    return [
        Run(marker, 1, "marker: set only in header and end"),
        Run(header.address.shift, header.address.bits, header.address_name),
        Run(header.id.shift, header.id.bits, f"{header.id_name}; {end_id} marks the end"),
    ]


def diagram(width: int, runs: Iterable[Run]) -> list[str]:
    """Return the lines of a diagram: bit numbers, brackets below those in use, and a branch to each name.

    ::

         7  6  5  4  3  2  1  0
         .  .  .  .  .  .  |  |
                           |  +-- running
                           +----- position_valid
    """
    ordered = sorted(runs, key=lambda run: run.shift)
    marks = ["  ."] * width
    for run in ordered:
        for bit in range(run.shift, run.shift + run.bits):
            marks[bit] = "  |" if bit == run.shift else "---" if bit < run.shift + run.bits - 1 else "  <"
    for run in ordered:
        for bit in range(run.shift, run.shift + run.bits - 1):
            marks[bit] = f"--{marks[bit][2]}"
    lines = ["".join(f"{bit:3}" for bit in reversed(range(width))), "".join(reversed(marks))]
    return lines + [_branch(width, run, ordered[index + 1 :]) for index, run in enumerate(ordered)]


def _branch(width: int, run: Run, above: Iterable[Run]) -> str:
    columns = [" "] * (3 * width)
    for other in above:
        columns[3 * (width - other.shift) - 1] = "|"
    start = 3 * (width - run.shift) - 1
    line = "".join(columns[:start]) + "+" + "-" * (3 * run.shift)
    return f"{line}-- {run.label}"


def _labelled(name: str, doc: str) -> str:
    return one_line(f"{name}: {doc}" if doc else name)
