"""Message ids of several lengths, with which payloads begin."""

from __future__ import annotations

from collections.abc import Iterable

from qlinkgen._dataclass import dataclass
from qlinkgen.model.message import Message


@dataclass(frozen=True)
class TextIds:
    """The ids of the messages of a direction.

    Attributes:
        numbers: each with its number in generated code, the longest first.
        folded: letters of either case are received; those of the ids are capital then.
    """

    numbers: tuple[tuple[bytes, int], ...]
    folded: bool = False

    def number(self, payload: bytes) -> int | None:
        """The number of the longest id that a payload begins with, None if it begins with none."""
        payload = payload.upper() if self.folded else payload
        return next((number for text, number in self.numbers if payload.startswith(text)), None)


def text_ids(messages: Iterable[Message]) -> TextIds | None:
    """The ids of messages, None if other parts of their frames hold these."""
    known = [(each, each.text) for each in messages if each.text is not None]
    folded = any(each.folded for each, _ in known)
    found = {text.upper() if folded else text: each.id for each, text in known}
    ordered = tuple(sorted(found.items(), key=lambda each: (-len(each[0]), each[0])))
    return TextIds(ordered, folded) if found else None
