"""Tables: coloured and fitted to the width on a terminal, plain aligned text in a pipe."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import field
from typing import Literal

import click

from qlinkgen._dataclass import dataclass
from qlinkgen.cli.common import on_terminal
from qlinkgen.model.texts import one_line, visible

_BREAKS = re.compile(r"[\t\n]+")


@dataclass
class Table:
    """Rows of text under headings; columns in ``right`` are right-aligned."""

    columns: Sequence[str]
    title: str = ""
    right: frozenset[str] = frozenset()
    rows: list[tuple[str, ...]] = field(default_factory=list)

    def add(self, *cells: object) -> None:
        """Append a row; None is an empty cell."""
        self.rows.append(
            tuple("" if cell is None else _BREAKS.sub(" ", visible(str(cell))) for cell in cells)
        )

    def show(self) -> None:
        """Print the table, without empty columns."""
        table = self._without_empty()
        if not table.rows:
            return
        if on_terminal():
            _show_rich(table)
        else:
            click.echo("\n".join(table.lines()))

    def lines(self) -> list[str]:
        """Return plain text, with two blanks between columns."""
        head = [one_line(self.title)] if self.title else []
        widths = [
            max(len(row[index]) for row in (tuple(self.columns), *self.rows))
            for index in range(len(self.columns))
        ]
        rule = tuple("-" * width for width in widths)
        return head + [self._line(row, widths) for row in (tuple(self.columns), rule, *self.rows)] + [""]

    def _line(self, row: tuple[str, ...], widths: Sequence[int]) -> str:
        cells = (
            cell.rjust(width) if column in self.right else cell.ljust(width)
            for cell, width, column in zip(row, widths, self.columns, strict=True)
        )
        return "  ".join(cells).rstrip()

    def _without_empty(self) -> Table:
        used = [index for index in range(len(self.columns)) if any(row[index] for row in self.rows)]
        rows = [tuple(row[index] for index in used) for row in self.rows]
        return Table([self.columns[index] for index in used], self.title, self.right, rows)


def _cell(text: str) -> str:
    """Return a text on one line, with its indentation."""
    return _BREAKS.sub(" ", visible(text))


def _show_rich(table: Table) -> None:
    from rich import box  # noqa: PLC0415  # only a terminal needs it
    from rich.console import Console  # noqa: PLC0415
    from rich.table import Table as RichTable  # noqa: PLC0415
    from rich.text import Text  # noqa: PLC0415

    # A plain string as title would be read as markup.
    title = Text(one_line(table.title)) if table.title else None
    shown = RichTable(title=title, title_justify="left", title_style="bold", box=box.SIMPLE_HEAD)
    for index, column in enumerate(table.columns):
        style = ("cyan", "green")[index] if index < 2 else None
        side: Literal["left", "right"] = "right" if column in table.right else "left"
        shown.add_column(column, justify=side, style=style, overflow="fold")
    for row in table.rows:
        shown.add_row(*(Text(cell) for cell in row))
    Console().print(shown)


def heading(text: str) -> None:
    """Print a line, highlighted on a terminal."""
    line = one_line(text)
    click.echo(click.style(line, bold=True) if on_terminal() else line)


def paragraph(lines: Iterable[str]) -> None:
    """Print lines, followed by an empty one if there are any."""
    shown = [visible(line) for line in lines if line]
    if shown:
        click.echo("\n".join((*shown, "")))
