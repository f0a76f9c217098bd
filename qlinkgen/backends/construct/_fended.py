"""Kinds of frame that a terminator ends."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from ._ended import Coding, EndedFrame
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
        self.by_id = {each.id - base: each for each in self.by_name.values()}
        self.base = base
