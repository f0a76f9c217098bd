"""Derives blocking modules from those for asyncio: `python -m tests.unasync` writes them, `--check` compares.

A module is read as tokens, and written without its coroutines: each name has one counterpart.
"""

from __future__ import annotations

import difflib
import io
import itertools
import re
import subprocess
import sys
import tokenize
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).parents[1]
#: Names and their counterparts; every other name that begins with Async loses that.
NAMES = {
    "AsyncGenerator": "Generator",
    "AsyncIterator": "Iterator",
    "AsyncMaster": "BlockingMaster",
    "AsyncPeer": "BlockingPeer",
    "__aenter__": "__enter__",
    "__aexit__": "__exit__",
    "aclosing": "closing",
    "aio": "blocking",
    "aio_peers": "peers",
    "drive_async": "drive",
    "host_aio": "host",
    "ring_aio": "ring",
}
#: Words of prose.
PROSE = {
    "any number of tasks of one event loop": "any number of threads",
    "thread or task": "thread",
}
#: What the docstring of a derived module says.
_DERIVED = "Derived from `aio.py` by `python -m tests.unasync`: change that one, and run it."
_DROPPED = {"async", "await"}


@dataclass(frozen=True)
class Pair:
    """A module for asyncio, and the one that is derived from it.

    Attributes:
        source: path of the former.
        derived: path of the latter.
        texts: texts that differ in other ways, each of which the source has.
    """

    source: str
    derived: str
    texts: Mapping[str, str] = field(default_factory=dict)

    def text(self) -> str:
        """What the derived module has to be."""
        text = (ROOT / self.source).read_text("utf-8")
        for ours, theirs in self.texts.items():
            if ours not in text:
                raise ValueError(f"{self.source} has no {ours!r}, which tests/unasync.py replaces")
            text = text.replace(ours, theirs)
        plain = blocking(text)
        ordered = _ruff("check", "--select=I001", "--fix", text=plain, path=self.derived)
        return _ruff("format", text=ordered, path=self.derived)


def _ruff(*arguments: str, text: str, path: str) -> str:
    """What ruff makes of a text."""
    command = [sys.executable, "-m", "ruff", *arguments, "-q", f"--stdin-filename={path}", "-"]
    return subprocess.run(command, input=text, capture_output=True, text=True, check=True, cwd=ROOT).stdout


PAIRS = (
    Pair(
        "qlinkgen/bus/aio.py",
        "qlinkgen/bus/blocking.py",
        {
            " for asyncio; `qlinkgen.bus.blocking` is derived from it.": f".\n\n{_DERIVED}\n",
            " Opening is fast, so it is synchronous.": "",
        },
    ),
    Pair(
        "qlinkgen/bus/host_aio.py",
        "qlinkgen/bus/host.py",
        {" for asyncio; `qlinkgen.bus.host` is derived from it.": f".\n\n{_DERIVED}\n"},
    ),
    Pair(
        "qlinkgen/bus/ring_aio.py",
        "qlinkgen/bus/ring.py",
        {" for asyncio; `qlinkgen.bus.ring` is derived from it.": f".\n\n{_DERIVED}\n"},
    ),
    Pair(
        "qlinkgen/protocols/trio/aio.py",
        "qlinkgen/protocols/trio/nodes.py",
        {" for asyncio; `qlinkgen.protocols.trio.nodes` is derived from it.": f".\n\n{_DERIVED}\n"},
    ),
    Pair(
        "qlinkgen/protocols/qlink/aio.py",
        "qlinkgen/protocols/qlink/bus.py",
        {
            " for asyncio; `qlinkgen.protocols.qlink.bus` is derived from it.": f".\n\n{_DERIVED}\n",
            "await bus.node(3).motor_position()": "bus.node(3).motor_position().position",
            "AsyncGenerator[MotionProgress, None]": "Generator[MotionProgress, None, dict[int, int]]",
        },
    ),
    Pair(
        "qlinkgen/protocols/mc1231a/aio.py",
        "qlinkgen/protocols/mc1231a/host.py",
        {" for asyncio; `qlinkgen.protocols.mc1231a.host` is derived from it.": f".\n\n{_DERIVED}\n"},
    ),
)


def blocking(text: str) -> str:
    """A text without coroutines."""
    return "".join(_pieces(text))


def _pieces(text: str) -> Iterator[str]:
    """The text without coroutines, in pieces."""
    starts = [0, *itertools.accumulate(len(line) for line in text.splitlines(keepends=True))]
    at = 0
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        begin, end = (starts[min(row, len(starts)) - 1] + column for row, column in (token.start, token.end))
        yield text[at:begin]
        at = max(end, at)
        if token.type == tokenize.NAME and token.string in _DROPPED:
            at += 1  # with the blank after it
        elif token.type == tokenize.NAME:
            yield _renamed(token.string)
        elif token.type in {tokenize.STRING, tokenize.COMMENT}:
            yield _told(token.string)
        else:
            yield text[begin:at]


def _renamed(name: str) -> str:
    return NAMES.get(name) or re.sub(r"^Async(?=[A-Z])", "", name)


def _told(text: str) -> str:
    """A string or a comment with the names of the derived module."""
    for ours, theirs in PROSE.items():
        text = text.replace(ours, theirs)
    text = re.sub(r"\b(async|await) ", "", text)
    return re.sub(r"\bAsync(?=[A-Z])\w*|\baclosing\b", lambda found: _renamed(found[0]), text)


def differences(pair: Pair) -> str:
    """A diff from the file to what it has to be."""
    path = ROOT / pair.derived
    present = path.read_text("utf-8") if path.exists() else ""
    lines = difflib.unified_diff(
        present.splitlines(keepends=True), pair.text().splitlines(keepends=True), pair.derived, "derived"
    )
    return "".join(lines)


def main(arguments: list[str]) -> int:
    """Write the modules, or compare them."""
    found = [differences(pair) for pair in PAIRS]
    if "--check" in arguments:
        print("".join(found), end="")
        return int(any(found))
    for pair, changed in zip(PAIRS, found, strict=True):
        if changed:
            (ROOT / pair.derived).write_text(pair.text(), "utf-8")
            print(f"{pair.derived} written")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
