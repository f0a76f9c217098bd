"""A word list for prose: phrases that readers stumble over, and their replacements.

`make lint` runs `python -m tests.prose`, which searches every text of the project that is not generated.
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
KINDS = ("*.py", "*.md", "*.j2", "*.yaml", "*.c", "*.h", "*.toml", "Makefile")
#: Not searched: generated files, and the list itself with its tests.
ELSEWHERE = ("generated/", "tests/prose/", "qlinkgen/codecs", "tests/c/corpus/")

#: Patterns, and the advice for each.
PHRASES: Mapping[str, str] = {
    r"\b(stand|stands|stood) (in|at|behind|alone|there|for|on|beside|between)\b": "is, occurs, appears",
    r"\bin front of\b": "before",
    r"\bbehind (it|the|a|an|its|them|each|every)\b": "after, follows",
    r"\b([Nn]obody|[Ww]hoever|[Aa]nybody)\b": "no one; or name the reader, caller, sender",
    r"\b(is|are|was|were) no (?!longer\b|more\b|less\b|fewer\b|one\b)[a-z]+\b": "is not a; X is missing",
    r"\b[Ww]hat (came|comes)\b": "the reply, the bytes received",
    r"\bof no (bytes|data|items)\b": "empty; without data",
    r"\b[Ww]hat is not there\b": "name the thing that is missing",
    r"\bmisfits?\b": "LayoutError; a frame that does not fit",
    r"\bknows? (nothing|better)\b": "does not depend on; lacks",
    r"\bgoes? both ways\b": "in both directions",
    r"\bcomes? out\b": "is delivered, results",
    r"\b(takes?|took|taken|taking) apart\b": "divide, decode",
    r"\bleft alone\b": "unchanged, omitted",
    r"\bha(s|ve) to (say|know)\b": "must state, needs",
    r"\b(whom?|what) (it|they) (is|are) for\b": "the recipient, the purpose",
    r"\bin (its|their) stead\b": "instead",
}
#: A gap between words; it may contain a line end and the mark of a comment line.
_GAP = r"(?:[ \t]|\n[ \t]*(?:#:? |[*>] |// )?)+"
_PATTERNS = {re.compile(each.replace(" ", _GAP)): better for each, better in PHRASES.items()}


@dataclass(frozen=True, slots=True)
class Hit:
    """A phrase of the list in a file."""

    path: str
    line: int
    phrase: str
    advice: str

    def __str__(self) -> str:
        """In the format of compiler messages."""
        return f"{self.path}:{self.line}: '{self.phrase}'; say: {self.advice}"


def texts() -> Iterator[tuple[str, str]]:
    """Path and text of every file of the project, committed or not yet."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", "--", *KINDS]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for path in filter(None, listed.split("\0")):
        file = ROOT / path
        if not path.startswith(ELSEWHERE) and file.is_file():
            yield path, file.read_text("utf-8")


def hits(path: str, text: str) -> list[Hit]:
    """The phrases of the list in a text, including those split over two lines."""
    found = [(each, better) for pattern, better in _PATTERNS.items() for each in pattern.finditer(text)]
    return [
        Hit(path, text.count("\n", 0, each.start()) + 1, " ".join(each[0].split()), better)
        for each, better in sorted(found, key=lambda pair: pair[0].start())
    ]
