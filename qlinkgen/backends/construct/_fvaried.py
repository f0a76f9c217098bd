"""Records that are read one by one: of variable size, or up to a last one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from io import BytesIO
from typing import Any, BinaryIO

from construct import (
    Construct,
    Container,
    Default,
    RangeError,
    Renamed,
    ValidationError,
    stream_read_entire,
)

from ._fields import BitFields, Count, Values
from ._fwalks import Presence, Test, Walked, _values


class SizeOf(Count):
    """The bytes of the records ``of``; ``more`` bytes are counted beside them."""

    def __init__(self, subcon: Construct, of: str, *, more: int = 0) -> None:
        super().__init__(subcon, of, more=more)


class Several(Construct):
    """From minimum to maximum records, each read from where the one before it ends.

    With ``last``, the first record for which all tests hold is the last one.
    """

    def __init__(
        self,
        record: VariedRecord,
        minimum: int,
        maximum: int,
        last: Sequence[Test] = (),
    ) -> None:
        super().__init__()
        self.record = record
        self.minimum = minimum
        self.maximum = maximum
        self.last = last
        record.tested |= {name for name, _, _ in last}

    def checked(self, number: int, path: str) -> int:
        """The number of records, checked against the limits."""
        if not self.minimum <= number <= self.maximum:
            raise RangeError(
                f"{number} records, expected {self.minimum}..{self.maximum}", path=path
            )
        return number

    def ends(self, numbers: Mapping[str, int]) -> bool:
        """Whether a record with these raw numbers is the last one."""
        return bool(self.last) and _hold(self.last, numbers)

    def _build(self, obj: Any, stream: BinaryIO, context: Container, path: str) -> Any:
        # Any: a list of records, or one.
        self.checked(len(obj), path)
        ends = [self.ends(self.record.written(each, stream, path)) for each in obj]
        if self.last and ends != [*[False] * (len(ends) - 1), True]:
            raise ValidationError("only the last record must end the list", path=path)
        return obj

    def _sizeof(self, context: Container, path: str) -> int:
        return self.minimum * int(self.record.least)


class One(Several):
    """One record of variable size."""

    def __init__(self, record: VariedRecord) -> None:
        super().__init__(record, 1, 1)

    def _build(self, obj: Any, stream: BinaryIO, context: Container, path: str) -> Any:
        self.record.written(obj, stream, path)
        return obj


class Varied(Walked):
    """A message with records that are read one by one.

    ``most`` is the maximum size of its payload.
    """

    def __init__(
        self,
        name: str,
        message_id: int,
        *fields: Renamed,
        most: int,
        presence: Sequence[Presence] = (),
        **settings: Any,
    ) -> None:
        # Any: the settings of a Message.
        super().__init__(name, message_id, *fields, presence=presence, **settings)
        self.most = most
        self.several = {
            field.name: found for field in fields if (found := _several(field))
        }

    def _varies(self, field: Renamed) -> bool:
        return field.name in self.several or super()._varies(field)

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> Container:
        data = stream_read_entire(stream, path)
        values, at, _ = self.read(data, 0, len(data), path)
        if at != len(data):
            raise RangeError(f"{len(data) - at} bytes follow {self.name}", path=path)
        return values

    def read(
        self, data: bytes, at: int, end: int, path: str
    ) -> tuple[Container, int, Mapping[str, int]]:
        """The values at an offset, that of their end, and the raw numbers that tests need."""
        counts, numbers, sizes = dict(self.known), dict[str, int](), dict[str, int]()
        values, cells = Container(), dict[str, bytes]()
        for segment in self._segments():
            name, left = segment[0].name, end - at
            if not self._present(segment[0], numbers, left):
                values.update(
                    dict.fromkeys(name for each in segment for name in _values(each))
                )
            elif several := self.several.get(name):
                limit = self._limit(segment[0], counts, sizes, (at, end))
                number = counts.get(name)
                values[name], at = several_at(several, data, at, limit, number)
                if (name in sizes or self._rests(segment[0], counts)) and at != limit:
                    raise RangeError(f"{name} does not fill its bytes", path=path)
            else:
                self._infer(segment[0], counts, data[at:end], path)
                sized = [self._size(each, counts) for each in segment]
                if left < sum(sized):
                    raise RangeError(f"{left} bytes are left for {name}", path=path)
                for field, size in zip(segment, sized, strict=True):
                    cell = data[at : at + size]
                    found = field.parse(cell, number=counts.get(field.name))
                    if isinstance(field.subcon, BitFields):
                        values.update(found)
                    elif isinstance(field.subcon, Default):
                        values[field.name] = found
                    self._follow(field, cell, cells, path)
                    cells[field.name] = cell
                    self._note(field, cell, numbers)
                    self._tell(field, cell, counts, sizes, path)
                    at += size
        return values, at, numbers

    def _rests(self, field: Renamed, counts: Mapping[str, int]) -> bool:
        """Whether records take the rest of the payload."""
        several = self.several[field.name]
        ended = several.last or several.minimum == several.maximum
        return not ended and field.name not in counts

    def _limit(
        self,
        field: Renamed,
        counts: Mapping[str, int],
        sizes: Mapping[str, int],
        span: tuple[int, int],
    ) -> int:
        """The offset that records at the beginning of a span may extend to."""
        (at, end), limit = span, span[1]
        if field.name in sizes:
            limit = at + sizes[field.name]
        elif self._rests(field, counts):
            # A field after the rest that may be absent is absent where the rest is present.
            after = self.fields[self.fields.index(field) + 1 :]
            always = (each for each in after if each.name not in self.presence)
            limit = end - sum(self._size(each, counts) for each in always)
        if not at <= limit <= end:
            raise RangeError(f"{field.name} has no room")
        return limit

    def _tell(
        self,
        field: Renamed,
        cell: bytes,
        counts: dict[str, int],
        sizes: dict[str, int],
        path: str,
    ) -> None:
        """Learn from a count."""
        count = field.subcon
        several = self.several.get(count.of) if isinstance(count, Count) else None
        if several is None:
            self._learn(field, cell, counts, path)
            return
        number = count.number(cell) - count.more
        known = sizes if isinstance(count, SizeOf) else counts
        if isinstance(count, SizeOf):
            least = several.minimum * several.record.least
            most = min(self.most, several.maximum * several.record.most)
            if not least <= number <= most:
                raise RangeError(f"{number} bytes of {count.of}", path=path)
        else:
            several.checked(number, path)
        if known.setdefault(count.of, number) != number:
            raise RangeError(f"{field.name} does not agree with {count.of}", path=path)

    def measured(self, take: Callable[[int], bytes]) -> bytes:
        """Read a payload with ``take``; its size follows from counts and tested values."""
        taken = _Taken(take)
        at, _ = self.extent(taken, 0)
        if at > self.most:
            raise RangeError(f"{at} bytes are too many for {self.name}")
        return taken.upto(at)

    def extent(self, taken: _Taken, at: int) -> tuple[int, Mapping[str, int]]:
        """The offset of the end of what begins at an offset, and the raw numbers that tests need."""
        counts, numbers, sizes = dict(self.known), dict[str, int](), dict[str, int]()
        for segment in self._segments():
            if not self._present(segment[0], numbers, 1):
                continue
            if several := self.several.get(segment[0].name):
                number = counts.get(segment[0].name, several.maximum)
                size = sizes.get(segment[0].name)
                at = (
                    at + size
                    if size is not None
                    else extent_of(several, taken, at, number)
                )
                continue
            for field in segment:
                size = self._size(field, counts)
                if self._decides(field, counts, sizes):
                    cell = taken.upto(at + size)[at:]
                    self._note(field, cell, numbers)
                    self._tell(field, cell, counts, sizes, "")
                at += size
        return at, numbers

    def _decides(
        self, field: Renamed, counts: Mapping[str, int], sizes: Mapping[str, int]
    ) -> bool:
        if isinstance(field.subcon, Count):
            known = sizes if isinstance(field.subcon, SizeOf) else counts
            return field.subcon.of not in known
        inner = field.subcon.fields if isinstance(field.subcon, BitFields) else [field]
        return any(each.name in self.tested for each in inner)

    def _cell(self, field: Renamed, values: Container, path: str) -> bytes:
        if not isinstance(field.subcon, SizeOf):
            return super()._cell(field, values, path)
        counted = next(each for each in self.fields if each.name == field.subcon.of)
        size = len(super()._cell(counted, values, path)) + field.subcon.more
        return bytes(field.subcon.subcon.build(size))

    def _build(
        self, obj: Values, stream: BinaryIO, context: Container, path: str
    ) -> Values:
        data = BytesIO()
        super()._build(obj, data, context, path)
        if len(data.getvalue()) > self.most:
            raise RangeError(f"{self.name} has more than {self.most} bytes", path=path)
        stream.write(data.getvalue())
        return obj


class VariedRecord(Varied):
    """A record of variable size, or one that can be the last one: its name and its fields."""

    def __init__(
        self, name: str, *fields: Renamed, most: int, presence: Sequence[Presence] = ()
    ) -> None:
        super().__init__(name, 0, *fields, most=most, presence=presence)

    def written(self, obj: object, stream: BinaryIO, path: str) -> Mapping[str, int]:
        """Write a record; returns the raw numbers that tests need."""
        if not isinstance(obj, Mapping):
            raise ValidationError(f"{obj!r} is not a record {self.name}", path=path)
        data = self.build(obj)
        stream.write(data)
        return self.read(data, 0, len(data), path)[2]

    def _sizeof(self, context: Container, path: str) -> int:
        return int(self.least)


class _Taken:
    """The beginning of a payload, as far as it has been read."""

    def __init__(self, take: Callable[[int], bytes]) -> None:
        self._take = take
        self._data = b""

    def upto(self, end: int) -> bytes:
        """The bytes up to an offset."""
        if end > len(self._data):
            self._data += self._take(end - len(self._data))
        return self._data[:end]


def several_at(
    several: Several, data: bytes, at: int, end: int, number: int | None
) -> tuple[Any, int]:
    """Records at an offset, and that of their end; without a number they extend to ``end``."""
    # Any: a record, or a list of them.
    if isinstance(several, One):
        values, at, _ = several.record.read(data, at, end, "")
        return values, at
    if several.minimum == several.maximum:
        number = several.maximum
    found: list[Container] = []
    ended = False
    while not ended and (
        len(found) < number if number is not None else several.last or at < end
    ):
        if len(found) == several.maximum:
            raise RangeError(f"more than {several.maximum} records")
        values, at, numbers = several.record.read(data, at, end, "")
        found.append(values)
        ended = several.ends(numbers)
    several.checked(len(found), "")
    return found, at


def extent_of(several: Several, taken: _Taken, at: int, number: int) -> int:
    """The offset of the end of records at an offset."""
    for _ in range(number):
        at, numbers = several.record.extent(taken, at)
        if several.ends(numbers):
            return at
    if several.last:
        raise RangeError(f"no record of {number} is the last one")
    return at


def _several(field: Renamed) -> Several | None:
    inner = field.subcon.subcon if isinstance(field.subcon, Default) else field.subcon
    return inner if isinstance(inner, Several) else None


def _hold(tests: Sequence[Test], numbers: Mapping[str, int]) -> bool:
    return all(
        any(low <= numbers[name] <= high for low, high in ranges) != excluded
        for name, ranges, excluded in tests
    )
