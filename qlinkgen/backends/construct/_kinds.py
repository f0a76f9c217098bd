"""Several kinds of frame, told apart by the constants that they begin with."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import BinaryIO

from construct import Construct, Container

from ._fields import Message, Values
from ._frames import (
    Constant,
    DelimitedFrame,
    Frame,
    FrameError,
    Part,
    Sending,
    Stuffing,
)


class AnyKind(Frame):
    """A kind of frame: ``base`` is what ids have more than the number in the frame.

    Its payloads have at least ``least`` bytes.
    """

    base = 0
    least = 0
    #: The message ids that its frames begin with, () if a constant begins them.
    starts: Sequence[bytes] = ()

    def begins(self, wire: bytes) -> bool:
        """Whether one of its frames may begin with the first of these bytes."""
        first = self.parts[0]
        starts = [first.data] if isinstance(first, Constant) else self.starts
        return any(each.startswith(wire[: len(each)]) for each in starts)

    def _told(self, base: int, least: int, starts: Sequence[bytes]) -> None:
        """Set the attributes."""
        self.base, self.least, self.starts = base, least, starts
        self.by_id = {each.id - base: each for each in self.by_name.values()}

    def _number(self, message: Message) -> int:
        return message.id - self.base

    def holds(self, message: Message, size: int) -> bool:
        """Whether it carries the message with a payload of a size."""
        return message.name in self.by_name and self.least <= size <= self.payload.most


class Kind(AnyKind, DelimitedFrame):
    """A kind of frame whose end follows from a length or from its message."""

    def __init__(
        self,
        parts: Sequence[Part],
        messages: Iterable[Message],
        *,
        base: int = 0,
        least: int = 0,
        address: str = "",
        starts: Sequence[bytes] = (),
        stuffing: Stuffing | None = None,
    ) -> None:
        super().__init__(parts, messages, address=address, stuffing=stuffing)
        self._told(base, least, starts)


class Kinds(Frame):
    """One frame of several kinds, the shortest one that carries the message and has room for its payload."""

    def __init__(self, *kinds: AnyKind) -> None:
        Construct.__init__(self)
        self.kinds = kinds
        self.by_name = {
            name: message for kind in kinds for name, message in kind.by_name.items()
        }

    def kind_of(self, message: Message, size: int) -> AnyKind:
        """The kind of frame for a payload of a size, or else the longest that carries the message."""
        carrying = [kind for kind in self.kinds if message.name in kind.by_name]
        return next(
            (kind for kind in carrying if kind.holds(message, size)), carrying[-1]
        )

    def _wrap(self, sending: Sending) -> bytes:
        return self.kind_of(sending.message, len(sending.payload))._wrap(sending)

    def _build(
        self, obj: Values, stream: BinaryIO, context: Container, path: str
    ) -> Values:
        message = self._named(obj, path)
        payload = message.build(obj.get("fields") or {})
        kind = self.kind_of(message, len(payload))
        return kind._build(obj, stream, context, path)  # its kind

    def _frame(self, wire: bytes, request: bytes) -> Container:
        for kind in self.kinds:
            if kind.begins(wire):
                return kind._frame(wire, request)
        raise FrameError("frame", f"no kind of frame begins with {wire[:1].hex()}")


class Turned(Frame):
    """Messages that only their turn in a dialogue tells: the frame of each is its payload."""

    def __init__(self, *messages: Message) -> None:
        Construct.__init__(self)
        self.by_name = {each.name: each for each in messages}
