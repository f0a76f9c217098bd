"""Message ids of several lengths, with which payloads begin."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from qlinkgen.model.message import Message


@dataclass(frozen=True)
class TextIds:
    """The ids of the messages of a direction.

    Attributes:
        numbers: each with its number in generated code, the longest first.
    """

    numbers: tuple[tuple[bytes, int], ...]

    def number(self, payload: bytes) -> int | None:
        """The number of the longest id that a payload begins with, None if it begins with none."""
        return next((number for text, number in self.numbers if payload.startswith(text)), None)


def text_ids(messages: Iterable[Message]) -> TextIds | None:
    """The ids of messages, None if other parts of their frames hold these."""
    found = {each.text: each.id for each in messages if each.text is not None}
    return TextIds(tuple(sorted(found.items(), key=lambda each: (-len(each[0]), each[0])))) if found else None
