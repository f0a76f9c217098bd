"""Events, counters and network status of a ring node.

Times are those passed to the engine.
"""

from __future__ import annotations

from enum import IntFlag
from typing import NamedTuple

from qlinkgen.link.codec import Message


class NetStat(IntFlag):
    """Errors since the status was cleared (Network Status)."""

    #: A message found no room in the transmit buffer in time.
    TX_TIMEOUT = 1
    #: The port did not accept the bytes to send.
    TX_BUFFER = 2
    #: The checksum of a message to this node was wrong, and the message was dropped.
    RX_CRC = 4
    #: An incomplete or corrupt message was received.
    RX_FRAME = 8


class CommsError(IntFlag):
    """Errors since the status was cleared, in more detail: COMMSERROR of later manuals."""

    #: Received characters found no room in the receive buffer.
    RX_BUFFER = 1
    #: Bytes to forward were lost, since the port did not accept them.
    RETRANSMIT_BUFFER = 2
    #: A message was received that is incomplete, or has a wrong structure.
    RX_STRUCTURE = 4
    #: A message was forwarded in part, since its rest was not received.
    TX_STRUCTURE = 8


class Taken(NamedTuple):
    """A message to this node was received; reported if the engine is verbose."""

    at: float
    message: Message
    frame: bytes


class Passed(NamedTuple):
    """A message to another node was forwarded completely; reported if the engine is verbose."""

    at: float
    #: As received, with the address not yet decremented.
    frame: bytes


class Queued(NamedTuple):
    """A message of this node was put into the transmit buffer; reported if the engine is verbose."""

    at: float
    message: Message


class Broken(NamedTuple):
    """An invalid message, or bytes outside a message."""

    at: float
    #: frame, crc, unknown, range; truncated after silence.
    kind: str
    #: Its bytes, as received.
    raw: bytes
    #: Description of the fault.
    text: str
    #: Its head had been forwarded before, and was terminated as broken.
    cut_short: bool

    @property
    def offset(self) -> int:
        """As of any fault: where it begins in what was received."""
        return 0

    @property
    def message(self) -> str:
        """As of any fault: its description."""
        return self.text


class Blocked(NamedTuple):
    """A message to another node was not forwarded: this node does not forward yet."""

    at: float
    #: Its header, as received.
    header: int


class Dropped(NamedTuple):
    """A message to this node was valid, but the node could not store all of it."""

    at: float
    message: Message
    #: Description of the loss and its reason.
    text: str


class StatusRaised(NamedTuple):
    """A bit of the network status was newly set."""

    at: float
    bit: NetStat


RingEvent = Taken | Passed | Queued | Broken | Blocked | Dropped | StatusRaised


class RingCounters:
    """Counts of one node. They only increase: read twice and subtract.

    Attributes:
        sent: own messages handed to the port.
        taken: valid messages to this node.
        passed: messages forwarded completely.
        passed_bytes: bytes forwarded, including those of broken messages.
        cut_short: broken messages whose head had already been forwarded.
        blocked: messages discarded because the node does not forward yet.
        refused: own messages discarded because the transmit buffer was full.
        faults: faults by kind: frame, crc, unknown, range, truncated.
        skipped: bytes outside messages, after a counted fault.
    """

    __slots__ = (
        "blocked",
        "cut_short",
        "faults",
        "passed",
        "passed_bytes",
        "refused",
        "sent",
        "skipped",
        "taken",
    )

    def __init__(self) -> None:
        self.sent = 0
        self.taken = 0
        self.passed = 0
        self.passed_bytes = 0
        self.cut_short = 0
        self.blocked = 0
        self.refused = 0
        self.faults: dict[str, int] = {}
        self.skipped = 0

    @property
    def total_faults(self) -> int:
        """Number of faults of all kinds."""
        return sum(self.faults.values())

    def as_dict(self) -> dict[str, int | dict[str, int]]:
        """Return the counts by name."""
        return {name: getattr(self, name) for name in self.__slots__}

    def __repr__(self) -> str:
        seen = ", ".join(f"{name}={value}" for name, value in self.as_dict().items() if value)
        return f"RingCounters({seen})"
