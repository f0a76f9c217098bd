"""Facts of the document beyond encoding, and assumptions where it is silent."""

from __future__ import annotations

from typing import Final

from qlinkgen.codecs import trio
from qlinkgen.protocols.needs import Needs

#: Fields by message, and values by enum, that this package uses.
FIELDS: Final = {
    "character_transfer": "address characters",
    "direct_variable_transfer": "address number value",
    "keypad_offset": "address offset",
    "keypad_mode": "address mode",
}
ENUMS: Final = {"keypad_mode": "on_only on_off"}
_NEEDS: Final = Needs(trio, "qlinkgen/protocols/trio")
_NEEDS.check(FIELDS, enums=ENUMS)

#: BASIC's number of the next node along the ring, whose address on the wire is 1 (Network Node Addressing).
FIRST_NODE = 10
#: Largest number of nodes of a ring.
MOST_NODES: Final = _NEEDS.bus("last_node")
LAST_NODE = FIRST_NODE + MOST_NODES - 1
#: Last variable of a Motion Coordinator (GET, VR(x)).
LAST_VARIABLE = 250
#: Size of the receive buffer of a Motion Coordinator in characters (Network Buffers).
RECEIVE_BUFFER = 256
#: Channels of input through the DEFKEY table, and of unchanged input (GET, KEY).
KEYS, CHARACTERS = 3, 4
#: Message types of SEND, which are not those on the wire (SEND).
VARIABLE, OFFSET = 1, 2
#: Most characters of one message.
LONGEST_TEXT = 256
#: Line end of PRINT, unless it ends in a semicolon.
LINE_END = "\r\n"
#: Decimals of a number printed without a format.
DECIMALS = 4
#: Added to the number of a key on release, in mode on_off.
KEY_UP = 64


def wire_address(node: int, what: str = "n") -> int:
    """Return the address on the wire, 1-15, of a node by BASIC's number, 10-24.

    Raises:
        ValueError: the number is out of range.
    """
    if type(node) is not int or not FIRST_NODE <= node <= LAST_NODE:
        raise ValueError(
            f"{what}: {node!r} was given; nodes along the ring have the numbers {FIRST_NODE} (the next one) "
            f"to {LAST_NODE}"
        )
    return node - FIRST_NODE + 1


def check_channel(channel: int) -> int:
    """Return a channel of GET and KEY after checking that it is one of the network's."""
    if channel not in {KEYS, CHARACTERS}:
        raise ValueError(
            f"channel: {channel!r} was given; the network's are {KEYS} (through the DEFKEY table) and "
            f"{CHARACTERS} (unchanged characters)"
        )
    return channel
