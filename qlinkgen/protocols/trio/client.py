"""What the clients of a Motion Coordinator have in common, whether they block or not."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from qlinkgen.bus.ring_status import RingStatus
from qlinkgen.codecs import trio
from qlinkgen.link.ring import RingNode
from qlinkgen.protocols.trio.coordinator_node import CoordinatorNode, text_message
from qlinkgen.protocols.trio.facts import check_channel
from qlinkgen.protocols.trio.keypad_node import KeypadNode
from qlinkgen.protocols.trio.printing import Formatted, Number, pieces, printed
from qlinkgen.protocols.trio.variables import Variables

Node = CoordinatorNode | KeypadNode | RingNode
#: An item of PRINT.
Item = str | Number | Formatted


class CoordinatorClient(RingStatus[CoordinatorNode]):
    """Methods of a Motion Coordinator that do not wait."""

    @property
    def vr(self) -> Variables:
        """The variables VR(0) to VR(250); nodes of the ring may change them at any time."""
        return self.node.vr

    def defkey(self, key: int | str, *values: int) -> None:
        """Define the values of channel 3 for a key and the following ones: DEFKEY(key, value, value, ...).

        Args:
            key: the character that the keypad sends, or its number.
            values: for this key and the following ones; an undefined key returns its number.

        Raises:
            ValueError: the key is out of range.
        """
        self.node.keys.define(ord(key) if isinstance(key, str) else key, *values)

    def _take(self, channel: int) -> Callable[[float], int | None]:
        check_channel(channel)
        return lambda _now: self.node.take(channel)

    @staticmethod
    def _texts(n: int, items: tuple[Item, ...], sep: str, end: str) -> Iterator[trio.Message]:
        text_message(n, " ")  # refuses a wrong number before anything is sent
        return (text_message(n, piece) for piece in pieces(printed(items, sep, end)))
