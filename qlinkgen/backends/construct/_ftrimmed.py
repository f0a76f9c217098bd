"""Messages whose zeros at the end are not sent."""

from __future__ import annotations

from io import BytesIO
from typing import Any, BinaryIO

from construct import Container, Renamed, stream_read_entire, stream_write

from ._fields import Message, Values


class Trimmed(Message):
    """A message of constant size; of zeros at its end only those among its first ``keep`` bytes are sent."""

    def __init__(
        self,
        name: str,
        message_id: int,
        *fields: Renamed,
        keep: int,
        **settings: Any,  # those of a Message
    ) -> None:
        super().__init__(name, message_id, *fields, **settings)
        self.keep = keep

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> Container:
        data = stream_read_entire(stream, path).ljust(self.most, b"\0")
        return super()._parse(BytesIO(data), context, path)

    def _build(
        self, obj: Values, stream: BinaryIO, context: Container, path: str
    ) -> Values:
        whole = BytesIO()
        super()._build(obj, whole, context, path)
        data = whole.getvalue()
        sent = data[: max(len(data.rstrip(b"\0")), self.keep)]
        stream_write(stream, sent, len(sent), path)
        return obj
