"""What an importer could not take from its input, with the line."""

from __future__ import annotations

from dataclasses import dataclass, field

from qlinkgen.errors import ImportFileError


@dataclass(frozen=True, slots=True, order=True)
class Note:
    """A remark on a line of an input file.

    Attributes:
        file: Path of the file as given by the user.
        line: Line, from 1; 0 for the file as a whole.
        text: What was seen, and what follows from it.
    """

    file: str
    line: int
    text: str

    def __str__(self) -> str:
        """Return `file:line: note: text`."""
        place = f"{self.file}:{self.line}" if self.line else self.file
        return f"{place}: note: {self.text}"


@dataclass
class Notes:
    """The notes on a file, and those on the files that it includes.

    Attributes:
        file: The file that is being read.
        found: All notes.
    """

    file: str
    found: list[Note] = field(default_factory=list)

    def add(self, line: int, text: str) -> None:
        """Add a note, once."""
        note = Note(self.file, line, text)
        if note not in self._known:
            self._known.add(note)
            self.found.append(note)

    _known: set[Note] = field(default_factory=set)

    def error(self, line: int, text: str) -> ImportFileError:
        """An error at a line: nothing can be imported."""
        return ImportFileError(text, file=self.file, line=line)

    def of(self, file: str) -> Notes:
        """Notes on another file, collected with these."""
        return Notes(file, self.found, self._known)
