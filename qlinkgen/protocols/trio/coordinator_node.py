"""A Motion Coordinator as a node of the ring: handling of received messages, and making of messages.

It has no input or output and no clock: `node.link` is the engine that a driver runs, and `now` is an
argument.
"""

from __future__ import annotations

from collections import deque
from decimal import Decimal
from typing import Unpack, cast

from qlinkgen.codecs import trio
from qlinkgen.link.ring import RingNode
from qlinkgen.link.ring_events import CommsError, Dropped
from qlinkgen.protocols.trio.facts import KEYS, LAST_VARIABLE, OFFSET, RECEIVE_BUFFER, VARIABLE, wire_address
from qlinkgen.protocols.trio.options import NodeOptions
from qlinkgen.protocols.trio.printing import Number
from qlinkgen.protocols.trio.variables import KeyTable, Variables


class CoordinatorCounters:
    """Counts of dropped messages and characters.

    Attributes:
        characters_lost: characters dropped because the receive buffer was full.
        variables_lost: messages for a variable that does not exist.
        ignored: messages that only apply to keypads.
    """

    __slots__ = ("characters_lost", "ignored", "variables_lost")

    def __init__(self) -> None:
        self.characters_lost = 0
        self.variables_lost = 0
        self.ignored = 0

    def __repr__(self) -> str:
        return f"CoordinatorCounters({', '.join(f'{n}={getattr(self, n)}' for n in self.__slots__)})"


class CoordinatorNode:
    """The behaviour of a Motion Coordinator.

    Attributes:
        link: the engine: NETSTAT, counters, events.
        vr: the variables.
        keys: the DEFKEY table.
        received: unread characters, at most 256.
        counters: counts of dropped messages and characters.
    """

    kind = "coordinator"

    def __init__(self, **options: Unpack[NodeOptions]) -> None:
        """Make a node; the options are those of `RingNode`."""
        options.setdefault("codec", trio)
        self.link = self._make_link(**options)
        self.vr = Variables()
        self.keys = KeyTable()
        self.received: deque[str] = deque()
        self.counters = CoordinatorCounters()

    def _make_link(self, **options: Unpack[NodeOptions]) -> RingNode:
        return RingNode(on_message=self._handle, **options)

    def reset(self) -> None:
        """Switch off and on: messages being sent and received data are lost; variables are kept."""
        self.link.reset()
        self.received.clear()

    # messages that come

    def _handle(self, message: trio.Message, now: float) -> None:
        if isinstance(message, trio.CharacterTransfer):
            self._characters(message, now)
        elif not isinstance(message, trio.DirectVariableTransfer):
            self.counters.ignored += 1
        elif message.number <= LAST_VARIABLE:
            self.vr[message.number] = message.value
        else:
            self.counters.variables_lost += 1
            text = f"VR({message.number}) does not exist; the last one is VR({LAST_VARIABLE})"
            self.link.events.append(Dropped(now, message, text))

    def _characters(self, message: trio.CharacterTransfer, now: float) -> None:
        room = RECEIVE_BUFFER - len(self.received)
        self.received += message.characters[:room]
        lost = len(message.characters) - room
        if lost > 0:
            self.counters.characters_lost += lost
            self.link.commserror |= CommsError.RX_BUFFER
            text = f"the receive buffer is full: the last {lost} of its characters are lost"
            self.link.events.append(Dropped(now, message, text))

    def take(self, channel: int) -> int | None:
        """Remove and return the oldest character, None if there is none.

        Args:
            channel: 3 for its value by the DEFKEY table, 4 for its number.
        """
        if not self.received:
            return None
        code = ord(self.received.popleft())
        return self.keys[code] if channel == KEYS else code


# messages that go


def text_message(node: int, text: str) -> trio.Message:
    """Return the message of PRINT #node; at most 256 characters."""
    return trio.CharacterTransfer(address=wire_address(node), characters=text)


def mode_message(node: int, mode: trio.KeypadModeEnum | int) -> trio.Message:
    """Return the message that sets the mode of a keypad; BASIC has no command for it."""
    return trio.KeypadMode(address=wire_address(node), mode=mode)


def send_message(node: int, kind: int, data1: int, data2: Number | None) -> trio.Message:
    """Return the message of SEND(node, kind, data1[, data2]).

    Raises:
        ValueError: an argument is out of range.
        TypeError: data2 is missing.
    """
    address = wire_address(node)
    if kind == OFFSET:
        # Programs pass any data2 here, which BASIC does not use.
        return trio.KeypadOffset(address=address, offset=wire_address(data1, "data1"))
    if kind != VARIABLE:
        raise ValueError(
            f"type: {kind!r} was given; SEND has {VARIABLE} (direct variable transfer) and {OFFSET} "
            "(keypad offset), which are not the types on the wire"
        )
    if isinstance(data2, bool) or not isinstance(data2, Number):
        raise TypeError(f"data2: {data2!r} was given; a direct variable transfer needs the value")
    # The codec rounds any number with an exact ratio to the nearest step.
    return trio.DirectVariableTransfer(address=address, number=data1, value=cast(Decimal, data2))
