"""Messages in which fields may be absent: walked field by field, in wire order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
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
    stream_write,
)

from ._fields import (
    BitFields,
    BytesField,
    Count,
    Groups,
    Message,
    Row,
    TextField,
    Values,
    _innermost,
    bits_of,
)

#: A test of an earlier value: its name, ranges of raw numbers, whether they are excluded.
Test = tuple[str, Sequence[tuple[int, int]], bool]
#: A field that may be absent: its name, what decides (() if it is optional), whether it is sent by default.
Presence = tuple[str, Sequence[Test], bool]


class TerminatedBytes(BytesField):
    """Bytes that one more ends, which they do not contain."""

    def __init__(self, terminator: bytes, minimum: int, maximum: int) -> None:
        super().__init__(minimum, maximum)
        self.terminator = terminator

    def extent(self, number: int) -> int:
        """Size of so many bytes with their terminator."""
        return number + 1

    def sought(self, upto: Callable[[int], bytes], at: int) -> int:
        """Their number; they begin at an offset of what ``upto`` reads up to another."""
        for number in range(self.maximum + 1):
            if upto(at + number + 1)[at + number :] == self.terminator:
                return self.checked(number, "")
        return self.checked(self.maximum + 1, "")

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> bytes | str:
        data: bytes = stream_read_entire(stream, path)
        return data[:-1]

    def _build(self, obj: Row, stream: BinaryIO, context: Container, path: str) -> Row:
        super()._build(obj, stream, context, path)
        if self.terminator[0] in obj:
            raise ValidationError(f"{obj!r} has its terminator in it", path=path)
        stream_write(stream, self.terminator, 1, path)
        return obj


class TerminatedText(TextField, TerminatedBytes):
    """Text of 7-bit characters that one more ends, which it does not contain."""

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> str:
        data: bytes = stream_read_entire(stream, path)
        return super()._parse(BytesIO(data[:-1]), context, path)


class Taken:
    """The beginning of a payload, as far as it has been read."""

    def __init__(self, take: Callable[[int], bytes]) -> None:
        self._take = take
        self._data = b""

    def upto(self, end: int) -> bytes:
        """The bytes up to an offset."""
        if end > len(self._data):
            self._data += self._take(end - len(self._data))
        return self._data[:end]


class Walked(Message):
    """A message in which fields may be absent; an absent field is None.

    Consecutive fields of fixed size that are always present are a segment: its size is checked first, then
    its values. Any other field is a segment of its own.
    """

    def __init__(
        self,
        name: str,
        message_id: int,
        *fields: Renamed,
        presence: Sequence[Presence] = (),
        choices: Sequence[tuple[str, Sequence[str]]] = (),
        most: int = 0,
        decided_by: Sequence[tuple[str, int]] = (),
        **settings: Any,  # those of a Message
    ) -> None:
        super().__init__(name, message_id, *fields, **settings)
        self.decided_by = dict(decided_by)
        #: The value of which a field is a case.
        self.slots = {case: slot for slot, cases in choices for case in cases}
        self.presence = {field: tests for field, tests, _ in presence}
        self.tested = {test[0] for _, tests, _ in presence for test in tests}
        absent = {field for field, _, given in presence if not given}
        for field in fields:
            if field.name in absent:
                self.defaults.update(dict.fromkeys(_values(field)))
        self.defaults = self._by_value(self.defaults)
        always = [field for field in fields if field.name not in self.presence]
        self.least = sum(self._least(field) for field in always)
        #: Some fields exclude each other.
        self.most = most or self.most

    def _by_value(self, found: Values) -> dict[str, object]:
        """Values by field with one for each choice, that of the case which is present."""
        values: dict[str, object] = {}
        for name, value in found.items():
            slot = self.slots.get(name, name)
            if values.get(slot) is None:
                values[slot] = value
        return values

    def _least(self, field: Renamed) -> int:
        run = self.runs.get(field.name)
        return self._size(field, {field.name: run.minimum} if run else {})

    def _varies(self, field: Renamed) -> bool:
        return field.name in self.runs and field.name not in self.known

    def _segments(self) -> Iterator[list[Renamed]]:
        segment: list[Renamed] = []
        for field in self.fields:
            if self._varies(field) or field.name in self.presence:
                if segment:
                    yield segment
                    segment = []
                yield [field]
            else:
                segment.append(field)
        if segment:
            yield segment

    def _present(self, field: Renamed, numbers: Mapping[str, int], left: int) -> bool:
        tests = self.presence.get(field.name)
        if tests is None:
            return True
        if not tests:
            return left > 0
        return all(
            name in numbers
            and any(low <= numbers[name] <= high for low, high in ranges) != excluded
            for name, ranges, excluded in tests
        )

    def _note(self, field: Renamed, cell: bytes, numbers: dict[str, int]) -> None:
        """Note the raw numbers of a field that conditions test."""
        if isinstance(field.subcon, BitFields):
            whole = _number(field.subcon.integer, cell)
            for inner in field.subcon.fields:
                if inner.name in self.tested:
                    numbers[inner.name] = bits_of(inner, whole)
        elif field.name in self.tested:
            numbers[field.name] = _number(field, cell)

    def _learn(
        self, field: Renamed, cell: bytes, counts: dict[str, int], path: str
    ) -> None:
        if isinstance(field.subcon, Count):
            number = self._learned(field, cell, path, counts)
            if counts.setdefault(field.subcon.of, number) != number:
                raise RangeError(
                    f"{field.name} does not agree with {field.subcon.of}", path=path
                )

    def _decided(self, context: Container) -> dict[str, int]:
        """The raw values of the frame that conditions test."""
        given = context.get("_params", {}).get("decided", {})
        return {
            name: given.get(name, number) for name, number in self.decided_by.items()
        }

    def measured(self, take: Callable[[int], bytes]) -> bytes:
        """Read a payload with ``take``; its size follows from counts and tested values."""
        taken, at = Taken(take), 0
        counts, numbers = dict(self.known), dict[str, int]()
        for segment in self._segments():
            if not self._present(segment[0], numbers, 1):
                continue
            for field in segment:
                self._seek(field, taken, at, counts)
                size = self._size(field, counts)
                inner = (
                    field.subcon.fields
                    if isinstance(field.subcon, BitFields)
                    else [field]
                )
                counting = (
                    isinstance(field.subcon, Count) and field.subcon.of not in counts
                )
                if counting or any(each.name in self.tested for each in inner):
                    cell = taken.upto(at + size)[at:]
                    self._note(field, cell, numbers)
                    self._learn(field, cell, counts, "")
                at += size
        return taken.upto(at)

    def _seek(
        self, field: Renamed, taken: Taken, at: int, counts: dict[str, int]
    ) -> None:
        """Look for the end of bytes with a terminator, which begin at an offset."""
        run = self.runs.get(field.name)
        if isinstance(run, TerminatedBytes):
            counts[field.name] = run.sought(taken.upto, at)

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> Container:
        data, at = stream_read_entire(stream, path), 0
        counts, numbers = dict(self.known), self._decided(context)
        values, cells = Container(), dict[str, bytes]()
        for segment in self._segments():
            left = len(data) - at
            if not self._present(segment[0], numbers, left):
                values.update(
                    dict.fromkeys(name for each in segment for name in _values(each))
                )
                continue
            self._infer(segment[0], counts, data[at:], path)
            if left < (needed := sum(self._size(each, counts) for each in segment)):
                raise RangeError(
                    f"{left} bytes are left, {segment[0].name} needs {needed}",
                    path=path,
                )
            for field in segment:
                cell = data[at : at + self._size(field, counts)]
                found = field.parse(cell, number=counts.get(field.name))
                if isinstance(field.subcon, BitFields):
                    values.update(found)
                elif isinstance(field.subcon, Default):
                    values[field.name] = found
                self._follow(field, cell, cells, path)
                cells[field.name] = cell
                self._note(field, cell, numbers)
                self._learn(field, cell, counts, path)
                at += len(cell)
        if at != len(data):
            raise RangeError(f"{len(data) - at} bytes follow {self.name}", path=path)
        return Container(self._by_value(values)) if self.slots else values

    def _follow(
        self, field: Renamed, cell: bytes, cells: Mapping[str, bytes], path: str
    ) -> None:
        """Verify a number that follows from the bytes of earlier fields."""

    def _filled(self, field: Renamed, cell: bytes, cells: Mapping[str, bytes]) -> bytes:
        """The bytes of a field, which may follow from those of earlier ones."""
        return cell

    def _infer(
        self, field: Renamed, counts: dict[str, int], data: bytes, path: str
    ) -> None:
        """The number of items of a run that takes the rest of the payload, or has a terminator."""
        run, left = self.runs.get(field.name), len(data)
        if run is None or field.name in counts:
            return
        if isinstance(run, TerminatedBytes):
            counts[field.name] = run.checked(data.find(run.terminator), path)
            return
        number, odd = divmod(left - self._after(field, counts), run.size)
        if odd:
            raise RangeError(
                f"the bytes left do not divide into items of {field.name}", path=path
            )
        counts[field.name] = run.checked(number, path)

    def _after(self, field: Renamed, counts: Mapping[str, int]) -> int:
        """The size of what follows a field that takes the rest of the payload."""
        # A field after the rest that may be absent is absent where the rest is present.
        after = self.fields[self.fields.index(field) + 1 :]
        always = (each for each in after if each.name not in self.presence)
        return sum(self._size(each, counts) for each in always)

    def _build(
        self, obj: Values, stream: BinaryIO, context: Container, path: str
    ) -> Values:
        values = self._initial(obj, path)
        values.update(obj)
        values._decided = self._decided(context)
        numbers: dict[str, int] = dict(values._decided)
        left_out = False
        sent: set[str] = set()
        cells: dict[str, bytes] = {}
        for field in self.fields:
            if field.name in self.slots:
                sent |= self._case(field, values, numbers, stream, path)
                continue
            given = [values[name] is not None for name in _values(field)]
            present = self._present(field, numbers, 0)
            if self.presence.get(field.name) == ():
                present = given[0] and not left_out
                left_out = not present
            if any(each != present for each in given):
                raise ValidationError(
                    f"{field.name} is given where it must be absent, or the reverse",
                    path=path,
                )
            if present:
                cell = self._filled(field, self._cell(field, values, path), cells)
                cells[field.name] = cell
                self._note(field, cell, numbers)
                stream_write(stream, cell, len(cell), path)
        for slot in self.slots.values():
            if slot not in sent and values[slot] is not None:
                raise ValidationError(f"{slot} must be absent here", path=path)
        return obj

    def _case(
        self,
        field: Renamed,
        values: Container,
        numbers: Mapping[str, int],
        stream: BinaryIO,
        path: str,
    ) -> set[str]:
        """Send the value of a choice if this is its case; the name of the value if it is."""
        if not self._present(field, numbers, 0):
            return set()
        slot = self.slots[field.name]
        if values[slot] is None:
            raise ValidationError(f"{slot} is missing", path=path)
        cell = self._cell(field, values, path)
        stream_write(stream, cell, len(cell), path)
        return {slot}

    def _cell(self, field: Renamed, values: Container, path: str) -> bytes:
        name = self.slots.get(field.name, field.name)
        return self._written(field, values.get(name), values, path)


def _values(field: Renamed) -> list[str]:
    """Names of the values of a field."""
    inside = field.subcon.fields if isinstance(field.subcon, BitFields) else (field,)
    return [each.name for each in inside if isinstance(each.subcon, Default)]


def _number(subcon: Construct, data: bytes) -> int:
    """The integer of wire bytes, without regard to what is legal."""
    inner = _innermost(subcon)
    return int(inner.number(data) if isinstance(inner, Groups) else inner.parse(data))
