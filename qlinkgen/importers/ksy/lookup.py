"""Looks up the names in expressions: fields before, what is computed from them, and values of enums."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

from qlinkgen.importers.ksy.enums import number_of
from qlinkgen.importers.ksy.expressions import (
    Expression,
    Name,
    Number,
    Operation,
    names,
    parsed,
    replaced,
    runs,
    sliced,
)
from qlinkgen.importers.ksy.scalars import Scalar, bit_width, scalar
from qlinkgen.importers.ksy.tree import Attribute, Type
from qlinkgen.importers.names import schema_name

_DEEPEST: Final = 8
_TRUTH: Final = {"true": 1, "false": 0}


@dataclass
class Lookup:
    """The fields of a sequence by path.

    Attributes:
        known: The fields in order.
        records: Records that are divided, by path; the sequence itself has an empty one.
        bits: The bits of numbers that expressions ask for, as runs from the first to the last one.
    """

    known: dict[str, Attribute]
    records: dict[str, Type]
    bits: dict[str, list[tuple[int, int]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Note the order, and divide the numbers of which expressions ask for bits."""
        self._order = {path: at for at, path in enumerate(self.known)}
        for at, each in enumerate(self.known.values()):
            for choice, _ in each.given:
                self._order.setdefault(choice.path, at)
        asked: dict[str, set[int]] = {}
        for each in self.known.values():
            for key in ("size", "repeat-expr", "if"):
                if text := each.text(key):
                    self._ask(self.expression(text, each), asked)
            for choice in (each, *(choice for choice, _ in each.given)):
                if choice.switch is not None:
                    self._ask(self.expression(choice.switch.text("switch-on"), choice), asked)
        for path, edges in asked.items():
            width = 8 * found.size if (found := self.integer(path)) else 0
            if not self.known[path].text("enum"):
                ends = sorted({0, width, *(each for each in edges if each < width)})
                self.bits[path] = [(first, after - 1) for first, after in pairwise(ends)]

    def _ask(self, expression: Expression | None, asked: dict[str, set[int]]) -> None:
        if not isinstance(expression, Operation):
            return
        found = sliced(expression)
        if found is None:
            for each in expression.operands:
                self._ask(each, asked)
        elif (number := self.integer(found.name)) is not None:
            whole = (1 << 8 * number.size) - 1
            mask = whole >> found.shift << found.shift if found.mask is None else found.mask & whole
            for first, last in runs(mask):
                asked.setdefault(found.name, set()).update((first, last + 1))

    def integer(self, path: str) -> Scalar | None:
        """The type of an unsigned number of whole bytes; None for other fields."""
        each = self.known.get(path)
        found = scalar(each.type, each.scope.endian) if each and not each.text("repeat") else None
        return found if found is not None and found.type[0] == "u" else None

    def limits(self, path: str) -> tuple[int, int] | None:
        """Least and greatest value of a number; None for other fields."""
        each = self.known[path]
        if each.text("repeat"):
            return None
        number = scalar(each.type, each.scope.endian)
        width = bit_width(each.type)
        return number.limits if number else (0, (1 << width) - 1) if width else None

    def expression(
        self, text: str, attribute: Attribute, first: Attribute | None = None
    ) -> Expression | None:
        """An expression in terms of the paths of fields before; None if it has others.

        Args:
            text: The expression.
            attribute: The field that has it.
            first: The first one of its own fields, if it is a record that is divided.
        """
        before = self._order[(first or attribute).path]
        return self._expression(text, attribute.within, attribute.scope, before, 0)

    def _expression(
        self, text: str, within: Sequence[str], scope: Type, before: int, depth: int
    ) -> Expression | None:
        found = parsed(text)
        if found is None or depth > _DEEPEST:
            return None

        def of(name: str) -> Expression | None:
            if name in _TRUTH:
                return Number(_TRUTH[name])
            if "::" in name:
                number = number_of(scope, name)
                return None if number is None else Number(number, schema_name(name.rpartition("::")[2]))
            path = self._path(name, within)
            if path is None:
                return None
            if path in self.known:
                return Name(path) if self._order[path] < before else None
            record, _, last = path.rpartition(".")
            type_ = self.records.get(record)
            value = type_.instances.get(last) if type_ else None
            if type_ is None or value is None:
                return None
            inside = tuple(record.split(".")) if record else ()
            return self._expression(value.text("value"), inside, type_, before, depth + 1)

        return replaced(found, of)

    def _path(self, name: str, within: Sequence[str]) -> str | None:
        parts = name.split(".")
        place = list(within)
        if parts[0] == "_root":
            if self.records[""].outer is not None:
                return None
            parts, place = parts[1:], []
        while parts and parts[0] == "_parent":
            if not place:
                return None
            parts, place = parts[1:], place[:-1]
        return ".".join((*place, *parts))

    def reason(self, text: str, attribute: Attribute, first: Attribute | None = None) -> str:
        """Why an expression cannot be taken, if a name is the reason; else empty."""
        before = self._order[(first or attribute).path]
        found = parsed(text)
        for name in names(found) if found is not None else ():
            if name in _TRUTH or "::" in name:
                continue
            path = self._path(name, attribute.within)
            record, _, last = (path or "").rpartition(".")
            if path not in self.known and record in self.records and last in self.records[record].instances:
                return f"'{name[:60]}' is computed in a way that a schema cannot state"
            if path is None or self._order.get(path, before) >= before:
                return f"'{name[:60]}' is not a field before it"
        return ""
