"""Numbers frames with the counter that they have."""

from __future__ import annotations

from qlinkgen.link.codec import Codec, Message


class Numbering:
    """The counter of one sender.

    Attributes:
        per_frame: every frame has a number of its own, repeats included.
    """

    def __init__(self, name: str, modulus: int, *, per_frame: bool, echo: bool) -> None:
        """``name`` is the attribute of messages; ``echo``: answers repeat the number of their request."""
        self._name = name
        self._modulus = modulus
        self._echo = echo
        self._next = 0
        self.per_frame = per_frame

    def number(self, message: Message) -> None:
        """Give a message the next number, if its frame has one."""
        if not _is_counted(message):
            return
        setattr(message, self._name, self._next)
        self._next = (self._next + 1) % self._modulus

    def answer(self, request: Message, response: Message) -> None:
        """Number an answer, if the protocol says how."""
        if self._echo and _is_counted(request) and _is_counted(response):
            setattr(response, self._name, getattr(request, self._name))
        elif self.per_frame:
            self.number(response)


def _is_counted(message: Message) -> bool:
    """Whether the frame of a message has a counter: some kinds of frame may have none."""
    return getattr(message, "COUNTER", None) is not None


def numbering_of(codec: Codec) -> Numbering | None:
    """The counter of the frames of a protocol, None if they have none."""
    counters = (getattr(command.request, "COUNTER", None) for command in codec.COMMANDS.values())
    found: tuple[str, int, bool, bool] | None = next((each for each in counters if each), None)
    if found is None:
        return None
    name, modulus, per_frame, echo = found
    return Numbering(name, modulus, per_frame=per_frame, echo=echo)
