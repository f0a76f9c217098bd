"""The last answer of a slave, which it sends once more if the counter tells that a request is repeated."""

from __future__ import annotations

from collections.abc import Sequence

from qlinkgen.link.codec import Codec, Message

#: Class of a request, its number, and that of its master.
_Mark = tuple[type[Message], int, int]


class KeptAnswer:
    """The frames that answered the last counted request."""

    __slots__ = ("_frames", "_mark", "_master", "_name")

    def __init__(self, name: str, master: str) -> None:
        """``name`` is the attribute with the counter, ``master`` that of the master, "" without one."""
        self._name = name
        self._master = master
        self._mark: _Mark | None = None
        self._frames: tuple[bytes, ...] = ()

    def again(self, request: Message) -> Sequence[bytes]:
        """Return the answer to the request before if this one is its repeat, otherwise nothing."""
        return self._frames if self._frames and self._mark == self._of(request) else ()

    def heard(self, request: Message) -> None:
        """Note a request to this node that is handled; it may let the counter of its master begin anew."""
        mark = self._of(request)
        if mark is not None or getattr(request, "RESTART", None) is not None:
            self._mark, self._frames = mark, ()

    def told(self, request: Message) -> None:
        """Note a broadcast, which may let the counter begin anew."""
        if getattr(request, "RESTART", None) is not None:
            self._mark, self._frames = None, ()

    def answered(self, request: Message, frames: Sequence[bytes]) -> None:
        """Keep the answer to a request."""
        if self._mark is not None and self._mark == self._of(request):
            self._frames = tuple(frames)

    def _of(self, request: Message) -> _Mark | None:
        if not getattr(request, "KEPT", False):
            return None
        master = getattr(request, self._master, 0) if self._master else 0
        return type(request), getattr(request, self._name), master


def kept_of(codec: Codec) -> KeptAnswer | None:
    """The last answer of a slave of a protocol, None if it handles repeats."""
    requests = [command.request for command in codec.COMMANDS.values()]
    kept = next((each for each in requests if getattr(each, "KEPT", False)), None)
    if kept is None:
        return None
    counter: tuple[str, int, bool, bool] = getattr(kept, "COUNTER", ("", 0, False, False))
    master: tuple[str, int] = getattr(kept, "MASTER", None) or ("", 0)
    return KeptAnswer(counter[0], master[0])
