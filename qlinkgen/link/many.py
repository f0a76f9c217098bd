"""Several answers to one request."""

from __future__ import annotations

from qlinkgen.link.codec import Framed, Many


class Answers:
    """The answers so far.

    Attributes:
        items: the answers, oldest first.
    """

    __slots__ = ("_last", "_many", "items")

    def __init__(self, many: Many, request: Framed) -> None:
        self._many = many
        #: Number of answers, 0 if something else ends them.
        self._last = int(getattr(request, many.counted_by)) if many.counted_by else many.count
        self.items: list[Framed] = []

    @property
    def timed(self) -> bool:
        """Whether a time ends them."""
        return self._many.within is not None

    def take(self, answer: Framed) -> bool:
        """Add an answer; return whether it is the last one."""
        self.items.append(answer)
        if self._many.until is not None:
            name, first, last = self._many.until
            return first <= int(getattr(answer, name)) <= last
        return len(self.items) == self._last

    def ended_by(self, reply: Framed) -> bool:
        """Whether a reply follows the last answer."""
        return type(reply) is self._many.reply
