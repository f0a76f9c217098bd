"""Kinds of frame that a terminator ends, or that are coded."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from ._ended import Bytewise, CodedFrame, Coding, EndedFrame
from ._fields import Message
from ._frames import Part
from ._kinds import AnyKind


class EndedKind(AnyKind, EndedFrame):
    """A kind of frame that a terminator ends."""

    def __init__(
        self,
        parts: Sequence[Part],
        messages: Iterable[Message],
        *,
        end: str,
        most: int,
        over: Sequence[str],
        coding: Sequence[Coding] = (),
        paired: bool = False,
        base: int = 0,
        least: int = 0,
        address: str = "",
    ) -> None:
        super().__init__(
            parts,
            messages,
            address=address,
            end=end,
            most=most,
            over=over,
            coding=coding,
            paired=paired,
            least=least,
        )
        self._told(base, least, ())


class CodedKind(AnyKind, CodedFrame):
    """A kind of frame that is decoded as it is read."""

    def __init__(
        self,
        parts: Sequence[Part],
        messages: Iterable[Message],
        *,
        coding: Bytewise,
        over: Sequence[str],
        base: int = 0,
        least: int = 0,
        address: str = "",
        starts: Sequence[bytes] = (),
    ) -> None:
        super().__init__(parts, messages, address=address, coding=coding, over=over)
        self._told(base, least, starts)
