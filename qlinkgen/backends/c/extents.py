"""Frames without a length: how the size of a payload follows from its own bytes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from qlinkgen.backends.c.names import Names, unsigned
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
    """Collects the statements for one message; ``moved`` is how far a variable field has pushed the rest."""

    message: Message
    upper: str
    get: Get
    lines: list[str] = field(default_factory=list)
    _counts: int = 0

    def statements(self) -> list[str]:
        self.lines = [f"*size = {self.message.min_size}U;"]
        fields = {each.name: each for each in self.message.fields}
        counts = [each for each in self.message.fields if self._counted(each, fields)]
        offset = 0
        for each in self.message.fields:
            counted = self._counted(each, fields)
            if counted is not None and isinstance(each.type, Scalar):
                self._count(each.type, counted, offset, last=each is counts[-1])
            offset += each.min_size
        if not self._counts:
            return [*self.lines, f"return {self.upper}_OK;"]
        enough = f"return (available < *size) ? {self.upper}_ERROR_TRUNCATED : {self.upper}_OK;"
        if len(counts) == 1:
            return [*self.lines, enough]
        return ["{", "    size_t moved = 0U;", *(f"    {line}" for line in [*self.lines, enough]), "}"]

    @staticmethod
    def _counted(each: Field, fields: dict[str, Field]) -> Array | Blob | None:
        """The field of variable size whose end the count tells, where this one does."""
        counted = fields.get(each.type.counts) if isinstance(each.type, Scalar) else None
        if counted is None or counted.fixed or not isinstance(counted.type, Array | Blob):
            return None
        return counted.type if counted.type.length.counted_by == each.name else None

    def _count(self, scalar: Scalar, kind: Array | Blob, offset: int, *, last: bool) -> None:
        moved, self._counts = bool(self._counts), self._counts + 1
        end = f"(moved + {offset + scalar.size}U)" if moved else f"{offset + scalar.size}U"
        self._refuse(f"available < {end}", "TRUNCATED")
        value = self.get(scalar, "payload", f"moved + {offset}U" if moved else str(offset))
        self._bound(scalar, kind, value)
        extra = self._extra(scalar, kind, value)
        self.lines += [f"*size += {extra};"] if last else [f"moved += {extra};", f"*size += {extra};"]

    def _bound(self, scalar: Scalar, kind: Array | Blob, value: str) -> None:
        scale = kind.item_size if scalar.counts_unit == "bytes" else 1
        least, most = kind.length.minimum * scale, kind.length.maximum * scale
        terms = (
            [f"({value} > {unsigned(most, max(scalar.bits, 16))})"] if most < scalar.natural_maximum else []
        )
        terms += [f"({value} < {least}U)"] if least else []
        if terms:
            self._refuse(" || ".join(terms), "LENGTH")

    @staticmethod
    def _extra(scalar: Scalar, kind: Array | Blob, value: str) -> str:
        """Bytes of the field beyond the fewest."""
        step = 1 if scalar.counts_unit == "bytes" else kind.item_size
        least = kind.length.minimum * kind.item_size
        times = f"({step}U * (size_t){value})" if step > 1 else f"(size_t){value}"
        return f"({times} - {least}U)" if least else times

    def _refuse(self, condition: str, status: str) -> None:
        self.lines += [f"if ({condition}) {{", f"    return {self.upper}_ERROR_{status};", "}"]
