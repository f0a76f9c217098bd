"""Records: fields of fixed size that are a value of a Message, alone or as items of an ArrayField."""

from __future__ import annotations

from collections.abc import Mapping
from typing import BinaryIO

from construct import Container, Renamed, ValidationError

from ._fields import Message, Values


class Record(Message):
    """A record: its name and its fields."""

    def __init__(self, name: str, *fields: Renamed) -> None:
        super().__init__(name, 0, *fields)

    def _sizeof(self, context: Container, path: str) -> int:
        return self.least

    def _build(
        self, obj: Values, stream: BinaryIO, context: Container, path: str
    ) -> Values:
        if not isinstance(obj, Mapping):
            raise ValidationError(f"{obj!r} is not a record {self.name}", path=path)
        return super()._build(obj, stream, context, path)
