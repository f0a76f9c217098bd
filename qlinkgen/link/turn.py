"""Frames that only their turn tells: their bytes go to their message, not to the decoder."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar, NamedTuple, Protocol

from qlinkgen.link.codec import Command, Framed, StepSpan, unproven

if TYPE_CHECKING:
    from typing_extensions import TypeIs


class Misread(NamedTuple):
    """Bytes that are not the message whose turn it was."""

    kind: str
    offset: int
    raw: bytes
    message: str


class Turned(Framed, Protocol):
    """A message that only its turn tells."""

    #: Its bytes without a list whose items an earlier frame counts, and the bits of each of these.
    TURN: ClassVar[tuple[int, int]]

    @classmethod
    def measure_payload(cls, data: bytes, at: int, /) -> int:
        """Return the size as far as counts have been received; the negative end of a wrong count."""
        ...


def is_turned(kind: type[object] | None) -> TypeIs[type[Turned]]:
    """Whether only its turn tells a message."""
    return getattr(kind, "TURN", None) is not None


def steps_of(command: Command) -> Sequence[tuple[str, type[Framed], StepSpan | None]]:
    """The frames after a request, as in `Command.steps`; a response that only its turn tells is one, too."""
    if command.steps or not is_turned(command.response):
        return command.steps
    within = (command.response_byte_times, command.response_seconds)
    return (("receive", command.response, within),)


def has_turns(command: Command) -> bool:
    """Whether only their turn tells some frames of a transaction."""
    return any(is_turned(kind) for _, kind, _ in steps_of(command))


class Collected:
    """The bytes of a message whose turn it is; those after it are ignored."""

    __slots__ = ("_asked", "_command", "_data", "_kind", "_over", "_size")

    def __init__(self, kind: type[Turned], command: Command, asked: Framed) -> None:
        """``asked`` is the last frame that may say the number of its items, as in `wrong_size`."""
        self._kind, self._command, self._asked = kind, command, asked
        fixed, bits = kind.TURN
        #: Its size if an earlier frame says it, otherwise 0.
        self._size = 0
        if bits and type(asked) is command.sized_by:
            self._size = fixed + (bits * getattr(asked, command.sizes[0][1]) + 7) // 8
        self._data = b""
        self._over = False

    def take(self, byte: bytes, wrong: type[Exception]) -> Framed | Misread | None:
        """Take the next byte; return the message, or what is wrong with it, once it is complete.

        ``wrong`` is the error of a decoder.
        """
        if self._over:
            return None
        self._data += byte
        size = self._size or self._kind.measure_payload(self._data, 0)
        if 0 <= size != len(self._data):
            return None
        self._over = True
        if size < 0:
            return Misread("length", 0, self._data, "a count is out of range")
        try:
            message = self._kind.from_bytes(self._data)
        except wrong as error:
            return Misread(getattr(error, "kind", ""), 0, self._data, str(error))
        fault = unproven(self._command, self._asked, message)
        return Misread("crc", 0, self._data, fault) if fault else message
