"""Collects the faults of one file: a single run shows all of them, without consequential errors."""

from __future__ import annotations

from collections.abc import Iterable

from qlinkgen.errors import Fault
from qlinkgen.model.spelling import similar
from qlinkgen.schema.rules import RULES
from qlinkgen.schema.source import Path, Position, Source


class Reporter:
    """Converts paths to positions and collects faults in order of discovery.

    Nodes removed after an error are *tainted*; errors derived from them are suppressed. Each error states the
    paths that it was derived from.
    """

    def __init__(self, file: str, source: Source) -> None:
        """Report faults of ``file``; ``source`` holds the positions of its nodes."""
        self.file = file
        self.source = source
        self.faults: list[Fault] = []
        self.failed = False
        self._known: set[Fault] = set()
        self._tainted: set[Path] = set()
        self._around: set[Path] = set()
        self._parents: set[Path] = set()
        self._moved: dict[Path, Path] = {}

    def move(self, path: Path, written: Path) -> None:
        """Note where something is written that has been given another path."""
        self._moved[path] = written

    def _position(self, path: Path, *, of_key: bool) -> Position:
        ends = range(len(path), 0, -1) if self._moved else ()
        end = next((end for end in ends if path[:end] in self._moved), None)
        written = path if end is None else (*self._moved[path[:end]], *path[end:])
        return self.source.position(written, of_key=of_key)

    def error(
        self,
        rule: str,
        path: Path,
        message: str,
        hint: str = "",
        *,
        of_key: bool = False,
        absent: bool = False,
        needs: Iterable[Path] | None = None,
    ) -> None:
        """Report a fault at a path of the file.

        Args:
            rule: The violated rule.
            path: The node that violates it.
            message: The error.
            hint: The fix.
            of_key: Point at the key instead of its value.
            absent: Something is missing, perhaps because it was removed after another error in this mapping.
            needs: Paths that the error was derived from, none of which may be tainted; default: ``path``.
        """
        needs = needs if needs is not None else () if absent else (path,)
        if not (absent and self.incomplete(path)) and not any(self.touched(need) for need in needs):
            self.at(rule, self._position(path, of_key=of_key), message, hint)

    def at(self, rule: str, position: Position, message: str, hint: str = "") -> None:
        """Report a fault at a position, even in a tainted node."""
        severity = RULES[rule].severity
        place = (position.line, position.column)
        fault = Fault(position.file or self.file, *place, rule, _one_line(message), _one_line(hint), severity)
        if fault not in self._known:
            self._known.add(fault)
            self.faults.append(fault)
            self.failed |= severity == "error"

    def included(self, path: Path) -> bool:
        """Whether a node is in another file."""
        return bool(self._position(path, of_key=True).file)

    def taint(self, path: Path) -> None:
        """Suppress later errors derived from this path or from nodes inside it."""
        self._tainted.add(path)
        self._parents.add(path[:-1])
        self._around.update(path[:end] for end in range(len(path) + 1))

    def touched(self, path: Path) -> bool:
        """Whether a node at, inside or around this path is tainted."""
        return path in self._around or self._inside(path)

    def incomplete(self, path: Path) -> bool:
        """Whether a key of this mapping, or the mapping itself, was removed after an error."""
        return path in self._parents or self._inside(path)

    def _inside(self, path: Path) -> bool:
        return bool(self._tainted) and any(path[:end] in self._tainted for end in range(len(path) + 1))


def _one_line(text: str) -> str:
    """Escape line ends and other unprintable characters of the file; a fault is one line."""
    return text if text.isprintable() else "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def did_you_mean(word: str, known: Iterable[object], otherwise: str = "") -> str:
    """A hint with the most similar known word, otherwise ``otherwise``."""
    close = similar(word, map(str, known))
    return f"did you mean '{close[0]}'?" if close else otherwise


def listed(words: Iterable[object], last: str = "and") -> str:
    """Words for a hint: ``a, b and c``."""
    *front, end = [str(word) for word in words] or ["nothing"]
    return f"{', '.join(front)} {last} {end}" if front else end
