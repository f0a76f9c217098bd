"""The corpus reaches every line and branch of each shipped header, except those listed with a reason."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import yaml

from tests.c.conftest import SHIPPED
from tests.support.ccoverage import PAGE, Coverage, Gap, Line, measure, standing, table

LIST = Path(__file__).parent / "corpus" / "unreached.yaml"


@dataclass(frozen=True)
class Entry:
    """Unreached places of one header, and the reasons."""

    header: str
    functions: tuple[str, ...]
    text: str
    missing: str
    reason: str

    def covers(self, function: str, text: str) -> bool:
        return function in self.functions and fnmatchcase(text, self.text)


def entries() -> list[Entry]:
    return [_entry(each) for each in yaml.safe_load(LIST.read_text("utf-8"))]


def _entry(each: dict[str, Any]) -> Entry:
    return Entry(**{**each, "functions": tuple(each["functions"])})


def test_gaps_reasons_and_figures_agree(tmp_path: Path, require_tool: Callable[..., str]) -> None:
    found = measure(require_tool("gcc", package="gcc"), require_tool("gcov", package="gcc"), tmp_path)
    for name in SHIPPED:
        every_gap_has_its_reason(name, found[name])
    for entry in entries():
        reason_has_its_gap(entry, found[entry.header])
    stands = standing(PAGE.read_text("utf-8"))
    assert stands == table(found), "renew it by python -m tests.support.ccoverage --write"


def every_gap_has_its_reason(name: str, coverage: Coverage) -> None:
    listed = [entry for entry in entries() if entry.header == name]
    missing = Counter(
        gap
        for gap in coverage.gaps()
        if not any(entry.covers(gap.function, gap.text) and entry.missing == gap.missing for entry in listed)
    )
    assert not missing, f"{name}.h: add an input to the corpus, or a reason to {LIST.name}: {missing}"


def reason_has_its_gap(entry: Entry, coverage: Coverage) -> None:
    places = [place for place in coverage.places() if entry.covers(place.function, place.text)]
    assert places, f"gone from {entry.header}.h: {entry}"
    reached = [place for place in places if place.missing != entry.missing]
    assert not reached, f"reached in {entry.header}.h, though listed: {reached}"


def _line(function: str, count: int, *branches: int) -> Line:
    return Line(function, count, Counter(dict(enumerate(branches))))


def test_a_gap_is_seen() -> None:
    """A function that is never called, and a condition with only one outcome."""
    lines = {1: _line("f", 0), 2: _line("g", 3, 3, 0), 3: _line("g", 1, 1, 2)}
    coverage = Coverage(lines, ["int x_f(void)", "    if (a)", "    if (b)"], "x")
    assert coverage.gaps() == [Gap("f", "int f(void)", "line"), Gap("g", "if (a)", "1 of 2 branches")]
    assert coverage.counts() == (2, 3, 3, 4)
