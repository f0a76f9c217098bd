"""What the document says beyond the bytes, and what this project has settled where it says nothing."""

from __future__ import annotations

from qlinkgen.codecs.trio import BUS

#: BASIC's number of the next node along the ring, whose address on the wire is 1 (Network Node Addressing).
FIRST_NODE = 10
#: Most nodes of a ring.
MOST_NODES: int = BUS.last_node or 0
LAST_NODE = FIRST_NODE + MOST_NODES - 1
#: Last variable of a Motion Coordinator (GET, VR(x)).
LAST_VARIABLE = 250
#: Characters that a Motion Coordinator keeps until they are read (Network Buffers).
RECEIVE_BUFFER = 256
#: Input by way of the DEFKEY table, and the same input as it came (GET, KEY).
KEYS, CHARACTERS = 3, 4
#: Message types of SEND, which are not those on the wire (SEND).
VARIABLE, OFFSET = 1, 2
#: Characters of one message at most.
LONGEST_TEXT = 256
#: What ends a line of PRINT, unless a semicolon stands there.
LINE_END = "\r\n"
#: Decimals of a number that is printed without a format.
DECIMALS = 4
#: A keypad in mode on_off sends this much more for a key that goes up than for the same key going down.
KEY_UP = 64


def wire_address(node: int, what: str = "n") -> int:
    """Return the address on the wire, 1-15, of a node by BASIC's number, 10-24.

    Raises:
        ValueError: it is no such number.
    """
    if type(node) is not int or not FIRST_NODE <= node <= LAST_NODE:
        raise ValueError(
            f"{what}: {node!r} was given; nodes along the ring have the numbers {FIRST_NODE} (the next one) "
            f"to {LAST_NODE}"
        )
    return node - FIRST_NODE + 1


def check_channel(channel: int) -> int:
    """Return a channel of GET and KEY if it is one of the network's."""
    if channel not in {KEYS, CHARACTERS}:
        raise ValueError(
            f"channel: {channel!r} was given; the network's are {KEYS} (by the DEFKEY table) and "
            f"{CHARACTERS} (characters as they came)"
        )
    return channel
