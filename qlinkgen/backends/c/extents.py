"""Frames without a length: how the size of a payload follows from its own bytes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from qlinkgen.backends.c.checks import condition
from qlinkgen.backends.c.names import Names, grouped, unsigned
from qlinkgen.model.message import Field, Message
from qlinkgen.model.types import Array, Blob, Scalar

#: The expression for an integer at an index of an array.
Get = Callable[[Scalar, str, str], str]


def extents(names: Names, messages: tuple[Message, ...], get: Get) -> list[dict[str, Any]]:
    """The statements for each message."""
    return [
        {"constant": names.constant(message), "lines": _Extent(message, names.upper, get).statements()}
        for message in messages
    ]


@dataclass
class _Extent:
    """Collects the statements for one message.

    ``passed`` names the variables of the fields of variable size before the current place: how many bytes
    each has beyond its fewest.
    """

    message: Message
    upper: str
    get: Get
    lines: list[str] = field(default_factory=list)
    passed: list[str] = field(default_factory=list)

    def statements(self) -> list[str]:
        """Lines of the case, which return in the end."""
        fields = {each.name: each for each in self.message.fields}
        offset = 0
        for each in self.message.fields:
            if isinstance(each.type, Scalar) and (counted := fields.get(each.type.counts)):
                self._count(each.name, each.type, counted, offset)
            if not each.fixed:
                self.passed.append(f"{each.name}_more")
            offset += each.min_size
        first = f"*size = {self.message.min_size}U;"
        if not self.passed:
            return [first, f"return {self.upper}_OK;"]
        enough = f"return (available < *size) ? {self.upper}_ERROR_TRUNCATED : {self.upper}_OK;"
        return ["{", *(f"    {line}" for line in [first, *self.lines, enough]), "}"]

    def _count(self, name: str, scalar: Scalar, counted: Field, offset: int) -> None:
        kind = counted.type
        assert isinstance(kind, Array | Blob)
        if kind.length.counted_by != name:  # another count tells the end; decoding compares the two
            return
        self._refuse(f"available < {grouped(self._place(offset + scalar.size))}", "TRUNCATED")
        value = self.get(scalar, "payload", self._place(offset) or "0")
        self._bound(scalar, kind, value)
        more = f"{counted.name}_more"
        self.lines += [f"const size_t {more} = {self._more(scalar, kind, value)};", f"*size += {more};"]

    def _place(self, offset: int) -> str:
        """An index after the fields that were passed, "" for the first byte."""
        return " + ".join([*self.passed, *([f"{offset}U"] if offset else [])])

    def _bound(self, scalar: Scalar, kind: Array | Blob, value: str) -> None:
        scale = kind.item_size if scalar.counts_unit == "bytes" else 1
        least, most = kind.length.minimum * scale, kind.length.maximum * scale
        terms = [f"{value} < {least}U"] if least else []
        if most < scalar.natural_maximum:
            terms.append(f"{value} > {unsigned(most, max(scalar.bits, 16))}")
        if terms:
            self._refuse(condition(terms), "LENGTH")

    @staticmethod
    def _more(scalar: Scalar, kind: Array | Blob, value: str) -> str:
        """Bytes of the field beyond the fewest."""
        step = 1 if scalar.counts_unit == "bytes" else kind.item_size
        least = kind.length.minimum * kind.item_size
        times = f"({step}U * (size_t){value})" if step > 1 else f"(size_t){value}"
        return f"{times} - {least}U" if least else times

    def _refuse(self, terms: str, status: str) -> None:
        self.lines += [f"if ({terms}) {{", f"    return {self.upper}_ERROR_{status};", "}"]
