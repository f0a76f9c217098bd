"""Makes enums of the enums of a Kaitai Struct file, one for each integer type that fields give them."""

from __future__ import annotations

from collections.abc import Iterator

from qlinkgen.importers import cells
from qlinkgen.importers.document import Constant, Constants
from qlinkgen.importers.ksy.tree import Attribute, Node, Type
from qlinkgen.importers.names import Names, last_name
from qlinkgen.importers.notes import Notes


class Enums:
    """The enums that fields have.

    Args:
        names: Names of types, which enums share with records.
    """

    def __init__(self, names: Names, notes: Notes) -> None:
        self._notes = notes
        self._names = names
        self._made: dict[tuple[str, str], Constants] = {}

    @property
    def all(self) -> tuple[Constants, ...]:
        """All of them."""
        return tuple(self._made.values())

    def of(self, attribute: Attribute, type_: str) -> str:
        """The type of a field that may have an enum; its integer type without one."""
        name, line, notes = attribute.text("enum"), attribute.line, attribute.notes
        if not name:
            return type_
        found = attribute.scope.find_enum(name)
        if found is None:
            notes.add(line, f"the enum {name[:60]} is not in this file; the field is a number")
            return type_
        full, node = found
        if (full, type_) not in self._made:
            values = tuple(self._constants(node, type_))
            if not values:
                notes.add(line, f"the enum {name[:60]} has no values for {type_}; the field is a number")
                return type_
            again = any(each == full for each, _ in self._made)
            called = self._names.take(
                f"{full}_{type_}" if again else last_name(full, self._names), node.line, node.notes
            )
            self._made[full, type_] = Constants(called, type_, values, node.line, source=node.notes)
        return self._made[full, type_].name

    def _constants(self, node: Node, type_: str) -> Iterator[Constant]:
        names = Names(self._notes, "constant")
        width = int(type_[1:])
        seen: set[int] = set()
        for key, value in node.items:
            number = cells.integer(key)
            low, high = (0, 1 << width) if type_[0] == "u" else (-(1 << (width - 1)), 1 << (width - 1))
            if number is None or not low <= number < high or number in seen:
                node.notes.add(
                    value.line, f"value {key[:40]} of an enum is left out: it does not fit {type_}"
                )
                continue
            seen.add(number)
            raw = value.text("id") if isinstance(value.value, dict) else value.word
            doc = value.text("doc") if isinstance(value.value, dict) else ""
            yield Constant(names.take(raw, value.line, value.notes), number, doc)


def number_of(scope: Type, text: str) -> int | None:
    """The number of a value such as ``kind::data``."""
    enum, _, wanted = text.rpartition("::")
    found = scope.find_enum(enum) if enum else None
    for key, value in found[1].items if found else ():
        if wanted in (value.word, value.text("id")):
            return cells.integer(key)
    return None
