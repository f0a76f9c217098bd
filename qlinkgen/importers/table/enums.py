"""Collects the enums of a table; equal ones are one."""

from __future__ import annotations

from collections.abc import Sequence

from qlinkgen.importers.document import Constant, Constants
from qlinkgen.importers.names import Names
from qlinkgen.importers.notes import Notes


class Enums:
    """The enums of all messages."""

    def __init__(self, notes: Notes) -> None:
        self._notes = notes
        self._names = Names(notes, "enum", types=True)
        self._found: dict[tuple[str, tuple[Constant, ...]], Constants] = {}

    @property
    def all(self) -> tuple[Constants, ...]:
        """All of them."""
        return tuple(self._found.values())

    def take(self, values: Sequence[tuple[int, str]], type_: str, called: Sequence[str], line: int) -> str:
        """The name of an enum for values of a type.

        Args:
            values: Numbers and labels.
            type_: Its integer type.
            called: Names to choose from: the first that is free.
            line: Line of the input.
        """
        constants = self._constants(values, line)
        if (type_, constants) not in self._found:
            taken = {each.name for each in self._found.values()}
            free = [each for each in called if each not in taken]
            name = self._names.take((free or [called[-1]])[0], line)
            self._found[type_, constants] = Constants(name, type_, constants, line)
        return self._found[type_, constants].name

    def _constants(self, values: Sequence[tuple[int, str]], line: int) -> tuple[Constant, ...]:
        names = Names(self._notes, "value")
        found: dict[int, Constant] = {}
        for number, label in values:
            if number in found:
                self._notes.add(
                    line, f"value {number} '{label[:40]}' is left out: the number has a name already"
                )
                continue
            name = names.take(label, line)
            said = label if name.replace("_", " ") != label.strip().lower().replace("_", " ") else ""
            said = "" if name.replace("_", "") == "".join(filter(str.isalnum, label.lower())) else said
            found[number] = Constant(name, number, said)
        return tuple(found.values())
