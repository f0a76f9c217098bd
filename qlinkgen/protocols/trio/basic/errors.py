"""Places in the text of a program, and the error that names them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

from qlinkgen.errors import QlinkgenError


class BasicError(QlinkgenError, ValueError):
    """A program cannot be read, or it cannot go on.

    Attributes:
        message: what was seen, the rule, and the fix.
        place: where, in which file.
    """

    def __init__(self, place: Place, message: str) -> None:
        self.place = place
        self.message = message
        super().__init__(f"{place}: {message}")

    def __reduce__(self) -> tuple[type[BasicError], tuple[Place, str]]:
        """Pickle by the parts; the default would pass the text to `__init__`."""
        return type(self), (self.place, self.message)


class Place(NamedTuple):
    """A place in a program: line and column count from 1."""

    file: str
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"

    def error(self, message: str) -> BasicError:
        """Return the error of this place."""
        return BasicError(self, message)

    @contextmanager
    def refusing(self) -> Iterator[None]:
        """Raise what a word refuses, such as a number out of range, as an error of this place."""
        try:
            yield
        except BasicError:
            raise
        except (ValueError, TypeError, IndexError) as error:
            raise self.error(str(error)) from None
