"""Makes the fields of a message of rows: places, types, bits."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from qlinkgen.importers import cells
from qlinkgen.importers.document import Field, Value
from qlinkgen.importers.names import Names
from qlinkgen.importers.notes import Notes
from qlinkgen.importers.table.columns import Record
from qlinkgen.importers.table.enums import Enums
from qlinkgen.importers.table.kinds import Kind, kind
from qlinkgen.importers.table.values import Values, limits

_SPARE = re.compile(r"(?:reserved|rsvd|spare|unused|padding|pad|not_used|dummy|n_a|rfu)_?\d*")
_BYTE_BIT = re.compile(r"(\d{1,5})\s*[.:]\s*([0-7])")
_MOST = 65535
#: More reserved bytes than these are a byte string.
_MOST_RESERVED = 32


@dataclass(frozen=True, slots=True)
class Place:
    """Where a row says that its field begins, and how many bytes it has if the offset is a range.

    Attributes:
        byte: Offset in bytes as written, None if the row does not say.
        bits: First and last bit of a bit field, None for whole bytes.
        size: Bytes, 0 if the offset does not say.
    """

    byte: int | None
    bits: tuple[int, int] | None
    size: int = 0


def place(record: Record, in_bits: frozenset[str]) -> Place:
    """The place that a row states."""
    text = record.get("offset")
    bits = None if cells.is_nothing(record.get("bit")) else cells.bit_range(record.get("bit"))
    if found := _BYTE_BIT.fullmatch(text):
        return Place(int(found[1]), bits or (int(found[2]), int(found[2])))
    if "offset" in in_bits and (at := cells.integer(text)) is not None:
        width = cells.integer(record.get("size")) or 8
        whole = at % 8 == 0 and width % 8 == 0
        return Place(at // 8, bits or (None if whole else (at % 8, at % 8 + width - 1)))
    if (span := cells.bounds(text)) is not None and all(each.denominator == 1 and each >= 0 for each in span):
        return Place(int(span[0]), bits, int(span[1] - span[0]) + 1)
    return Place(cells.integer(text), bits)


@dataclass
class _Bits:
    """An integer whose bits have names."""

    name: str
    line: int
    size: int
    doc: str = ""
    fixed: bool = False
    found: dict[str, Value] = field(default_factory=dict)
    used: set[int] = field(default_factory=set)


class Layout:
    """Lays out the rows of one message.

    Args:
        message: Name of the message, for enums and notes.
        start: Offset of the first byte of the payload as written in the table.
        in_bits: Keys whose column is in bits.
        order: Byte order of the schema.
    """

    def __init__(
        self, message: str, notes: Notes, enums: Enums, *, start: int, in_bits: frozenset[str], order: str
    ) -> None:
        self._message = message
        self._notes = notes
        self._start = start
        self._in_bits = in_bits
        self._names = Names(notes, "field")
        self._values = Values(message, notes, enums, order)
        self._fields: list[Field] = []
        self._at = 0
        self._gaps = 0
        self._bits: _Bits | None = None
        self._open = ""
        self._single = 0
        self._full = False

    @property
    def size(self) -> int:
        """Bytes so far."""
        return self._at

    @property
    def open(self) -> bool:
        """Whether a field takes the rest of the message."""
        return bool(self._open) and not self._full

    def fields(self, records: Sequence[Record]) -> tuple[Field, ...]:
        """The fields of the rows, in wire order."""
        places = [place(each, self._in_bits) for each in records]
        order = list(range(len(records)))
        # A table of places like 0, 1-4, 5 needs no sizes.
        self._single = 1 if any(each.size for each in places) else 0
        if all(each.byte is not None for each in places):
            order.sort(key=lambda at: places[at].byte or 0)
        for at in order:
            self._row(records[at], places[at])
        self._end_bits()
        return tuple(self._fields)

    def _row(self, record: Record, where: Place) -> None:
        if not record.get("name"):
            self._notes.add(record.line, "a row without the name of a field is left out")
            return
        if where.bits is not None:
            self._bit(record, where, *where.bits)
            return
        found = kind(record.get("type"))
        if found is None:
            self._leave_out(record, f"the type '{record.get('type')[:40]}' is not known")
            return
        self._end_bits()
        self._field(record, where, found)

    def _leave_out(self, record: Record, reason: str) -> None:
        self._notes.add(record.line, f"field '{record.get('name')[:40]}' is left out: {reason}")

    # Places ---------------------------------------------------------------------------------------------

    def _reach(self, record: Record, byte: int | None) -> bool:
        """Go to the place of a row; report a gap or an overlap."""
        if self._full:
            return False
        if self._open:
            self._leave_out(record, f"{self._open} before it takes the rest of the message")
            return False
        if byte is None:
            return True
        gap = byte - self._start - self._at
        if gap < 0:
            self._leave_out(
                record,
                f"offset {byte} lies inside the fields before it, which end at {self._at + self._start}",
            )
            return False
        if self._at + gap > _MOST:
            self._leave_out(record, f"offset {byte} is beyond a payload of {_MOST} bytes")
            return False
        if gap:
            bytes_, verb = ("byte", "is") if gap == 1 else ("bytes", "are")
            self._notes.add(
                record.line,
                f"{gap} {bytes_} before '{record.get('name')[:40]}' {verb} not described: reserved",
            )
            self._gaps += 1
            name = "gap" if self._gaps == 1 else f"gap_{self._gaps}"
            self._reserve(self._names.take(name, record.line), gap, record.line, "")
        return True

    def _reserve(self, name: str, size: int, line: int, doc: str) -> None:
        """Add reserved bytes, in several integers if there are many."""
        self._at += size
        if size > _MOST_RESERVED:
            self._fields.append(Field(name, f"bytes[{size}]", line, {}, doc))
            return
        for number, at in enumerate(range(0, size, 8)):
            called = self._names.take(f"{name}_{number + 1}", line) if number else name
            type_ = f"u{8 * min(size - at, 8)}"
            self._fields.append(Field(called, type_, line, {"reserved": True}, doc))

    # Fields ---------------------------------------------------------------------------------------------

    def _field(self, record: Record, where: Place, found: Kind) -> None:
        sized = self._sized(record, where, found)
        if isinstance(sized, str):
            self._leave_out(record, sized)
            return
        total = sized.size * (1 if sized.count is None else sized.count)
        if total > _MOST:
            self._leave_out(record, f"{total} bytes are more than a payload can have")
            return
        if not self._reach(record, where.byte):
            return
        if self._at + total > _MOST:
            self._leave_out(
                record, f"with it the message has more than {_MOST} bytes, and so with all after it"
            )
            self._open = record.get("name")
            self._full = True
            return
        line = record.line
        name = self._names.take(record.get("name"), line)
        if _SPARE.fullmatch(name) and total and sized.base in ("u", "i", "bytes"):
            self._reserve(name, total, record.line, record.get("doc"))
            return
        type_ = _spelt(sized)
        type_, keys = self._values.keys(record, sized, type_, name)
        self._fields.append(Field(name, type_, line, keys, record.get("doc")))
        self._at += total
        if sized.count == 0:
            self._open = name

    def _sized(self, record: Record, where: Place, found: Kind) -> Kind | str:
        """The type with its size and number of items; the reason if they do not agree."""
        count = cells.integer(record.get("count")) if "count" in record.values else found.count
        total = self._total(record, found, count) or where.size
        if not total and where.byte is not None and not record.get("type") and not record.get("size"):
            total = self._single
        if found.base in ("text", "bytes"):
            return Kind(found.base, 1, count or total or 0, found.order)
        size = found.size
        if size == 0:
            if total <= 0:
                return "its size is not stated"
            if count and total % count:
                return f"{total} bytes are not a multiple of {count} items"
            size = total // (count or 1)
            if size > 8:
                return Kind("bytes", 1, total)
            return Kind(found.base, size, count, found.order)
        if total and count is None and total % size == 0 and total > size:
            return Kind(found.base, size, total // size, found.order)
        if total and count is not None and count > 0 and total != size * count and total != size:
            return f"{count} items of {size} bytes are not {total} bytes"
        if total and count is None and total != size:
            return f"its type has {size} bytes, its size is {total}"
        return Kind(found.base, size, count, found.order)

    def _total(self, record: Record, found: Kind, count: int | None) -> int:
        """Size in bytes, 0 if it is not stated."""
        text = record.get("size")
        size = cells.integer(text)
        if size is None or size < 0:
            return 0
        items = found.size * (count or 1)
        bits = "bit" in text.lower() or "size" in self._in_bits
        if bits or (found.size and size == 8 * items):
            return size // 8 if size % 8 == 0 else 0
        return size

    # Bits -----------------------------------------------------------------------------------------------

    def _bit(self, record: Record, where: Place, first: int, last: int) -> None:
        byte = where.byte
        if last > 63:
            self._leave_out(record, f"bit {last} is not inside 64 bits")
            return
        if not self._continues(byte, last) and not self._begin_bits(record, where, last):
            return
        bits = self._bits
        assert bits is not None
        wanted = set(range(first, last + 1))
        if wanted & bits.used:
            self._leave_out(record, f"bit {min(wanted & bits.used)} has a name already")
            return
        if not bits.fixed:
            self._at += max(0, last // 8 + 1 - bits.size)
            bits.size = max(bits.size, last // 8 + 1)
        bits.used |= wanted
        name = self._names.take(record.get("name"), record.line)
        if not _SPARE.fullmatch(name):
            bits.found[name] = self._values.bit(record, first, last, name)

    def _continues(self, byte: int | None, last: int) -> bool:
        """Whether a bit is one of the integer of the bits before it."""
        bits = self._bits
        if bits is None:
            return False
        begin = self._at - bits.size + self._start
        return (byte is None or byte == begin) and (not bits.fixed or last < 8 * bits.size)

    def _begin_bits(self, record: Record, where: Place, last: int) -> bool:
        """Begin an integer for bits: the field before it if that has no other meaning, else a new one."""
        self._end_bits()
        before = self._fields[-1] if self._fields else None
        whole = limits(before.type) if before is not None and not before.keys else None
        if before is not None and whole is not None and before.type.startswith("u"):
            size = whole[1].bit_length() // 8
            same = where.byte is None or where.byte == self._at - size + self._start
            if same and last < 8 * size:
                self._fields.pop()
                self._bits = _Bits(before.name, before.line, size, before.doc, fixed=True)
                return True
        if not self._reach(record, where.byte):
            return False
        self._bits = _Bits(self._names.take(f"bits_{self._at}", record.line), record.line, 0)
        return True

    def _end_bits(self) -> None:
        bits, self._bits = self._bits, None
        if bits is None:
            return
        type_ = f"u{8 * bits.size}"
        if bits.found:
            self._fields.append(Field(bits.name, type_, bits.line, {"bits": bits.found}, bits.doc))
        else:
            self._fields.append(Field(bits.name, type_, bits.line, {"reserved": True}, bits.doc))


def _spelt(found: Kind) -> str:
    """A type in the schema."""
    base = {"u": f"u{8 * found.size}", "i": f"i{8 * found.size}", "f": f"f{8 * found.size}"}.get(
        found.base, found.base
    )
    if base == "u8" and found.count:
        base = "bytes"
    if found.count is None:
        return base
    if found.base in ("text", "bytes") and not found.count:
        return base
    return f"{base}[{found.count or ''}]"
