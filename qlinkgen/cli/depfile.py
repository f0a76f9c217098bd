"""Dependencies of the outputs as a make rule, for make, Ninja and CMake."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from qlinkgen.cli import output
from qlinkgen.cli.boundary import WRONG, Failure

#: Contents that may be overwritten: a rule as written here, or nothing.
_OURS = re.compile(r"(?:[^\n]+ \\\n)*[^\n]+: \\\n(?: [^\n]+ \\\n)* [^\n]+\n|")


class Depfile:
    """A file with one rule."""

    def __init__(
        self, file: Path, outputs: Sequence[Path], inputs: Sequence[Path], manifests: Sequence[Path] = ()
    ) -> None:
        """Compose the rule.

        Raises Failure for a path that make cannot name, a foreign file, and a place of outputs; ``manifests``
        are written too, but are not part of the rule.
        """
        self._file = file
        self.text = rule(outputs, inputs)
        found = output.look(file.parent, file.name)
        self._present = "" if found.data is None else found.data.decode("utf-8", "replace")
        what = found.obstacle
        place, written = file.resolve(), [path.resolve() for path in (*outputs, *manifests)]
        if place in {*written, *(path.resolve() for path in inputs)}:
            what = f"{file} is one of the outputs or schemas"
        elif any(place in path.parents or path in place.parents for path in written):
            what = f"{file} is in the way of an output"
        elif place.parent in {path.resolve().parent for path in outputs}:
            what = f"{file} is in a folder of outputs, where another file is an orphan"
        elif not _OURS.fullmatch(self._present):
            what = f"{file} was not written by qlinkgen"
        if what:
            raise Failure(f"--depfile: {what}; nothing was written: choose another name", WRONG)

    def write(self) -> None:
        """Write the file, unless it is up to date."""
        if self._present != self.text:
            output.replace(self._file.parent, {self._file.name: self.text})


def rule(outputs: Sequence[Path], inputs: Sequence[Path]) -> str:
    """Return the text of a rule."""
    targets, needed = ([_escaped(str(path)) for path in paths] for paths in (outputs, inputs))
    return " \\\n".join(targets) + ": \\\n " + " \\\n ".join(needed) + "\n"


def _escaped(path: str) -> str:
    """Escape a path for make: backslashes are doubled only before a character that they would escape."""
    if "\n" in path or "\r" in path:
        raise Failure(f"--depfile: {path!r} has a line break, which a make rule cannot contain; rename it")
    path = re.sub(r"\\+(?=[ #:]|$)", lambda found: found[0] * 2, path)
    return re.sub(r"([ #:])", r"\\\1", path).replace("$", "$$")
