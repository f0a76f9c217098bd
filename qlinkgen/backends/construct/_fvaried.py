"""Records that are read one by one: of variable size, or up to a last one; choices with a count."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from io import BytesIO
from itertools import pairwise
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
from ._fwalks import Presence, Taken, Test, Walked, _values

_NONE: Mapping[str, int] = {}


class SizeOf(Count):
    """The bytes of the records or of the choice ``of``; ``more`` bytes are counted beside them.

    A choice has at most ``most`` bytes.
    """

    def __init__(
        self, subcon: Construct, of: str, *, more: int = 0, most: int = 0
    ) -> None:
        super().__init__(subcon, of, more=more)
        self.most = most


class Several(Construct):
    """From minimum to maximum records, each read from where the one before it ends.

    With ``last``, the first record for which all tests hold is the last one. Some records take all bytes that
    are left if ``resting``, which only the last one may.
    """

    def __init__(
        self,
        record: VariedRecord,
        minimum: int,
        maximum: int,
        last: Sequence[Test] = (),
        *,
        resting: bool = False,
    ) -> None:
        super().__init__()
        self.record = record
        self.minimum = minimum
        self.maximum = maximum
        self.last = last
        self.resting = resting
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

    def _build(
        self, obj: object, stream: BinaryIO, context: Container, path: str
    ) -> object:
        if not isinstance(obj, Sequence):
            raise ValidationError(f"{obj!r} is not a list of records", path=path)
        self.checked(len(obj), path)
        data, starts, ends = BytesIO(), list[int](), list[bool]()
        for each in obj:
            starts.append(data.tell())
            ends.append(self.ends(self.record.written(each, data, path)))
        if self.last and ends != [*[False] * (len(ends) - 1), True]:
            raise ValidationError("only the last record must end the list", path=path)
        stream.write(data.getvalue())
        if self.resting:
            self._check_rest(data.getvalue(), starts, path)
        return obj

    def _check_rest(self, data: bytes, starts: Sequence[int], path: str) -> None:
        """Check that each record ends where the next one begins."""
        for at, after in pairwise(starts):
            if self.record.read(data, at, len(data), path)[1] != after:
                raise ValidationError("a record takes the bytes of others", path=path)

    def _sizeof(self, context: Container, path: str) -> int:
        return self.minimum * int(self.record.least)


class One(Several):
    """One record of variable size."""

    def __init__(self, record: VariedRecord) -> None:
        super().__init__(record, 1, 1)

    def _build(
        self, obj: object, stream: BinaryIO, context: Container, path: str
    ) -> object:
        self.record.written(obj, stream, path)
        return obj


class Varied(Walked):
    """A message with records that are read one by one, or a choice whose bytes are counted.

    ``most`` is the maximum size of its payload.
    """

    def __init__(
        self,
        name: str,
        message_id: int,
        *fields: Renamed,
        most: int,
        presence: Sequence[Presence] = (),
        **settings: Any,  # those of a Message
    ) -> None:
        super().__init__(name, message_id, *fields, presence=presence, **settings)
        self.most = most
        self.several = {
            field.name: found for field in fields if (found := _several(field))
        }
        sized = {each.subcon.of for each in fields if isinstance(each.subcon, SizeOf)}
        #: Choices that fill their bytes.
        self.filled = sized & {*self.slots.values()}

    def _varies(self, field: Renamed) -> bool:
        return field.name in self.several or super()._varies(field)

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> Container:
        data = stream_read_entire(stream, path)
        decided = self._decided(context)
        values, at, _ = self.read(data, 0, len(data), path, decided)
        if at != len(data):
            raise RangeError(f"{len(data) - at} bytes follow {self.name}", path=path)
        return values

    def read(
        self,
        data: bytes,
        at: int,
        end: int,
        path: str,
        decided: Mapping[str, int] = _NONE,
    ) -> tuple[Container, int, Mapping[str, int]]:
        """The values at an offset, that of their end, and the raw numbers that tests need.

        ``decided`` are the raw values of the frame among these.
        """
        found, limit, before = _Found(self.known, decided), end, ""
        for segment in self._segments():
            if (slot := self._filling(segment[0])) != before:
                _check_filled(before, at, limit, path)
                limit, before = at + found.sizes[slot] if slot else end, slot
                if limit > end:
                    raise RangeError(f"{slot} has no room", path=path)
            at = self._read_segment(segment, found, data, (at, limit), path)
        _check_filled(before, at, limit, path)
        values = Container(self._by_value(found.values)) if self.slots else found.values
        return values, at, found.numbers

    def _read_segment(
        self,
        segment: Sequence[Renamed],
        found: _Found,
        data: bytes,
        span: tuple[int, int],
        path: str,
    ) -> int:
        """Read a segment at the beginning of a span; the offset of its end."""
        (at, limit), name = span, segment[0].name
        if not self._present(segment[0], found.numbers, limit - at):
            absent = (name for each in segment for name in _values(each))
            found.values.update(dict.fromkeys(absent))
            return at
        if several := self.several.get(name):
            most = self._limit(segment[0], found.counts, found.sizes, span)
            number = found.counts.get(name)
            found.values[name], at = several_at(several, data, at, most, number)
            full = name in found.sizes or self._rests(segment[0], found.counts)
            _check_filled(name if full else "", at, most, path)
            return at
        self._infer(segment[0], found.counts, data[at:limit], path)
        sized = [self._size(each, found.counts) for each in segment]
        if limit - at < sum(sized):
            raise RangeError(f"{limit - at} bytes are left for {name}", path=path)
        for field, size in zip(segment, sized, strict=True):
            cell = data[at : at + size]
            value = field.parse(cell, number=found.counts.get(field.name))
            if isinstance(field.subcon, BitFields):
                found.values.update(value)
            elif isinstance(field.subcon, Default):
                found.values[field.name] = value
            self._follow(field, cell, found.cells, path)
            found.cells[field.name] = cell
            self._note(field, cell, found.numbers)
            self._tell(field, cell, found.counts, found.sizes, path)
            at += size
        return at

    def _filling(self, field: Renamed) -> str:
        """The choice that fills its bytes, of which a field is a case; "" for other fields."""
        slot = self.slots.get(field.name, "")
        return slot if slot in self.filled else ""

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
            limit = end - self._after(field, counts)
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
        if isinstance(count, SizeOf):
            known, least, most = sizes, 0, count.most
            if several:
                least = several.minimum * several.record.least
                most = several.maximum * several.record.most
            number = count.number(cell) - count.more
            if not least <= number <= min(self.most, most):
                raise RangeError(f"{number} bytes of {count.of}", path=path)
        elif several:
            known = counts
            number = several.checked(count.number(cell) - count.more, path)
        else:
            self._learn(field, cell, counts, path)
            return
        if known.setdefault(count.of, number) != number:
            raise RangeError(f"{field.name} does not agree with {count.of}", path=path)

    def measured(self, take: Callable[[int], bytes]) -> bytes:
        """Read a payload with ``take``; its size follows from counts and tested values."""
        taken = Taken(take)
        at, _ = self.extent(taken, 0)
        if at > self.most:
            raise RangeError(f"{at} bytes are too many for {self.name}")
        return taken.upto(at)

    def extent(self, taken: Taken, at: int) -> tuple[int, Mapping[str, int]]:
        """The offset of the end of what begins at an offset, and the raw numbers that tests need."""
        counts, numbers, sizes = dict(self.known), dict[str, int](), dict[str, int]()
        for segment in self._segments():
            if slot := self._filling(segment[0]):
                at += sizes.pop(slot, 0)
                continue
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
                self._seek(field, taken, at, counts)
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
        of = field.subcon.of
        counted = (
            self._sent(of, values, path)
            if of in self.filled
            else next(each for each in self.fields if each.name == of)
        )
        size = len(super()._cell(counted, values, path)) if counted else 0
        return bytes(field.subcon.subcon.build(size + field.subcon.more))

    def _sent(self, slot: str, values: Container, path: str) -> Renamed | None:
        """The case of a choice that is sent."""
        numbers: dict[str, int] = dict(values._decided)
        for field in self.fields:
            bits = isinstance(field.subcon, BitFields)
            inner = field.subcon.fields if bits else [field]
            tested = any(each.name in self.tested for each in inner)
            if tested and self._present(field, numbers, 0):
                self._note(field, super()._cell(field, values, path), numbers)
        cases = (each for each in self.fields if self.slots.get(each.name) == slot)
        return next((each for each in cases if self._present(each, numbers, 0)), None)

    def _after(self, field: Renamed, counts: Mapping[str, int]) -> int:
        return 0 if self._filling(field) else super()._after(field, counts)

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
        self,
        name: str,
        *fields: Renamed,
        most: int,
        presence: Sequence[Presence] = (),
        choices: Sequence[tuple[str, Sequence[str]]] = (),
    ) -> None:
        super().__init__(
            name, 0, *fields, most=most, presence=presence, choices=choices
        )

    def written(self, obj: object, stream: BinaryIO, path: str) -> Mapping[str, int]:
        """Write a record; returns the raw numbers that tests need."""
        if not isinstance(obj, Mapping):
            raise ValidationError(f"{obj!r} is not a record {self.name}", path=path)
        data = self.build(obj)
        stream.write(data)
        return self.read(data, 0, len(data), path)[2]

    def _sizeof(self, context: Container, path: str) -> int:
        return int(self.least)


class _Found:
    """What has been read of a message or record: values, bytes, and what later fields depend on."""

    def __init__(self, known: Mapping[str, int], decided: Mapping[str, int]) -> None:
        self.values = Container()
        self.cells: dict[str, bytes] = {}
        self.counts = dict(known)
        self.numbers = dict(decided)
        self.sizes: dict[str, int] = {}


def _check_filled(name: str, at: int, limit: int, path: str) -> None:
    """Check that what fills its bytes ends with them; "" for what does not."""
    if name and at != limit:
        raise RangeError(f"{name} does not fill its bytes", path=path)


def several_at(
    several: Several, data: bytes, at: int, end: int, number: int | None
) -> tuple[Container | list[Container], int]:
    """Records at an offset, and that of their end; without a number they extend to ``end``."""
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


def extent_of(several: Several, taken: Taken, at: int, number: int) -> int:
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
        name in numbers
        and any(low <= numbers[name] <= high for low, high in ranges) != excluded
        for name, ranges, excluded in tests
    )
