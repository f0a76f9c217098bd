"""Numbers of a payload that follow from earlier bytes: check values, and numbers derived from others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from io import BytesIO
from typing import BinaryIO, NamedTuple, Protocol

from construct import (
    Construct,
    Container,
    Renamed,
    Subconstruct,
    ValidationError,
    stream_write,
)

from ._fields import Groups, Message, Values
from ._frames import FrameError
from ._frecords import Record
from ._ftrimmed import Trimmed
from ._fvaried import Varied, VariedRecord
from ._fwalks import Walked


class Rule(Protocol):
    """How a number follows from bytes."""

    def compute(self, data: bytes, /) -> int:
        """The number for some bytes."""


class EqualTo(NamedTuple):
    """A number derived from another one: inverted or not, plus ``added``."""

    integer: Construct
    inverted: bool = False
    added: int = 0

    def compute(self, data: bytes) -> int:
        """The number for the bytes of the other one, of which it has the lowest bits."""
        kind = self.integer
        number = kind.number(data) if isinstance(kind, Groups) else kind.parse(data)
        return int((~number if self.inverted else number) + self.added)


class Filled(Subconstruct):
    """A number of ``bits`` bits that follows from the bytes of the fields ``over``, which it comes after."""

    def __init__(
        self, subcon: Construct, bits: int, over: Sequence[str], rule: Rule
    ) -> None:
        super().__init__(subcon)
        self.mask = (1 << bits) - 1
        self.over = over
        self.rule = rule
        self.flagbuildnone = True

    def _build(
        self, obj: object, stream: BinaryIO, context: Container, path: str
    ) -> object:
        return self.subcon._build(0, stream, context, path)  # its place, see `right`

    def right(self, cells: Mapping[str, bytes]) -> bytes:
        """Its bytes for those of other fields."""
        data = b"".join(cells[name] for name in self.over)
        return bytes(self.subcon.build(self.rule.compute(data) & self.mask))

    def verify(
        self, field: Renamed, cell: bytes, cells: Mapping[str, bytes], path: str
    ) -> None:
        """Compare its bytes with what they must be."""
        if cell == (right := self.right(cells)):
            return
        text = f"{field.name} is {cell.hex()}, expected {right.hex()}"
        if isinstance(self.rule, EqualTo):
            raise ValidationError(text, path=path)
        raise FrameError("crc", text)


class _Verified(Renamed):
    """A number in a payload: its bytes are compared when they are parsed."""

    def __init__(self, field: Renamed, cells: Mapping[str, bytes]) -> None:
        super().__init__(field.subcon, field.name)
        self.cells = cells

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> object:
        cell = self.cells[self.name]
        self.subcon.verify(self, cell, self.cells, path)
        return super()._parse(stream, context, path)


class FilledMessage(Message):
    """A message of which some numbers follow from other bytes."""

    def _cells(self, data: bytes, path: str) -> list[tuple[Renamed, bytes, int | None]]:
        found = super()._cells(data, path)
        cells = {field.name: cell for field, cell, _ in found}
        return [
            (
                _Verified(field, cells) if isinstance(field.subcon, Filled) else field,
                cell,
                number,
            )
            for field, cell, number in found
        ]

    def _build(
        self, obj: Values, stream: BinaryIO, context: Container, path: str
    ) -> Values:
        whole = BytesIO()
        super()._build(obj, whole, context, path)
        cells: dict[str, bytes] = {}
        for field, cell, _ in super()._cells(whole.getvalue(), path):
            filled = isinstance(field.subcon, Filled)
            cells[field.name] = field.subcon.right(cells) if filled else cell
        data = b"".join(cells.values())
        stream_write(stream, data, len(data), path)
        return obj


class FilledTrimmed(Trimmed, FilledMessage):
    """A message of constant size whose zeros at the end are not sent."""


class FilledRecord(Record, FilledMessage):
    """A record of constant size."""


class FilledWalked(Walked):
    """A message in which fields may be absent."""

    def _follow(
        self, field: Renamed, cell: bytes, cells: Mapping[str, bytes], path: str
    ) -> None:
        if isinstance(field.subcon, Filled):
            field.subcon.verify(field, cell, cells, path)

    def _filled(self, field: Renamed, cell: bytes, cells: Mapping[str, bytes]) -> bytes:
        is_filled = isinstance(field.subcon, Filled)
        return bytes(field.subcon.right(cells)) if is_filled else cell


class FilledVaried(Varied, FilledWalked):
    """A message with records that are read one by one."""


class FilledVariedRecord(VariedRecord, FilledVaried):
    """A record of variable size, or one that can be the last one."""
