"""Values to payload bytes, and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from decimal import Decimal
from fractions import Fraction
from typing import TypeAlias

from tests.support.whole.reference import checks
from tests.support.whole.reference.layouts import (
    Kind,
    Message,
    Number,
    Packed,
    Record,
    Records,
    Run,
    Slot,
    Test,
    Value,
    most_bytes,
    size_of,
)
from tests.support.whole.reference.reals import real_of, real_text

#: A raw value: a number, a list of numbers, bytes, a record, or a list of records.
Raw: TypeAlias = "int | list[int] | bytes | Mapping[str, Raw] | Sequence[Mapping[str, Raw]] | None"


class Wrong(Exception):
    """Bytes or values are rejected: the kind of fault."""

    def __init__(self, kind: str, about: str = "") -> None:
        """`about` is a text for failed tests."""
        super().__init__(f"{kind} {about}".strip())
        self.kind = kind


def put(pieces: Sequence[tuple[int, int]], raw: int) -> bytes:
    """The wire bytes of an integer."""
    return bytes(raw >> shift & (1 << bits) - 1 for shift, bits in pieces)


def get(pieces: Sequence[tuple[int, int]], data: bytes) -> int:
    """The unsigned integer of wire bytes."""
    return sum((byte & (1 << bits) - 1) << shift for (shift, bits), byte in zip(pieces, data, strict=True))


def stray(pieces: Sequence[tuple[int, int]], data: bytes) -> bool:
    """Whether a byte has unused bits set."""
    return any(byte >> bits for (_, bits), byte in zip(pieces, data, strict=True))


def check(number: Number, raw: int) -> None:
    """Check the range of a number. Raises Wrong."""
    if number.bounds and not number.bounds[0] <= number.number(raw) <= number.bounds[1]:
        raise Wrong("range", str(raw))
    data = raw.to_bytes(number.bits // 8, "big") if number.without is not None else b""
    if not data.isascii() or any(each in (number.without or b"") for each in data):
        raise Wrong("range", str(raw))
    if not number.low <= raw <= number.high or raw & number.forbidden:
        raise Wrong("range", str(raw))


def default(kind: Value) -> Raw:
    """The default of a field."""
    if isinstance(kind, Number):
        return kind.default
    if isinstance(kind, Record):
        return default_record(kind)
    if isinstance(kind, Records):
        return [default_record(kind.record) for _ in range(kind.low)]
    return list(kind.default) if kind.item else bytes(kind.default)


def default_record(kind: Record) -> dict[str, Raw]:
    """The defaults of a record."""
    return {
        name: default(each) if slot.given else None for slot in kind.slots for name, each in slot.values()
    }


def encode(message: Message, values: Mapping[str, Raw]) -> bytes:
    """The payload of a message."""
    if message.separator:
        return _texts(message, values)
    data = _fields(message.slots, values)
    _check_barred(message, values)
    if len(data) > message.sizes[1]:
        raise Wrong("range", "too long")
    while message.trim is not None and len(data) > message.trim and data[-1] == 0:
        data = data[:-1]
    return data


def _check_barred(message: Message, values: Mapping[str, Raw]) -> None:
    """Check that no text has a byte that ends the frame. Raises Wrong."""
    for slot in message.slots:
        text = values.get(slot.name)
        plain = isinstance(slot.kind, Run) and slot.kind.text and not slot.kind.item and not slot.kind.pad
        if plain and isinstance(text, bytes) and any(each in message.barred for each in text):
            raise Wrong("range", slot.name)


def _texts(message: Message, values: Mapping[str, Raw]) -> bytes:
    """The texts of the fields; absent ones at the end are left out."""
    texts, seen = list[bytes](), False
    for slot in reversed(message.slots):
        if slot.optional and values[slot.name] is None:
            text = b""
        elif isinstance(slot.kind, Run) and slot.kind.item:
            given = values[slot.name]
            assert isinstance(given, list)
            if not slot.kind.low <= len(given) <= slot.kind.most:
                raise Wrong("range", f"{len(given)} items")
            numbers = [_number(slot.kind.item, each) for each in given]
            text = message.separator.join(_put(slot.kind.item, each) for each in numbers)
            if not given:  # a list without items has no text
                continue
            seen = True
        else:
            text = _encoded(message.slots, slot, values)
            seen = True
            if isinstance(slot.kind, Run) and any(each in message.barred for each in text):
                raise Wrong("range", slot.name)
        if seen:
            texts.append(text)
    if texts and message.leading:
        texts.append(b"")
    return message.separator.join(reversed(texts))


def _between(message: Message, payload: bytes) -> dict[str, Raw]:
    """The values of texts between separators."""
    texts = payload.split(message.separator)
    if message.leading and texts.pop(0):
        raise Wrong("length", "no separator at the beginning")
    needed = [index for index, slot in enumerate(message.slots) if not slot.optional and slot.texts[0]]
    least = sum(slot.texts[0] for slot in message.slots[: max(needed, default=-1) + 1])
    most = sum(slot.texts[1] for slot in message.slots)
    if not max(least, 0 if message.leading else 1) <= len(texts) <= most:
        raise Wrong("length", f"{len(texts)} texts")
    values: dict[str, Raw] = {}
    told: dict[str, int] = {}
    for index, slot in enumerate(message.slots):
        kind = slot.kind
        if isinstance(kind, Run) and kind.item:
            after = sum(each.texts[0] for each in message.slots[index + 1 :]) if kind.low < kind.most else 0
            number = len(texts) - after if after else kind.most
            own, texts = texts[:number], texts[number:]
            none = own == [b""] and not kind.low and not after
            values[slot.name] = [] if none else _list(slot, kind.item, own)
            if any(
                told[each.name] != (0 if none else len(own))
                for each in message.slots
                if each.counts == slot.name
            ):
                raise Wrong("length", "a count")
            continue
        text, texts = (texts or [b""])[0], texts[1:]
        if slot.optional and not text:
            values[slot.name] = None
            continue
        least, most = slot.text_sizes
        if not least <= len(text) <= most:
            raise Wrong("length", slot.name)
        values |= _decoded(slot, text, len(text))
        if isinstance(kind, Number) and slot.counts:
            told[slot.name] = _get(kind, text)
        if isinstance(kind, Run) and any(each in message.barred for each in text):
            raise Wrong("range", slot.name)
    return values


def _list(slot: Slot, item: Number, texts: Sequence[bytes]) -> list[int]:
    """The items of a list between separators."""
    found = []
    for text in texts:
        least, most = slot.text_sizes
        if not least <= len(text) <= most:
            raise Wrong("length", slot.name)
        found.append(_checked(item, _get(item, text)))
    return found


def _follows(slot: Slot, slots: Sequence[Slot], cells: Mapping[str, bytes]) -> bytes:
    """The bytes of a number that follows from the bytes of other fields."""
    assert slot.rule is not None
    assert isinstance(slot.kind, Number)
    data = b"".join(cells[name] for name in slot.over)
    if "algorithm" in slot.rule:
        number = checks.compute(slot.rule["algorithm"], data, slot.rule.get("init"))
    else:
        text = slot.rule["equals"].replace(" ", "")
        source = next(each.kind for each in slots if each.name == slot.over[0])
        assert isinstance(source, Number | Packed)
        number = get(source.pieces, data)
        number = ~number if text[0] == "~" else number
        number += int(text.removeprefix("~").removeprefix(slot.over[0]) or 0)
    return put(slot.kind.pieces, number & (1 << slot.kind.bits) - 1)


def _verify(slot: Slot, slots: Sequence[Slot], cells: Mapping[str, bytes]) -> None:
    """Compare the bytes of a field with those that follow from others. Raises Wrong."""
    if slot.rule is not None and cells[slot.name] != _follows(slot, slots, cells):
        raise Wrong("crc" if "algorithm" in slot.rule else "range", slot.name)


def _fields(slots: Sequence[Slot], values: Mapping[str, Raw]) -> bytes:
    data, left_out = b"", False
    cells: dict[str, bytes] = {}
    for slot in slots:
        given = {values[name] is not None for name, _ in slot.values()}
        sent = holds(slot, {name: raw for name, raw in values.items() if isinstance(raw, int)})
        if slot.optional:
            sent = given == {True} and not left_out
            left_out = not sent
        if given - {sent}:
            raise Wrong("range", f"{slot.name} is absent, or is not")
        if slot.rule is not None:
            cells[slot.name] = _follows(slot, slots, cells)
        else:
            cells[slot.name] = _encoded(slots, slot, values) if sent else b""
        data += cells[slot.name]
    return data


def holds(slot: Slot, numbers: Mapping[str, int]) -> bool:
    """Whether the conditions of a field hold."""
    return all(
        name in numbers and any(low <= numbers[name] <= high for low, high in ranges) != excluded
        for name, ranges, excluded in slot.when
    )


def _encoded(slots: Sequence[Slot], slot: Slot, values: Mapping[str, Raw]) -> bytes:
    kind = slot.kind
    if isinstance(kind, Record):
        return _fields(kind.slots, values[slot.name])  # type: ignore[arg-type]
    if isinstance(kind, Records):
        return _encoded_records(kind, values[slot.name])
    if isinstance(kind, Packed):
        raw = 0
        for name, shift, number in kind.members:
            raw |= (_number(number, values[name]) & (1 << number.bits) - 1) << shift
        return put(kind.pieces, raw)
    if isinstance(kind, Run):
        return _encoded_run(kind, values[slot.name])
    if slot.role == "count":
        if cases := [each for each in slots if each.choice == slot.counts]:
            size = sum(len(_encoded(slots, each, values)) for each in cases if values[each.name] is not None)
            return put(kind.pieces, _held(slot, kind, size))
        counted = next(each.kind for each in slots if each.name == slot.counts)
        return _put(kind, _told(slot, kind, counted, values[slot.counts]))
    return _put(kind, _number(kind, values[slot.name]) if slot.role == "value" else kind.default)


def _encoded_records(kind: Records, records: Raw) -> bytes:
    assert isinstance(records, Sequence)
    if not kind.low <= len(records) <= kind.most:
        raise Wrong("range", f"{len(records)} records")
    ends = [meets(kind, each) for each in records]  # type: ignore[arg-type]
    if kind.last and ends != [*[False] * (len(ends) - 1), True]:
        raise Wrong("range", "the last record")
    whole = b"".join(_fields(kind.record.slots, each) for each in records)  # type: ignore[arg-type]
    if any(takes_rest(kind, each) for each in records[:-1]):  # type: ignore[arg-type]
        raise Wrong("range", "a record takes the rest")
    return whole


def takes_rest(kind: Records, values: Mapping[str, Raw]) -> bool:
    """Whether a record is not read back alike where other bytes follow it."""
    if kind.record.constant:
        return False
    try:
        data = _fields(kind.record.slots, values)
        return _Walk(kind.record.slots, data + data).run(0, 2 * len(data))[1] != len(data)
    except Wrong:
        return True


def _told(slot: Slot, number: Number, counted: Kind, given: Raw) -> int:
    """The number that a count tells."""
    assert isinstance(counted, Run | Records)
    assert not isinstance(given, int | None)
    told = counted.bytes_of(len(given)) if slot.counts_in == "bytes" else len(given)
    if isinstance(counted, Records) and slot.counts_in == "bytes" and not counted.record.constant:
        told = len(_encoded_records(counted, given))
    return _held(slot, number, told)


def _held(slot: Slot, number: Number, told: int) -> int:
    """A count with what it counts beside. Raises Wrong if it does not fit."""
    told = (told + slot.more) // slot.scale
    if told >= 1 << number.bits - number.signed:
        raise Wrong("range", "a count")
    return told


def meets(kind: Records, values: Mapping[str, Raw]) -> bool:
    """Whether a record is one that ends its array."""
    return met(kind.last, {name: raw for name, raw in values.items() if isinstance(raw, int)})


def met(tests: Sequence[Test], numbers: Mapping[str, int]) -> bool:
    """Whether there are tests, and all hold."""
    return bool(tests) and all(
        name in numbers and any(low <= numbers[name] <= high for low, high in ranges) != excluded
        for name, ranges, excluded in tests
    )


def _put(number: Number, raw: int) -> bytes:
    if number.words:
        return number.words[raw]
    if number.scientific:
        return real_text(number, raw)
    if number.text:
        base, least, _, point, _ = number.text
        if base == 16:
            return format(raw, f"0{least}X").encode()
        return format(
            Decimal(raw).scaleb(-point), f"{'>' if number.spaced else '0'}{least}.{point}f"
        ).encode()
    return put(number.pieces, int(str(raw), 16) if number.bcd else raw)


def _get(number: Number, data: bytes) -> int:
    """The integer of wire bytes. Raises Wrong for a wrong digit, or another word."""
    if number.words:
        for place, word in enumerate(number.words):
            if data == word or (number.any_case and data.lower() == word.lower()):
                return place
        raise Wrong("range", str(data))
    if number.scientific:
        return real_of(number, data)
    if number.text:
        return _of_text(number, data, number.text)
    pattern = get(number.pieces, data)
    if not number.bcd:
        return pattern
    text = f"{pattern:x}"
    if not text.isdecimal():
        raise Wrong("range", text)
    return int(text)


def _of_text(number: Number, data: bytes, text: tuple[int, int, int, int, bool]) -> int:
    """The integer of a text. Raises Wrong."""
    base, _, _, point, signed = text
    while number.spaced and data.startswith(b" "):
        data = data[1:]
    alphabet = b"0123456789abcdefABCDEF" if base == 16 else b"0123456789."
    digits = data[1:] if signed and data[:1] in (b"+", b"-") else data
    if any(each not in alphabet for each in digits) or digits.count(b".") > 1 or not digits.strip(b"."):
        raise Wrong("range", str(data))
    value = Fraction(int(digits, 16)) if base == 16 else Fraction(digits.decode()) * 10**point
    value = -value if data[:1] == b"-" else value
    if value.denominator != 1 or not number.low <= value <= number.high:
        raise Wrong("range", str(data))
    return int(value)


def _number(number: Number, raw: Raw) -> int:
    assert isinstance(raw, int)
    check(number, raw)
    return raw


def _encoded_run(kind: Run, given: Raw) -> bytes:
    assert not isinstance(given, int | None)
    if kind.pad and isinstance(given, bytes):
        given = given.ljust(kind.most, kind.pad)
    if not kind.low <= len(given) <= kind.most:
        raise Wrong("range", f"{len(given)} items")
    if kind.item and kind.packed:
        assert isinstance(given, list)
        numbers = [_number(kind.item, each) & (1 << kind.item.bits) - 1 for each in given]
        digits = [f"{each:0{kind.item.bits}b}" for each in numbers]
        text = "".join(each if kind.packed == "most" else each[::-1] for each in digits)
        text += "0" * (-len(text) % 8)
        octets = [text[at : at + 8] for at in range(0, len(text), 8)]
        return bytes(int(each if kind.packed == "most" else each[::-1], 2) for each in octets)
    if kind.item:
        return b"".join(_put(kind.item, _number(kind.item, each)) for each in given)  # type: ignore[arg-type]
    assert isinstance(given, bytes)
    if kind.text and any(each > 0x7F for each in given):
        raise Wrong("range", "text")
    if kind.end and kind.end in given:
        raise Wrong("range", "terminator")
    return given + kind.end


def decode(message: Message, payload: bytes, beside: Mapping[str, Raw] | None = None) -> dict[str, Raw]:
    """The values of a payload. Raises Wrong, for wrong lengths before values out of range.

    `beside` are values of its frame.
    """
    if not payload and message.empty_is_default:
        return {name: default(kind) for name, kind in message.values() if (name, kind) not in message.beside}
    if message.separator:
        return _between(message, payload)
    if message.walked:
        return _walked(message, payload, beside or {})
    values: dict[str, Raw] = {}
    if message.trim is not None:
        payload += bytes(max(0, message.sizes[1] - len(payload)))
    cells: dict[str, bytes] = {}
    for slot, data, number in _cut(message, payload):
        cells[slot.name] = data
        values |= _decoded(slot, data, number)
        _check_barred(message, values)
        _verify(slot, message.slots, cells)
    return values


def _segments(slots: Sequence[Slot]) -> list[list[Slot]]:
    """Consecutive fields of constant size that are always present, and each other field alone."""
    segments: list[list[Slot]] = []
    joined = False
    for slot in slots:
        if joined and slot.fixed and not slot.conditional:
            segments[-1].append(slot)
        else:
            segments.append([slot])
        joined = slot.fixed and not slot.conditional
    return segments


def _walked(message: Message, payload: bytes, beside: Mapping[str, Raw]) -> dict[str, Raw]:
    """The values of a payload in which the places of fields depend on values."""
    walk = _Walk(message.slots, payload, message.sizes[1])
    for name, kind in message.beside:
        raw = beside.get(name, kind.default)
        if name in message.decided_by and isinstance(raw, int):
            walk.numbers[name] = raw
    values, at = walk.run(0, len(payload))
    if at != len(payload):
        raise Wrong("length", "bytes are left")
    return values


class _Walk:
    """Reads a message or record: the size of each segment, then its values."""

    def __init__(self, slots: Sequence[Slot], payload: bytes, most: int = 1 << 32) -> None:
        self.slots, self._payload, self._most = slots, payload, most
        self.numbers: dict[str, int] = {}
        self._counted: dict[str, int] = {}
        #: Bytes of records of variable size.
        self._sizes: dict[str, int] = {}
        self._cells: dict[str, bytes] = {}

    def run(self, at: int, end: int) -> tuple[dict[str, Raw], int]:
        """The values, and the offset of the end."""
        values: dict[str, Raw] = {}
        limit, choice = end, ""
        for segment in [*_segments(self.slots), []]:
            after = segment[0].choice if segment else ""
            if after != choice:
                if choice in self._sizes and at != limit:
                    raise Wrong("length", choice)
                limit, choice = at + self._sizes[after] if after in self._sizes else end, after
            if limit > end:
                raise Wrong("length", choice)
            if not segment:
                break
            first, left = segment[0], limit - at
            if not (left > 0 if first.optional else holds(first, self.numbers)):
                values |= dict.fromkeys(name for name, _ in first.values())
            elif first.walked:
                values[first.name], at = self._records(first, at, limit)
            else:
                found, at = self._plain(segment, at, left)
                values |= found
        return values, at

    def _plain(self, segment: Sequence[Slot], at: int, left: int) -> tuple[dict[str, Raw], int]:
        first, values = segment[0], dict[str, Raw]()
        sizes = [_size(slot, self._counted) for slot in segment]
        if isinstance(first.kind, Run) and first.kind.end:
            sizes = [_ended(first.kind, self._payload[at : at + left])]
        elif sizes == [None]:
            sizes = [left - self._behind(first)]
            _demand(first.kind, sizes[0] or 0)
        if sum(size or 0 for size in sizes) > left:
            raise Wrong("length", first.name)
        for slot, size in zip(segment, sizes, strict=True):
            data = self._payload[at : at + (size or 0)]
            kind = slot.kind
            number = None
            if isinstance(kind, Run | Records) and not slot.fixed:
                number = len(data) // kind.step
            self._cells[slot.name] = data
            values |= _decoded(slot, data, number)
            _verify(slot, self.slots, self._cells)
            note(slot, data, self.numbers)
            if slot.counts:
                self._count(slot, data)
            at += len(data)
        return values, at

    def _behind(self, slot: Slot) -> int:
        if slot.choice in self._sizes:
            return 0
        behind = self.slots[self.slots.index(slot) + 1 :]
        return _behind([each for each in behind if not each.conditional], self._counted)

    def _count(self, slot: Slot, data: bytes) -> None:
        if cases := [each for each in self.slots if each.choice == slot.counts]:
            assert isinstance(slot.kind, Number)
            self._sized(slot, slot.kind, data, 0, min(most_bytes(cases), self._most))
            return
        counted = next(each for each in self.slots if each.name == slot.counts)
        if slot.counts_in != "bytes" or not counted.walked:
            _note(self.slots, slot, data, self._counted)
            return
        assert isinstance(slot.kind, Number)
        assert isinstance(counted.kind, Records)
        self._sized(slot, slot.kind, data, counted.least_bytes, min(counted.most_bytes, self._most))

    def _sized(self, slot: Slot, number: Number, data: bytes, least: int, most: int) -> None:
        """Take the bytes of records or of a choice from a count."""
        size = get(number.pieces, data) - slot.more
        if not least <= size <= most or size != self._sizes.setdefault(slot.counts, size):
            raise Wrong("length", f"size {size}")

    def _records(self, slot: Slot, at: int, end: int) -> tuple[Raw, int]:
        kind = slot.kind
        if isinstance(kind, Record):
            values, at = _Walk(kind.slots, self._payload).run(at, end)
            return values, at
        assert isinstance(kind, Records)
        wanted = self._counted.get(slot.name, kind.low if kind.low == kind.most else None)
        limit = end
        if slot.name in self._sizes:
            limit = at + self._sizes[slot.name]
        elif wanted is None and not kind.last:
            limit = end - self._behind(slot)
        if not at <= limit <= end:
            raise Wrong("length", slot.name)
        found: list[Mapping[str, Raw]] = []
        ended = False
        while not ended and (len(found) < wanted if wanted is not None else kind.last or at < limit):
            if len(found) == kind.most:
                raise Wrong("length", "too many records")
            own = _Walk(kind.record.slots, self._payload)
            values, at = own.run(at, limit)
            found.append(values)
            ended = met(kind.last, own.numbers)
        exact = slot.name in self._sizes or (wanted is None and not kind.last)
        if len(found) < kind.low or (exact and at != limit):
            raise Wrong("length", slot.name)
        return found, at


def _ended(kind: Run, left: bytes) -> int:
    """The size of a text with its terminator. Raises Wrong."""
    count = left[: kind.most + 1].find(kind.end)
    if count < kind.low:
        raise Wrong("length", "no terminator")
    return count + 1


def note(slot: Slot, data: bytes, numbers: dict[str, int]) -> None:
    """Note the raw numbers of a field, legal or not."""
    if isinstance(slot.kind, Number):
        numbers[slot.name] = _signed(slot.kind, get(slot.kind.pieces, data))
    elif isinstance(slot.kind, Packed):
        whole = get(slot.kind.pieces, data)
        for name, shift, number in slot.kind.members:
            numbers[name] = _signed(number, whole >> shift)


def _decoded(slot: Slot, data: bytes, number: int | None) -> dict[str, Raw]:
    kind = slot.kind
    if isinstance(kind, Record):
        return {slot.name: _decoded_record(kind, data)}
    if isinstance(kind, Records):
        starts = range(0, len(data), kind.step)
        return {slot.name: [_decoded_record(kind.record, data[at : at + kind.step]) for at in starts]}
    if isinstance(kind, Run):
        return {slot.name: _decoded_run(kind, data, kind.most if number is None else number)}
    if slot.role in ("reserved", "filled"):
        return {}
    spelt = isinstance(kind, Number) and bool(kind.text or kind.words or kind.scientific)
    if not spelt and stray(kind.pieces, data):
        raise Wrong("range", slot.name)
    if isinstance(kind, Packed):
        whole = get(kind.pieces, data)
        return {name: _checked(number, whole >> shift) for name, shift, number in kind.members}
    raw = _signed(kind, _get(kind, data))
    if slot.role == "count":
        return {}
    check(kind, raw)
    if slot.role == "constant":
        if raw not in (kind.default, *slot.accepted):
            raise Wrong("range", slot.name)
        return {}
    return {slot.name: kind.told(raw)}


def _decoded_record(kind: Record, data: bytes) -> dict[str, Raw]:
    values: dict[str, Raw] = {}
    cells: dict[str, bytes] = {}
    at = 0
    for slot in kind.slots:
        cells[slot.name] = data[at : at + slot.most_bytes]
        values |= _decoded(slot, cells[slot.name], None)
        _verify(slot, kind.slots, cells)
        at += slot.most_bytes
    return values


def _signed(number: Number, raw: int) -> int:
    raw &= (1 << number.bits) - 1
    return raw - (1 << number.bits) if number.signed and raw >> number.bits - 1 else raw


def _checked(number: Number, raw: int) -> int:
    raw = _signed(number, raw)
    check(number, raw)
    return number.told(raw)


def _decoded_run(kind: Run, data: bytes, number: int) -> Raw:
    if kind.item and kind.packed:
        most, bits = kind.packed == "most", kind.item.bits
        text = "".join(f"{byte:08b}" if most else f"{byte:08b}"[::-1] for byte in data)
        digits = [text[at : at + bits] for at in range(0, number * bits, bits)]
        return [_checked(kind.item, int(each if most else each[::-1], 2)) for each in digits]
    if kind.item is None:
        if kind.text and any(each > 0x7F for each in data):
            raise Wrong("range", "text")
        while kind.pad and data.endswith(kind.pad):
            data = data[:-1]
        return data[:-1] if kind.end else data
    items = []
    for at in range(0, len(data), kind.step):
        piece = data[at : at + kind.step]
        if stray(kind.item.pieces, piece):
            raise Wrong("range", "item")
        items.append(_checked(kind.item, _get(kind.item, piece)))
    return items


def _cut(message: Message, payload: bytes) -> list[tuple[Slot, bytes, int | None]]:
    """The bytes of each field."""
    cut: list[tuple[Slot, bytes, int | None]] = []
    counted: dict[str, int] = {}
    at = 0
    for index, slot in enumerate(message.slots):
        size = _size(slot, counted)
        if size is None:
            size = len(payload) - at - _behind(message.slots[index + 1 :], counted)
            _demand(slot.kind, size)
        data = payload[at : at + size]
        if len(data) < size or size < 0:
            raise Wrong("length", slot.name)
        if slot.counts:
            _note(message.slots, slot, data, counted)
        cut.append((slot, data, counted.get(slot.name)))
        at += size
    if at != len(payload):
        raise Wrong("length", "bytes are left")
    return cut


def _size(slot: Slot, counted: Mapping[str, int]) -> int | None:
    kind = slot.kind
    if not isinstance(kind, Run | Records):
        return size_of(kind)
    if slot.name in counted:
        return kind.bytes_of(counted[slot.name])
    return kind.bytes_of(kind.most) if slot.fixed else None


def _behind(slots: Sequence[Slot], counted: Mapping[str, int]) -> int:
    """Number of bytes after an uncounted field."""
    sizes = [_size(slot, counted) for slot in slots]
    return sum(size for size in sizes if size is not None)


def _demand(kind: Kind, size: int) -> None:
    assert isinstance(kind, Run | Records)
    if size < 0 or size % kind.step or not kind.low <= size // kind.step <= kind.most:
        raise Wrong("length", "the rest")


def _note(slots: Sequence[Slot], slot: Slot, data: bytes, counted: dict[str, int]) -> None:
    """Read a count; a second one must agree."""
    assert isinstance(slot.kind, Number)
    raw = get(slot.kind.pieces, data)
    run = next(each.kind for each in slots if each.name == slot.counts)
    if isinstance(run, Run) and run.packed and slot.counts_in == "bytes" and slot.counts in counted:
        if raw * slot.scale != run.bytes_of(counted[slot.counts]) + slot.more:
            raise Wrong("length", "counts differ")
        return
    items = items_of(slots, slot, raw)
    if counted.setdefault(slot.counts, items) != items:
        raise Wrong("length", "counts differ")


def items_of(slots: Sequence[Slot], slot: Slot, raw: int) -> int:
    """The number of items from a count. Raises Wrong if it is illegal for the field."""
    kind = next(each.kind for each in slots if each.name == slot.counts)
    assert isinstance(kind, Run | Records)
    raw = raw * slot.scale - slot.more
    if kind.packed and slot.counts_in == "bytes":
        if not kind.low <= kind.items_in(raw) <= kind.most:
            raise Wrong("length", f"count {raw}")
        return kind.items_in(raw)
    unit = kind.step if slot.counts_in == "bytes" else 1
    if raw % unit or not kind.low <= raw // unit <= kind.most:
        raise Wrong("length", f"count {raw}")
    return raw // unit
