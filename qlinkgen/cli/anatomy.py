"""What `explain` finds out: a row for each run of wire bytes, and findings on what is wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from qlinkgen.cli.describe import number_text
from qlinkgen.model.message import Field, Message
from qlinkgen.model.types import Array, Bits, Blob, Enum, Flags, Scalar
from qlinkgen.model.values import native_from_raw


@dataclass(frozen=True, slots=True)
class Byte:
    """A byte of a frame and where it stood on the wire."""

    offset: int
    value: int


@dataclass(frozen=True, slots=True)
class Row:
    """What a run of bytes is. Without bytes of its own it stands behind the byte at ``offset``."""

    data: tuple[Byte, ...]
    part: str
    value: str = ""
    wrong: bool = False
    offset: int = 0

    def lines(self) -> list[tuple[int, str, str, str, bool]]:
        """A line for each byte: offset, hex, part, value (beside the first), whether it is marked."""
        if not self.data:
            return [(self.offset, "", self.part, self.value, self.wrong)]
        values = [self.value, *("" for _ in self.data[1:])]
        pairs = zip(self.data, values, strict=True)
        return [(byte.offset, f"{byte.value:02x}", self.part, value, self.wrong) for byte, value in pairs]


@dataclass(frozen=True, slots=True)
class Finding:
    """Something wrong: the rule that broke with what was seen, and what most likely caused it."""

    rule: str
    cause: str = ""


@dataclass
class Anatomy:
    """All that is known about the bytes."""

    title: str = ""
    rows: list[Row] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def row(self, data: Sequence[Byte], part: str, value: str = "", *, wrong: bool = False) -> None:
        """Add a line for bytes that belong together."""
        if data:
            self.rows.append(Row(tuple(data), part, value, wrong))

    def lines(self) -> list[tuple[int, str, str, str, bool]]:
        """All lines of the table, by offset."""
        return sorted((line for row in self.rows for line in row.lines()), key=lambda line: line[0])

    def wrong(self, rule: str, cause: str = "") -> None:
        """Add a finding, unless it is there already."""
        finding = Finding(rule, cause)
        if finding not in self.findings:
            self.findings.append(finding)


def raw_of(data: Sequence[Byte]) -> bytes:
    """The bytes without their places."""
    return bytes(byte.value for byte in data)


def counted(number: int) -> str:
    """``1 byte``, ``2 bytes``."""
    return f"{number} byte{'' if number == 1 else 's'}"


def at(data: bytes, start: int = 0) -> list[Byte]:
    """Bytes with their places."""
    return [Byte(start + index, value) for index, value in enumerate(data)]


def unpack(scalar: Scalar, raw: bytes) -> int:
    """The integer in its wire bytes."""
    bits = zip(raw, scalar.chunks, strict=False)
    value = sum((byte & chunk.mask) << chunk.shift for byte, chunk in bits)
    return value - (1 << scalar.bits) if scalar.signed and value > scalar.natural_maximum else value


def scalar_text(scalar: Scalar, raw: int) -> str:
    """A value for people: its number in the unit, its name, or the names of its bits."""
    if isinstance(scalar.meaning, Enum):
        return f"{scalar.meaning.name_of(raw) or 'no name'} ({raw})"
    if isinstance(scalar.meaning, Flags):
        names = [member.name for member in scalar.meaning.members if raw >> member.value & 1]
        return f"0x{raw:0{(scalar.bits + 3) // 4}X} ({' | '.join(names) or 'none set'})"
    native = native_from_raw(scalar, raw)
    shown = str(native).lower() if isinstance(native, bool) else number_text(native)  # type: ignore[arg-type]
    unit = f" {scalar.unit}" if scalar.unit else ""
    return f"{shown}{unit}" + (f" (raw {raw})" if scalar.scaling else "")


class PayloadReader:
    """Puts the bytes of a payload to the fields of a message."""

    def __init__(self, anatomy: Anatomy, message: Message) -> None:
        """Add rows and findings to ``anatomy``."""
        self._anatomy = anatomy
        self._message = message
        self._counts: dict[str, int] = {}

    def read(self, payload: Sequence[Byte]) -> None:
        """One row a field; what is too short or too much is a finding."""
        message, rest = self._message, list(payload)
        if not rest and message.empty_is_default:
            self._anatomy.notes.append("a payload of no bytes stands for every default")
            return
        behind = sum(field.min_size for field in message.fields)
        for each in message.fields:
            behind -= each.min_size
            size = self._size(each, len(rest) - behind)
            self._field(each, rest[:size])
            rest = rest[size:]
        self._anatomy.row(rest, "(behind the last field)", "belongs to no field", wrong=True)

    def _size(self, each: Field, available: int) -> int:
        if each.fixed:
            return each.max_size
        assert isinstance(each.type, Blob | Array)
        counted = self._counts.get(each.name)
        return max(0, available) if counted is None else counted

    def _field(self, each: Field, data: Sequence[Byte]) -> None:
        if len(data) < each.min_size:
            text = f"{len(data)} of {each.min_size} bytes are there"
            self._anatomy.row(data, each.name, text, wrong=True)
            return
        if isinstance(each.type, Scalar):
            self._scalar(each.name, each.type, data)
        elif isinstance(each.type, Bits):
            self._bits(each.name, each.type, data)
        else:
            self._anatomy.row(data, each.name, _run_text(each.type, raw_of(data)))

    def _scalar(self, name: str, scalar: Scalar, data: Sequence[Byte]) -> None:
        raw = unpack(scalar, raw_of(data))
        fine = self._check(name, scalar, raw)
        self._anatomy.row(data, name, scalar_text(scalar, raw), wrong=not fine)
        if scalar.counts:
            target = next(each.type for each in self._message.fields if each.name == scalar.counts)
            item = target.item_size if isinstance(target, Array) and scalar.counts_unit == "items" else 1
            self._counts[scalar.counts] = raw * item

    def _bits(self, name: str, bits: Bits, data: Sequence[Byte]) -> None:
        whole = unpack(bits.container, raw_of(data))
        self._anatomy.row(data, name, f"0x{whole:0{2 * bits.size}X}")
        for member in bits.members:
            raw = whole >> member.shift & ((1 << member.type.bits) - 1)
            raw -= (1 << member.type.bits) if member.type.signed and raw > member.type.natural_maximum else 0
            fine = self._check(member.name, member.type, raw)
            text = scalar_text(member.type, raw)
            self._anatomy.rows.append(Row((), f"  .{member.name}", text, not fine, data[-1].offset))

    def _check(self, name: str, scalar: Scalar, raw: int) -> bool:
        if scalar.reserved:
            return True
        if scalar.constant and raw != scalar.default:
            self._anatomy.wrong(
                f"{name} is {raw}, but is always {scalar.default}",
                "another message or revision of the protocol",
            )
            return False
        low, high = scalar.minimum, scalar.maximum
        if not scalar.constant and not low <= raw <= high:
            shown = scalar_text(scalar, raw)
            limits = f"{number_text(scalar.physical(low))}..{number_text(scalar.physical(high))}"
            self._anatomy.wrong(
                f"{name} is {shown}, allowed are {limits}", "the sender does not keep the range"
            )
            return False
        return True


def _run_text(kind: Blob | Array, raw: bytes) -> str:
    if isinstance(kind, Blob):
        return repr(raw.decode("ascii", "backslashreplace")) if kind.text else f"{len(raw)} bytes"
    size = kind.item_size
    items = [unpack(kind.item, raw[index : index + size]) for index in range(0, len(raw) - size + 1, size)]
    return ", ".join(map(str, items)) or "none"


def nearest_id(wanted: int, messages: Sequence[Message]) -> Message | None:
    """The known message whose id differs in the fewest bits."""

    def distance(message: Message) -> Any:
        return (message.id ^ wanted).bit_count(), abs(message.id - wanted), message.id

    return min(messages, key=distance, default=None)
