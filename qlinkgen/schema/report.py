"""Collects the faults of one file, so that a single run shows all of them and no follow-up of any."""

from __future__ import annotations

from collections.abc import Iterable

from qlinkgen.errors import Fault
from qlinkgen.model.spelling import similar
from qlinkgen.schema.rules import RULES
from qlinkgen.schema.source import Path, Position, Source


class Reporter:
    """Turns paths into places and keeps what was reported, in order of discovery.

    What a fault has taken out is *tainted*: it is not what its author means, so nothing that was found by
    looking at it is reported. Each fault says which paths it was concluded from.
    """

    def __init__(self, file: str, source: Source) -> None:
        """Report on ``file``, whose parts stand where ``source`` says."""
        self.file = file
        self.source = source
        self.faults: list[Fault] = []
        self.failed = False
        self._known: set[Fault] = set()
        self._tainted: set[Path] = set()
        self._around: set[Path] = set()
        self._parents: set[Path] = set()

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
            rule: The rule that is broken.
            path: What breaks it.
            message: What is wrong.
            hint: What would put it right.
            of_key: Point at the key instead of its value.
            absent: Something is not there; it may be what a fault in this mapping has taken out.
            needs: Paths that must be intact for the fault to be one; ``path`` alone if not given.
        """
        needs = needs if needs is not None else () if absent else (path,)
        if not (absent and self.incomplete(path)) and not any(self.touched(need) for need in needs):
            self.at(rule, self.source.position(path, of_key=of_key), message, hint)

    def at(self, rule: str, position: Position, message: str, hint: str = "") -> None:
        """Report a fault at a place, whatever is tainted."""
        severity = RULES[rule].severity
        place = (position.line, position.column)
        fault = Fault(self.file, *place, rule, _one_line(message), _one_line(hint), severity)
        if fault not in self._known:
            self._known.add(fault)
            self.faults.append(fault)
            self.failed |= severity == "error"

    def taint(self, path: Path) -> None:
        """From now on report nothing that was concluded from this path or what is in it."""
        self._tainted.add(path)
        self._parents.add(path[:-1])
        self._around.update(path[:end] for end in range(len(path) + 1))

    def touched(self, path: Path) -> bool:
        """Something at, in or around this path is tainted."""
        return path in self._around or self._inside(path)

    def incomplete(self, path: Path) -> bool:
        """Some key of this mapping, or all of it, was taken out: what is missing may have been meant."""
        return path in self._parents or self._inside(path)

    def _inside(self, path: Path) -> bool:
        return bool(self._tainted) and any(path[:end] in self._tainted for end in range(len(path) + 1))


def _one_line(text: str) -> str:
    """What a file holds may hold line ends and worse; a fault is one line."""
    return text if text.isprintable() else "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def did_you_mean(word: str, known: Iterable[object], otherwise: str = "") -> str:
    """A hint naming the closest known word, or else ``otherwise``."""
    close = similar(word, map(str, known))
    return f"did you mean '{close[0]}'?" if close else otherwise


def listed(words: Iterable[object], last: str = "and") -> str:
    """Words for a hint: ``a, b and c``."""
    *front, end = [str(word) for word in words] or ["nothing"]
    return f"{', '.join(front)} {last} {end}" if front else end
