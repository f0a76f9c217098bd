"""Records of generated modules: base class, rules, and the decoding of arrays of them.

Copied next to modules that use it, unchanged.
"""

from __future__ import annotations

from ._support import BaseMessage, DecodeError, EncodeError, Rule, as_bytes, wrong_size

TYPE_CHECKING = False  # as typing.TYPE_CHECKING; importing `typing` costs 5 ms
if TYPE_CHECKING:
    from typing import Self, TypeVar

    from ._support import BytesLike, Value

    AnyRecord = TypeVar("AnyRecord", bound="BaseRecord")


class BaseRecord(BaseMessage):
    """Base class of records, which have values but no frame."""

    __slots__ = ()

    @classmethod
    def from_bytes(cls, data: BytesLike) -> Self:
        """The record of these bytes. Raises DecodeError."""
        own = as_bytes(data)
        if len(own) != cls.MAX_SIZE:
            raise wrong_size(cls, own)
        return cls.from_checked(own)

    @classmethod
    def from_checked(cls, payload: bytes) -> Self:
        """The record of bytes of the right size. Raises DecodeError."""
        raise NotImplementedError


class RecordRule(Rule):
    """A record."""

    __slots__ = ("kind",)

    def __init__(self, name: str, kind: type[BaseRecord]) -> None:
        self.kind = kind
        super().__init__(name, f"a {kind.__name__}")

    def allows(self, value: Value) -> bool:
        """Whether it is a record of this class."""
        return isinstance(value, self.kind)

    def complaint(self, value: object) -> str:
        """The error text for a record, that of its first illegal value; "" if it is legal."""
        if isinstance(value, self.kind):
            return _complaint(self.name, value)
        return super().complaint(value)


class RecordsRule(Rule):
    """A list of records."""

    __slots__ = ("fewest", "kind", "most")

    def __init__(
        self, name: str, kind: type[BaseRecord], fewest: int, most: int
    ) -> None:
        self.kind = kind
        self.fewest = fewest
        self.most = most
        number = f"{fewest}..{most}" if fewest != most else str(most)
        super().__init__(name, f"a list of {number} {kind.__name__}")

    def allows(self, value: Value) -> bool:
        """Whether the number of records is legal, and all have this class."""
        return self.fewest <= len(value) <= self.most and all(
            isinstance(each, self.kind) for each in value
        )

    def complaint(self, value: Value) -> str:
        """The error text for a list, that of its first illegal record; "" if it is legal."""
        found = super().complaint(value)
        places = () if found else enumerate(value)
        names = (_complaint(f"{self.name}[{index}]", each) for index, each in places)
        return found or next(filter(None, names), "")


def _complaint(name: str, record: BaseRecord) -> str:
    try:
        record.to_bytes()
    except EncodeError as error:
        return f"{name}: {error}"
    return ""


def read_record(kind: type[AnyRecord], data: bytes, at: int) -> AnyRecord:
    """The record at an offset. Raises DecodeError, in which the field begins with a dot."""
    try:
        return kind.from_checked(bytes(data[at : at + kind.MAX_SIZE]))
    except DecodeError as error:
        raise moved(error, "", 0) from None


def read_records(
    kind: type[AnyRecord], data: bytes, start: int, count: int
) -> list[AnyRecord]:
    """Consecutive records. Raises DecodeError, in which the field begins with an index."""
    found: list[AnyRecord] = []
    size, read = kind.MAX_SIZE, kind.from_checked
    try:
        for at in range(start, start + size * count, size):
            found.append(read(bytes(data[at : at + size])))
    except DecodeError as error:
        raise moved(error, f"[{len(found)}]", size * len(found)) from None
    return found


def moved(error: DecodeError, index: str, offset: int) -> DecodeError:
    """The error of a record as one of the field that holds it."""
    field = f"{index}.{error.field}"
    return DecodeError(
        f"{index}: {error}", error.kind, field, offset + error.offset, error.data
    )


def inside(
    error: DecodeError,
    message: type[BaseMessage],
    name: str,
    offset: int,
    payload: bytes,
) -> DecodeError:
    """The error in the records of a field; a negative offset counts from the end of the payload."""
    start = offset if offset >= 0 else len(payload) + offset
    text = f"{message.NAME}: {name}{error}"
    return DecodeError(
        text, error.kind, name + error.field, start + error.offset, payload
    )
