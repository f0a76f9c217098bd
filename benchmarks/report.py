"""The results, as text for the terminal and as Markdown for docs/benchmarks.md."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Goal:
    """A goal of the project, and the measured value."""

    what: str
    measured: float
    limit: float
    unit: str
    at_least: bool = False

    @property
    def met(self) -> bool:
        """Whether the measured value is within the limit."""
        return self.measured >= self.limit if self.at_least else self.measured <= self.limit

    def cells(self) -> list[str]:
        """One row of a table of goals."""
        sign = "at least" if self.at_least else "at most"
        verdict = "met" if self.met else "NOT MET"
        return [
            self.what,
            f"{number(self.measured)} {self.unit}",
            f"{sign} {number(self.limit)} {self.unit}",
            verdict,
        ]


GOAL_COLUMNS = ("goal", "measured", "limit", "")


@dataclass
class Section:
    """One table with its title, its goals, and the items that could not be measured."""

    title: str
    intro: str
    columns: Sequence[str]
    rows: list[list[str]] = field(default_factory=list)
    goals: list[Goal] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)


def number(value: float) -> str:
    """Three digits, the precision of the measurement."""
    if value >= 100:
        return f"{value:.0f}"
    return f"{value:.1f}" if value >= 10 else f"{value:.2f}"


def as_text(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table for the terminal: the first column to the left, figures to the right."""
    table = [list(columns), *map(list, rows)]
    widths = [max(len(row[i]) for row in table) for i in range(len(columns))]
    lines = [_text_line(row, widths) for row in table]
    return "\n".join([lines[0], "-" * len(lines[0]), *lines[1:]])


def _text_line(row: Sequence[str], widths: Sequence[int]) -> str:
    first, *others = (
        cell.rjust(width) if i else cell.ljust(width)
        for i, (cell, width) in enumerate(zip(row, widths, strict=True))
    )
    return "  ".join([first, *others])


def as_markdown(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """The same table for a page."""
    head = [_markdown_line(columns), _markdown_line(["---", *["---:"] * (len(columns) - 1)])]
    return "\n".join([*head, *(_markdown_line(row) for row in rows)])


def _markdown_line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def section_text(section: Section) -> str:
    parts = [section.title, "=" * len(section.title), as_text(section.columns, section.rows)]
    parts += [f"not measured: {missing}" for missing in section.missing]
    if section.goals:
        parts += ["", as_text(GOAL_COLUMNS, (goal.cells() for goal in section.goals))]
    return "\n".join(parts) + "\n"


def section_markdown(section: Section) -> str:
    parts = [f"## {section.title}", section.intro, as_markdown(section.columns, section.rows)]
    parts += [f"Not measured: {missing}." for missing in section.missing]
    return "\n\n".join(parts) + "\n"


def page(intro: str, sections: Sequence[Section]) -> str:
    """The text of docs/benchmarks.md: goals first, then every table."""
    goals = [goal.cells() for section in sections for goal in section.goals]
    parts = [intro, "## Goals", as_markdown(GOAL_COLUMNS, goals)]
    return "\n\n".join(parts) + "\n\n" + "\n".join(section_markdown(section) for section in sections)
