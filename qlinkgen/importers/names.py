"""Names of a schema, made from the names of other formats."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Sequence

from qlinkgen.importers.notes import Notes

#: The longest name of a schema; a number may follow that tells two names apart.
_MOST = 40
_HUMP = re.compile(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z0-9])(?=[A-Z][a-z])")
_OTHER = re.compile(r"[^a-z0-9]+")
_BUILT_IN = re.compile(r"[uif]\d+|bool|bytes|text|u?int|u?fixed\d+")


def schema_name(raw: str, fallback: str = "unnamed") -> str:
    """The name of a schema nearest to a name: ``MotorStatus`` is ``motor_status``."""
    words = _words(raw)
    if not words:
        return fallback
    name = words if words[0].isalpha() else f"{fallback[0]}{words}"
    return name[:_MOST].rstrip("_")


def _words(raw: str) -> str:
    """A name in lower case with underscores, of any length."""
    plain = unicodedata.normalize("NFKD", raw[: 10 * _MOST]).encode("ascii", "ignore").decode()
    return _OTHER.sub("_", _HUMP.sub("_", plain).lower()).strip("_")


class Names:
    """Names of one scope, each given once.

    Args:
        notes: Told of two names that become one.
        what: What they name, for notes.
        types: They are names of types, which differ from those of built-in ones.
        taken: Names that are in use.
    """

    def __init__(self, notes: Notes, what: str, *, types: bool = False, taken: Iterable[str] = ()) -> None:
        self._notes = notes
        self._what = what
        self._types = types
        self._taken = set(taken)
        self._numbers: dict[str, int] = {}

    def has_free(self, raw: str) -> bool:
        """Whether a name of the input can have the name that it asks for."""
        return schema_name(raw, self._what.split()[-1]) not in self._taken

    def take(self, raw: str, line: int, notes: Notes | None = None) -> str:
        """The name for a name of the input, with a number if another one has it.

        Args:
            raw: The name of the input.
            line: Its line.
            notes: Those of the file in which it is, if that is another one.
        """
        wanted = schema_name(raw, self._what.split()[-1])
        if self._types and _BUILT_IN.fullmatch(wanted):
            wanted = f"{wanted}_type"
        name, number = wanted, self._numbers.get(wanted, 1)
        while name in self._taken:
            number += 1
            name = f"{wanted[: _MOST - len(str(number)) - 1].rstrip('_')}_{number}"
        if name != wanted:
            (notes or self._notes).add(line, f"{self._what} '{raw[:60]}' is called {name}: {wanted} is taken")
        self._numbers[wanted] = number
        self._taken.add(name)
        return name


def last_name(raw: str, names: Names) -> str:
    """What to take for ``outer::inner``: the inner name, or all of it if another one has that."""
    last = raw.rpartition("::")[2]
    return last if names.has_free(last) else raw


def without_prefix(raw: Sequence[str]) -> list[str]:
    """Names of constants without the words that all of them begin with."""
    words = [_words(each).split("_") for each in raw]
    if len(words) < 2:
        return list(raw)
    shared = 0
    while all(len(each) > shared + 1 for each in words) and len({each[shared] for each in words}) == 1:
        shared += 1
    while shared and not all(each[shared][:1].isalpha() for each in words):
        shared -= 1
    return ["_".join(each[shared:]) for each in words]
