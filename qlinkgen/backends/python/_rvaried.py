"""Records of variable size, and arrays that end with a record: base class, rules, and decoding.

Copied next to modules that use it, unchanged.
"""

from __future__ import annotations

from ._records import BaseRecord, RecordsRule, moved
from ._support import DecodeError, LayoutError, Rule, as_bytes, wrong_size

TYPE_CHECKING = False  # as typing.TYPE_CHECKING; importing `typing` costs 5 ms
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Self, TypeVar

    from ._support import BytesLike, Value

    AnyRecord = TypeVar("AnyRecord", bound=BaseRecord)


class VariedRecord(BaseRecord):
    """Base class of records of variable size."""

    __slots__ = ()

    @classmethod
    def from_bytes(cls, data: BytesLike) -> Self:
        """The record of these bytes. Raises DecodeError."""
        return cls.from_checked(as_bytes(data))

    @classmethod
    def from_checked(cls, payload: bytes) -> Self:
        """The record of all these bytes. Raises DecodeError."""
        try:
            found, end = cls.read(payload, 0, len(payload))
        except LayoutError:
            raise wrong_size(cls, payload) from None
        if end != len(payload):
            raise wrong_size(cls, payload)
        return found

    @classmethod
    def read(cls, payload: bytes, at: int, end: int) -> tuple[Self, int]:
        """The record at an offset, and the offset of its end, which is at most `end`.

        Raises LayoutError, or DecodeError with an offset in the record.
        """
        raise NotImplementedError


class EndedRule(RecordsRule):
    """A list of records, of which the last one has a property that no other has."""

    __slots__ = ("is_last",)

    def __init__(
        self,
        name: str,
        kind: type[BaseRecord],
        most: int,
        is_last: Callable[[Value], bool],
    ) -> None:
        self.is_last = is_last
        super().__init__(name, kind, 1, most)
        self.legal += ", of which only the last one ends it"

    def allows(self, value: Value) -> bool:
        """Whether the records are legal, and only the last one ends the list."""
        ends = [self.is_last(each) for each in value]
        return super().allows(value) and ends.index(True) == len(ends) - 1


class OpenRule(Rule):
    """A list of records, of which only the last one may take all bytes that are left."""

    __slots__ = ("is_open", "rule")

    def __init__(self, rule: RecordsRule, is_open: Callable[[Value], bool]) -> None:
        self.rule = rule
        self.is_open = is_open
        legal = f"{rule.legal}, of which only the last one takes the rest"
        super().__init__(rule.name, legal)

    def allows(self, value: Value) -> bool:
        """Whether the records are legal, and only the last one takes the rest."""
        return self.rule.allows(value) and not any(map(self.is_open, value[:-1]))

    def complaint(self, value: object) -> str:
        """The error text for a list, that of its first illegal record; "" if it is legal."""
        return self.rule.complaint(value) or super().complaint(value)


def read_one(
    kind: type[AnyRecord], data: bytes, at: int, end: int
) -> tuple[AnyRecord, int]:
    """The record at an offset, and the offset of its end. Raises LayoutError or DecodeError."""
    try:
        return _read(kind, data, at, end)
    except DecodeError as error:
        raise moved(error, "", 0) from None


def read_counted(
    kind: type[AnyRecord], data: bytes, at: int, end: int, count: int
) -> tuple[list[AnyRecord], int]:
    """So many consecutive records, and the offset of their end. Raises LayoutError or DecodeError."""
    found: list[AnyRecord] = []
    start = at
    try:
        while len(found) < count:
            record, at = _read(kind, data, at, end)
            found.append(record)
    except DecodeError as error:
        raise moved(error, f"[{len(found)}]", at - start) from None
    return found, at


def read_filled(
    kind: type[AnyRecord], data: bytes, at: int, end: int, *, fewest: int, most: int
) -> list[AnyRecord]:
    """The records from an offset to another. Raises LayoutError or DecodeError."""
    found: list[AnyRecord] = []
    start = at
    try:
        while at < end:
            if len(found) == most:
                raise LayoutError
            record, at = _read(kind, data, at, end)
            found.append(record)
    except DecodeError as error:
        raise moved(error, f"[{len(found)}]", at - start) from None
    if len(found) < fewest:
        raise LayoutError
    return found


def read_ended(
    kind: type[AnyRecord],
    data: bytes,
    at: int,
    end: int,
    *,
    most: int,
    is_last: Callable[[AnyRecord], bool],
) -> tuple[list[AnyRecord], int]:
    """Consecutive records up to a last one, and the offset of their end.

    Raises LayoutError or DecodeError.
    """
    found: list[AnyRecord] = []
    start = at
    try:
        while not found or not is_last(found[-1]):
            if len(found) == most:
                raise LayoutError
            record, at = _read(kind, data, at, end)
            found.append(record)
    except DecodeError as error:
        raise moved(error, f"[{len(found)}]", at - start) from None
    return found, at


def _read(
    kind: type[AnyRecord], data: bytes, at: int, end: int
) -> tuple[AnyRecord, int]:
    if issubclass(kind, VariedRecord):
        return kind.read(data, at, end)
    after = at + kind.MAX_SIZE
    if after > end:
        raise LayoutError
    return kind.from_checked(bytes(data[at:after])), after
