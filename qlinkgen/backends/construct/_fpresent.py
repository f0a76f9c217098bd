"""Kinds of frame with parts that only some of them have."""

from __future__ import annotations

from collections.abc import Sequence

from ._fconditional import ConditionalFrame, Present
from ._fields import Message
from ._frames import Part
from ._kinds import AnyKind


class ConditionalKind(AnyKind, ConditionalFrame):
    """A kind of frame with parts that only some of them have."""

    def __init__(
        self,
        parts: Sequence[Part],
        messages: Sequence[Message],
        *,
        present: Sequence[Present],
        base: int = 0,
        least: int = 0,
        address: str = "",
        starts: Sequence[bytes] = (),
    ) -> None:
        super().__init__(parts, messages, present=present, address=address)
        self._told(base, least, starts)
