"""Shows statistics as text, as JSON, and as one HTML page without anything from outside."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape

import click

from qlinkgen._dataclass import dataclass
from qlinkgen.captures.statistics import Histogram, Row, Statistics
from qlinkgen.cli.tables import Table
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.values import Json

_COUNTS = ("requests", "repeats", "responses", "late", "unanswered", "refused", "strays", "messages")


@dataclass(frozen=True, slots=True)
class Report:
    """Statistics, and what they are of."""

    protocol: str
    address: str
    statistics: Statistics
    #: Bytes in the captures, None if only some of their frames are counted.
    size: int | None
    baud: int
    bits_per_byte: int

    @classmethod
    def of(cls, protocol: Protocol, statistics: Statistics, size: int | None, baud: int) -> Report:
        """Make the report of a protocol."""
        return cls(
            protocol.name, protocol.address_name or "", statistics, size, baud, protocol.bus.bits_per_byte
        )

    @property
    def utilisation(self) -> float | None:
        """Part of the time in which bytes were on the line."""
        return self.statistics.utilisation(self.baud, self.bits_per_byte)

    @property
    def outside(self) -> int | None:
        """Bytes that are in no frame and no bad one."""
        return None if self.size is None else max(0, self.size - self.statistics.size)

    def rows(self) -> list[tuple[int | None, str, Row]]:
        """Return node, command and figures, sorted."""
        found = [(node, name, row) for (node, name), row in self.statistics.rows.items()]
        return sorted(found, key=lambda each: (-1 if each[0] is None else each[0], each[1]))

    def record(self) -> dict[str, Json]:
        """Return the figures for JSON; times are in seconds."""
        of = self.statistics
        return {
            "protocol": self.protocol,
            "frames": of.frames,
            "bytes": of.size,
            "outside": self.outside,
            "seconds": of.duration if of.first is not None else None,
            "baud": self.baud,
            "utilisation": self.utilisation,
            "faults": dict(sorted(of.faults.items())),
            "rows": [self._row(node, name, row) for node, name, row in self.rows()],
        }

    def _row(self, node: int | None, name: str, row: Row) -> dict[str, Json]:
        found: dict[str, Json] = {"name": name}
        if self.address:
            found[self.address] = node
        found.update({each: getattr(row, each) for each in _COUNTS})
        if row.times.count:
            found["times"] = {
                "count": row.times.count,
                "least": row.times.least,
                "mean": row.times.mean(),
                "median": row.times.quantile(0.5),
                "p99": row.times.quantile(0.99),
                "most": row.times.most,
                "histogram": [list(bar) for bar in row.times.bars(40)],
            }
        return found

    def lines(self) -> Iterator[str]:
        """Return the figures as text."""
        of = self.statistics
        outside = "" if self.outside is None else f", {self.outside} outside frames"
        yield f"{of.frames} frames; {of.size} bytes in frames and bad frames{outside}"
        if of.first is not None:
            use = self.utilisation
            shown = "" if use is None else f"; {use:.1%} of a line of {self.baud} Bd used"
            yield f"{of.duration:.3f} s{shown}"
        else:
            yield "no times in the capture"
        if of.faults:
            yield f"bad frames: {', '.join(f'{kind} {count}' for kind, count in of.faults.most_common())}"

    def tables(self) -> Iterator[Table]:
        """Return the tables: by node and command, and the nodes whose answers were damaged."""
        columns = [self.address or "node", "command", *_COUNTS, "median ms", "p99 ms", "most ms"]
        table = Table(columns, "", frozenset(columns) - {"command"})
        for node, name, row in self.rows():
            times = (f"{1000 * each:.2f}" for each in _times(row.times))
            counts = (getattr(row, each) or None for each in _COUNTS)
            table.add(node, name, *counts, *(times if row.times.count else ("", "", "")))
        yield table
        blamed = {node: count for node, count in self.statistics.blamed.items() if node is not None}
        damaged = Table([self.address or "node", "damaged answers"], "", frozenset({"damaged answers"}))
        for node, count in sorted(blamed.items()):
            damaged.add(node, count)
        yield damaged


def _times(times: Histogram) -> tuple[float, float, float]:
    return times.quantile(0.5), times.quantile(0.99), times.most


def show(report: Report) -> None:
    """Print the figures."""
    for line in report.lines():
        click.echo(line)
    click.echo()
    for table in report.tables():
        table.show()


_STYLE = """
:root { color-scheme: light dark; --ink: #1c1c1c; --pale: #666; --bar: #2a6db0; --line: #ccc; --back: #fff; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #eee; --pale: #aaa; --bar: #6cb0f0; --line: #444; --back: #161616; }
}
body { font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--back);
  max-width: 75rem; margin: 2rem auto; padding: 0 1rem; }
table { border-collapse: collapse; display: block; overflow-x: auto; }
th, td { padding: .2rem .6rem; border-bottom: 1px solid var(--line); text-align: right; white-space: nowrap; }
th:nth-child(2), td:nth-child(2) { text-align: left; }
figure { margin: 1.5rem 0; } figcaption { color: var(--pale); }
svg { width: 100%; height: 10rem; } svg rect { fill: var(--bar); }
"""


def html(report: Report, files: Sequence[str]) -> str:
    """Return a page with the figures, the load over time, and the response times of each command."""
    title = f"{report.protocol}: {', '.join(files)}"
    parts = [
        "<!doctype html>",
        '<html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{escape(title)}</title><style>{_STYLE}</style></head><body>",
        f"<h1>{escape(title)}</h1>",
        *(f"<p>{escape(line)}</p>" for line in report.lines()),
        *(_table(table) for table in report.tables() if table.rows),
    ]
    load = report.statistics.load
    if load.bytes():
        each = f"{load.piece / 1e9:g} s"
        parts.append(_bars("Bytes on the line", [(f"{count} bytes", count) for count in load.bytes()], each))
    for node, name, row in report.rows():
        if row.times.count:
            who = name if node is None else f"{name}, {report.address} {node}"
            bars = [
                (f"{1000 * low:.3f} to {1000 * high:.3f} ms: {count}", count)
                for low, high, count in row.times.bars(60)
            ]
            span = f"{1000 * row.times.least:.3f} to {1000 * row.times.most:.3f} ms"
            parts.append(_bars(f"Response times of {who}", bars, span))
    return "\n".join([*parts, "</body></html>", ""])


def _table(table: Table) -> str:
    head = "".join(f"<th>{escape(each)}</th>" for each in table.columns)
    rows = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in table.rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"


def _bars(title: str, bars: Sequence[tuple[str, int]], span: str) -> str:
    """Return a bar chart; each bar tells its figures when pointed at."""
    most = max(count for _, count in bars) or 1
    wide = 1000 / len(bars)
    drawn = "".join(
        f'<rect x="{index * wide:.1f}" y="{100 - 100 * count / most:.1f}" width="{wide * 0.9:.1f}" '
        f'height="{100 * count / most:.1f}"><title>{escape(text)}</title></rect>'
        for index, (text, count) in enumerate(bars)
    )
    return (
        f'<figure><svg viewBox="0 0 1000 100" preserveAspectRatio="none" role="img" '
        f'aria-label="{escape(title)}">{drawn}</svg>'
        f"<figcaption>{escape(title)}: {escape(span)}, at most {most}</figcaption></figure>"
    )
