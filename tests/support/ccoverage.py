"""Coverage of each header by the committed corpus: lines and branches, counted by gcov.

    python -m tests.support.ccoverage [--write]

prints the figures and all unreached places; --write updates the figures in docs/firmware.md. Needs gcc, which
includes gcov.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.support import cfuzz_corpus
from tests.support.cfuzz import TARGETS, compiled

#: Every function of a header is kept, so that an unused one counts as unreached.
FLAGS = ("-std=gnu99", "-O0", "--coverage", "-fkeep-inline-functions", "-fkeep-static-functions", "-DREPLAY")
PAGE = Path(__file__).parents[2] / "docs" / "firmware.md"
BEGIN, END = "<!-- coverage -->", "<!-- end of coverage -->"
_TABLE = re.compile(f"{BEGIN}(.*?){END}", re.DOTALL)


@dataclass
class Line:
    """Execution counts of a line and of its branches."""

    function: str
    count: int = 0
    branches: Counter[int] = field(default_factory=Counter)


@dataclass(frozen=True, order=True)
class Gap:
    """An unreached place: a line, or some of its branches. The name of the protocol is omitted."""

    function: str
    text: str
    missing: str


@dataclass(frozen=True)
class Coverage:
    """Coverage of one header."""

    lines: dict[int, Line]
    source: list[str]
    name: str

    def gaps(self) -> list[Gap]:
        """All unreached places, in order."""
        return [place for place in self.places() if place.missing]

    def places(self) -> list[Gap]:
        """All lines with code; `missing` is "" if a line and all its branches are reached."""
        found = []
        for number, line in sorted(self.lines.items()):
            missed = sum(1 for taken in line.branches.values() if not taken)
            missing = f"{missed} of {len(line.branches)} branches" if missed else ""
            text = self._plain(self.source[number - 1].strip())
            found.append(Gap(self._plain(line.function), text, missing if line.count else "line"))
        return found

    def _plain(self, text: str) -> str:
        return text.replace(f"{self.name}_", "").replace(f"{self.name.upper()}_", "")

    def counts(self) -> tuple[int, int, int, int]:
        """Lines reached, lines, branches taken, branches."""
        lines, branches = (
            self.lines.values(),
            [n for line in self.lines.values() for n in line.branches.values()],
        )
        return (
            sum(1 for line in lines if line.count),
            len(lines),
            sum(1 for n in branches if n),
            len(branches),
        )


class Refuted(Exception):
    """An input fails: reported by a sanitizer, or by a requirement of the target."""


def measure(compiler: str, gcov: str, folder: Path) -> dict[str, Coverage]:
    """Run the corpus of every target; returns the coverage of each shipped header."""
    files: dict[str, dict[int, Line]] = {f"{name}.h": {} for name in cfuzz_corpus.SHIPPED}
    name = cfuzz_corpus.write_program(folder, "all", TARGETS)
    done = compiled(compiler, folder, name, *FLAGS)
    assert done.returncode == 0, done.stderr
    replay(folder / name, list(_every_input()))
    _add(files, _gcov(gcov, folder, name))
    return {
        name.removesuffix(".h"): Coverage(
            lines, (folder / name).read_text("utf-8").splitlines(), name.removesuffix(".h")
        )
        for name, lines in files.items()
    }


def _every_input() -> Iterator[bytes]:
    """The inputs for the program with all targets; the first byte selects target and protocol."""
    for number, target in enumerate(TARGETS):
        for each in cfuzz_corpus.read(target):
            protocol = each[0] % len(cfuzz_corpus.SHIPPED)
            yield bytes([protocol * len(TARGETS) + number]) + each[1:]


def replay(program: Path, inputs: list[bytes]) -> None:
    """Run each input once in a program built with REPLAY."""
    text = "".join(f"{each.hex()}\n" for each in inputs)
    done = subprocess.run(
        [program], input=text, cwd=program.parent, capture_output=True, text=True, timeout=300, check=False
    )
    if done.returncode != 0:
        raise Refuted(done.stderr[-4000:])
    assert int(done.stdout) == len(inputs)


def _gcov(gcov: str, folder: Path, target: str) -> dict[str, Any]:
    # The names of the count files depend on the version of gcc.
    (counts,) = folder.glob(f"*{target}.gcda")
    command = [gcov, "--json-format", "--stdout", "--branch-probabilities", counts.name]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, check=True)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def _add(files: dict[str, dict[int, Line]], found: dict[str, Any]) -> None:
    for each in found["files"]:
        if each["file"] in files:
            known = files[each["file"]]
            for line in each["lines"]:
                place = known.setdefault(line["line_number"], Line(line.get("function_name", "")))
                place.count += line["count"]
                for number, branch in enumerate(line["branches"]):
                    place.branches[number] += branch["count"]


def table(found: dict[str, Coverage]) -> str:
    """The figures as Markdown."""
    rows = ["| Header | Lines reached | of | Branches taken | of |", "| --- | ---: | ---: | ---: | ---: |"]
    for name, each in found.items():
        rows.append(f"| {name}.h | " + " | ".join(f"{number:,}" for number in each.counts()) + " |")
    return "\n".join(rows)


def standing(page: str) -> str:
    """The figures in the page; AssertionError if it has no place for them."""
    found = _TABLE.search(page)
    assert found, f"{PAGE.name} has no {BEGIN} and {END} for the figures of the corpus"
    return found[1].strip()


def main() -> None:
    """Print the table and the unreached places."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--write", action="store_true", help=f"put the table into docs/{PAGE.name}")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        found = measure(shutil.which("gcc") or "gcc", shutil.which("gcov") or "gcov", Path(name))
    print(table(found))
    for protocol, each in found.items():
        for gap, number in sorted(Counter(each.gaps()).items()):
            print(f"{protocol}: {gap.function}: {gap.text}: {gap.missing}, {number} times")
    if options.write:
        page = PAGE.read_text("utf-8")
        assert standing(page)
        PAGE.write_text(_TABLE.sub(lambda _: f"{BEGIN}\n\n{table(found)}\n\n{END}", page), "utf-8")


if __name__ == "__main__":
    main()
