"""Several answers to one request."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, cast

from qlinkgen.link.codec import Command, EachOf, Framed, Many, Message, Module, UntilStopped, address_of

if TYPE_CHECKING:
    from typing_extensions import TypeIs


def is_listed(many: Many) -> TypeIs[EachOf]:
    """Whether each node in a list of the request sends an answer."""
    return hasattr(many, "each")


def is_endless(many: Many | None) -> TypeIs[UntilStopped]:
    """Whether only another command ends the answers."""
    return hasattr(many, "stopped_by")


def nodes_asked(many: Many, request: Message) -> Sequence[int] | None:
    """The nodes of which each sends one answer, as the request lists them; None for other ends."""
    if not is_listed(many):
        return None
    listed = getattr(request, many.each)
    return [int(getattr(item, many.key)) for item in listed] if many.key else list(map(int, listed))


def stops(codec: Module) -> Iterator[tuple[Command, Stop]]:
    """The commands whose answers only another command ends, and how it does."""
    for command in codec.COMMANDS.values():
        if is_endless(command.many):
            yield command, Stop(command.many, codec)


def has_endless(codec: Module) -> bool:
    """Whether only other commands end some answers: these need a line for each direction.

    On one line for both, a node that sends all the time leaves the master no time to stop it.
    """
    return any(True for _ in stops(codec))


class Stop:
    """How the answers to a request without an end are stopped."""

    __slots__ = ("_broadcast", "_compared", "_make", "_repeats", "_to_all", "command")

    def __init__(self, many: UntilStopped, codec: Module) -> None:
        """``many`` is that of the command with these answers."""
        self.command: Command = codec.COMMANDS[many.stopped_by]
        self._broadcast = codec.BUS.broadcast
        self._repeats = many.repeats
        self._make = cast(Any, self.command.request)  # Any: arguments and fields are those of the class
        self._compared = [name for name in self._repeats if name in self._make.FIELDS]
        self._to_all = self.command.addressing == "broadcast"

    def of(self, request: Framed) -> Framed:
        """The request that stops the answers to one."""
        given = {name: getattr(request, name) for name in self._repeats}
        if (address := self.command.request.ADDRESS) and not self._to_all:
            given[address] = address_of(request)
        made: Framed = self._make(**given)
        return made

    def by(self, stop: Framed, request: Framed) -> bool:
        """Whether a request stops the answers to another one."""
        if type(stop) is not self.command.request:
            return False
        address = address_of(stop)
        same = all(getattr(stop, name) == getattr(request, name) for name in self._compared)
        return same and address in {None, self._broadcast, address_of(request)}


class Answers:
    """The answers so far.

    Attributes:
        items: the answers, oldest first.
        nodes: the nodes of which each sends one, None if something else ends them.
    """

    __slots__ = ("_alone", "_by", "_found", "_last", "_many", "items", "nodes")

    def __init__(self, many: Many, request: Framed, *, alone: bool = False) -> None:
        """``alone``: one node was asked with a command that all nodes answer for a time."""
        self._many = many
        self._alone = alone and many.within is not None
        self.nodes = nodes_asked(many, request)
        self._by = many.by if is_listed(many) else ""
        self._found: dict[int, Framed] = {}
        #: Number of answers, 0 if something else ends them.
        self._last = int(getattr(request, many.counted_by)) if many.counted_by else many.count
        if self.nodes is not None:
            self._last = len(set(self.nodes))
        if hasattr(many, "stopped_by"):  # the first one begins a stream
            self._last = 1
        self.items: list[Framed] = []

    @property
    def timed(self) -> bool:
        """Whether a time ends them."""
        return self._many.within is not None and not self._alone

    @property
    def further(self) -> int:
        """Number of answers after the first, whose time is known from the beginning."""
        return 0 if self.nodes is None else self._last - 1

    @property
    def result(self) -> object:
        """What a call returns: the answers, or that of each node that was asked, None for a missing one."""
        if self.nodes is None:
            return self.items
        return {node: self._found.get(node) for node in self.nodes}

    def expects(self, answer: Message) -> bool:
        """Whether it may be one of them: of a node that was asked, and has not answered."""
        if self.nodes is None:
            return True
        node = self._node(answer)
        return node in self.nodes and node not in self._found

    def take(self, answer: Framed) -> bool:
        """Add an answer; return whether it is the last one."""
        self.items.append(answer)
        if self.nodes is not None and (node := self._node(answer)) is not None:
            self._found[node] = answer
        if self._many.until is not None:
            name, first, last = self._many.until
            return first <= int(getattr(answer, name)) <= last
        return self._alone or len(self.items) == self._last

    def ended_by(self, reply: Framed) -> bool:
        """Whether a reply follows the last answer."""
        return type(reply) is self._many.reply

    def _node(self, answer: Message) -> int | None:
        return int(getattr(answer, self._by)) if self._by else address_of(answer)
