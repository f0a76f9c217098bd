"""Values of frames that engines fill: the counter, and those that answers repeat."""

from __future__ import annotations

from collections.abc import Sequence

from qlinkgen.link.codec import Codec, Message, address_of


class Numbering:
    """The counter of one sender: of its requests to each node, or of its frames.

    Attributes:
        per_frame: every frame has a number of its own, repeats included.
    """

    def __init__(
        self,
        name: str,
        modulus: int,
        *,
        per_frame: bool,
        echo: bool,
        first: int = 0,
        broadcast: int | None = None,
    ) -> None:
        """``name`` is the attribute of messages, ``first`` the number of the first request to a node.

        ``echo``: answers repeat the number of their request.
        """
        self._name = name
        self._modulus = modulus
        self._echo = echo
        self._first = first
        self._broadcast = broadcast
        self._next: dict[int | None, int] = {}
        self.per_frame = per_frame

    def number(self, message: Message) -> None:
        """Give a message the next number, if the counter counts it."""
        node = None if self.per_frame else address_of(message)
        if getattr(message, "COUNTER", None) is not None:
            number = self._next.get(node, self._first)
            setattr(message, self._name, number)
            self._next[node] = (number + 1) % self._modulus
        if (restart := getattr(message, "RESTART", None)) is not None:
            if node == self._broadcast:
                self._next.clear()
                self._first = restart
            else:
                self._next[node] = restart

    def answer(self, response: Message) -> None:
        """Number an answer, if the protocol says how; see `repeat` for one that repeats its request."""
        if self.per_frame and not self._echo:
            self.number(response)


def numbering_of(codec: Codec) -> Numbering | None:
    """The counter of the frames of a protocol, None if they have none."""
    requests = [command.request for command in codec.COMMANDS.values()]
    counters = (getattr(each, "COUNTER", None) for each in requests)
    found: tuple[str, int, bool, bool] | None = next((each for each in counters if each), None)
    if found is None:
        return None
    name, modulus, per_frame, echo = found
    restarts = (getattr(each, "RESTART", None) for each in requests)
    first: int = next((each for each in restarts if each is not None), 0)
    to_all = codec.BUS.broadcast
    return Numbering(name, modulus, per_frame=per_frame, echo=echo, first=first, broadcast=to_all)


def repeated_of(codec: Codec) -> tuple[str, ...]:
    """Values of frames that the answers of a protocol repeat, such as the number of the master that asked."""
    found: dict[str, None] = {}
    for command in codec.COMMANDS.values():
        several = (command.echoes, *(each.echoes for each in command.replies.values()))
        beside: tuple[str, ...] = getattr(command.request, "PARTS", ())
        found |= dict.fromkeys(name for echoes in several for name in echoes if name in beside)
    return tuple(found)


def repeat(names: Sequence[str], request: Message, response: Message) -> None:
    """Give an answer the values of its request that it repeats, as far as both frames have them."""
    for name in names:
        if name in getattr(request, "PARTS", ()) and name in getattr(response, "PARTS", ()):
            setattr(response, name, getattr(request, name))


class MasterNumber:
    """The number of a master among the values of its frames, if they have one.

    Attributes:
        number: its own number; None: requests have that of the caller.
    """

    def __init__(self, codec: Codec, number: int | None) -> None:
        """``number`` is that of the master, None to leave it to the caller."""
        self.number = number
        request = next((command.request for command in codec.COMMANDS.values()), None)
        found: tuple[str, int] | None = getattr(request, "MASTER", None)
        self._name, self._usual = found or ("", 0)
        #: Requests do not tell it.
        self._alone = bool(self._name) and self._name not in repeated_of(codec)

    def put(self, request: Message) -> None:
        """Give a request the number, if its frame has one."""
        if self.number is not None and self._name and self._name in getattr(request, "PARTS", ()):
            setattr(request, self._name, self.number)

    def takes(self, answer: Message) -> bool:
        """Whether an answer is for this master; its request may tell that instead."""
        if not self._alone:
            return True
        right = self._usual if self.number is None else self.number
        return bool(getattr(answer, self._name, right) == right)
