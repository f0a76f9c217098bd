"""A request of a master, and which messages answer it."""

from __future__ import annotations

from qlinkgen.link.codec import Framed, OtherReply, repeats, wrong_size
from qlinkgen.link.counters import LinkCounters
from qlinkgen.link.transaction import CommandTiming


class Pending:
    """A request as sent.

    Attributes:
        request: the message.
        asked: the frame that may say the sizes of the response: the request, or a later one of a dialogue.
        command: its command.
        node: address in it, None for frames without one.
        to_all: it is a broadcast.
        frame: its bytes on the wire.
        count: counts of the node.
    """

    __slots__ = ("asked", "command", "count", "frame", "node", "request", "to_all")

    def __init__(  # noqa: PLR0917  # made for each transaction, where keywords would take 1 % of the time
        self,
        request: Framed,
        command: CommandTiming,
        node: int | None,
        frame: bytes,
        count: LinkCounters,
        to_all: bool,
    ) -> None:
        self.request = self.asked = request
        self.command = command
        self.node = node
        self.frame = frame
        self.count = count
        self.to_all = to_all

    @property
    def is_answered(self) -> bool:
        """Whether any node answers."""
        command = self.command
        return command.response is not None and (not self.to_all or command.answers_broadcast)

    def answered_by(self, response: Framed, node: int | None) -> bool:
        """Whether a response of the right class from a node is the answer."""
        command, request = self.command, self.request
        if command.echoes and not repeats(command.echoes, request, response):
            return False
        if command.sizes and wrong_size(command.definition, self.asked, response):
            return False
        if command.accepts is not None:
            return command.accepts(request, response)
        return node == self.node or self._nameless(node)

    def replied_by(self, message: Framed, node: int | None) -> OtherReply | None:
        """Return the reply other than the response that a message from a node is; None if it is not one."""
        reply = self.command.replies.get(type(message))
        if reply is None or not self.from_asked(node):
            return None
        if self.command.accepts is not None and type(message) is self.command.response:
            return reply if self.command.accepts(self.request, message) else None
        sizes = self.command.sizes if type(message) is self.command.response else ()
        if sizes and wrong_size(self.command.definition, self.asked, message):
            return None
        return reply if repeats(reply.echoes, self.request, message) else None

    def from_asked(self, node: int | None) -> bool:
        """Whether a node was asked."""
        return node == self.node or self._nameless(node)

    def _nameless(self, node: int | None) -> bool:
        """Whether any node may answer, or the frame of the answer does not tell which one did."""
        return self.command.answers_broadcast if self.to_all else node is None

    def may_be_answered_by(self, message: Framed, node: int | None) -> bool:
        """Whether a message from a node has the class and address of an answer, to any attempt."""
        command = self.command
        known = type(message) is command.response or type(message) in command.replies
        known = known or any(type(message) is kind for _, kind, _ in command.definition.steps)
        return known and self.from_asked(node)
