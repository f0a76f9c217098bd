"""Whoever knows the bytes, and what it made of one choice of values."""

from __future__ import annotations

import typing
from collections.abc import Mapping
from dataclasses import dataclass

from qlinkgen.backends.vectors.choice import Raw
from qlinkgen.model.message import Message
from qlinkgen.model.values import Native


class Reference(typing.Protocol):
    """Knows the bytes of a protocol's messages; vectors only choose the values."""

    def payload(self, message: str, fields: Mapping[str, Native]) -> bytes:
        """The payload of a message (full name) with all its values."""
        ...

    def seal(
        self, message: str, payload: bytes, address: int = 0, request: bytes = b"", number: int | None = None
    ) -> bytes:
        """The frame of a payload that may be wrong, right in all else.

        ``request`` are the bytes of the packet that is answered; ``number`` replaces the message id.
        """
        ...


@dataclass(frozen=True, slots=True)
class Good:
    """A frame as it should be."""

    message: Message
    address: int | None
    values: Mapping[str, Raw]
    payload: bytes
    wire: bytes
    #: The packet that it answers, where frames are packets.
    request: bytes = b""
