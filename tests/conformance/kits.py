"""Kits as users have them: written next to their header, compiled, run, and their TAP parsed."""

from __future__ import annotations

import re
import subprocess
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from qlinkgen.backends.base import Options
from qlinkgen.cli.targets import TARGETS
from qlinkgen.model.protocol import Protocol
from tests.proof.cases import protocol
from tests.support.cdriver import WARNINGS

TARGETS_DIR = Path(__file__).parent / "targets"
STDIO = "-DCONFORMANCE_STDIO=1"
_LINE = re.compile(r"(?P<result>ok|not ok) (?P<number>[0-9]+) - (?P<name>.+)")


def write(name: str, folder: Path, options: Options | None = None, model: Protocol | None = None) -> Path:
    """Write header and kit of a protocol, by default of its name, side by side; returns the kit."""
    for target in ("c", "conformance"):
        generate = TARGETS[target].load()
        for path, text in generate(model or protocol(name), options or Options()).items():
            (folder / Path(path).name).write_text(text, "utf-8")
    return folder / f"{name}_conformance.c"


def compiled(program: Path, *command: str | Path) -> Path:
    """Compile, with every warning an error; returns the program."""
    words = [str(word) for word in (*command, *WARNINGS, "-o", program)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr[:4000]
    return program


@dataclass(frozen=True)
class Report:
    """The output and exit code of a kit."""

    status: int
    planned: int
    names: tuple[str, ...]
    failed: tuple[str, ...]
    diagnoses: tuple[str, ...]

    @property
    def by_verb(self) -> Counter[str]:
        """Number of tests by verb, the last word of their names."""
        return Counter(name.rsplit(" ", 1)[1] for name in self.names)

    def check(self) -> None:
        """Whether all planned tests ran and passed."""
        assert not self.failed, self.diagnoses[:3]
        assert len(self.names) == self.planned
        assert self.status == 0


def report(status: int, text: str) -> Report:
    """Parse TAP strictly: version, plan, consecutive numbers, and a YAML block only after failures."""
    version, plan, *lines = text.replace("\r\n", "\n").splitlines()
    assert version == "TAP version 14"
    assert plan.startswith("1..")
    names: list[str] = []
    failed: list[str] = []
    diagnoses: list[list[str]] = []
    inside = False
    for line in lines:
        found = _LINE.fullmatch(line)
        if inside:
            diagnoses[-1].append(line)
            inside = line != "  ..."
            assert line.startswith("  ")
        elif line == "  ---":
            assert len(diagnoses) < len(failed)
            diagnoses.append([names[-1]])
            inside = True
        else:
            assert found, line
            names.append(found["name"])
            assert int(found["number"]) == len(names)
            failed += [found["name"]] if found["result"] == "not ok" else []
    assert not inside
    assert len(diagnoses) == len(failed)
    told = tuple("\n".join(each) for each in diagnoses)
    return Report(status, int(plan.removeprefix("1..")), tuple(names), tuple(failed), told)


def ran(*command: str | Path, most: Sequence[int] = (0, 1)) -> Report:
    """Run a kit to its end, with a time limit in case it hangs."""
    words = [str(word) for word in command]
    done = subprocess.run(
        words, capture_output=True, text=True, timeout=300, check=False, stdin=subprocess.DEVNULL
    )
    assert done.returncode in most, (done.returncode, done.stderr[:4000], done.stdout[-400:])
    return report(done.returncode, done.stdout)


def output(*command: str | Path) -> str:
    """The output of a program, which must succeed."""
    words = [str(word) for word in command]
    return subprocess.run(words, capture_output=True, text=True, timeout=300, check=True).stdout
