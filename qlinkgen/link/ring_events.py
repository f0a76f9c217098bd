"""What a node of a ring has seen, as data: events, counters, and the network status.

Times are those that the engine was given.
"""

from __future__ import annotations

from enum import IntFlag
from typing import NamedTuple

from qlinkgen.link.codec import Message


class NetStat(IntFlag):
    """What has gone wrong since the status was cleared (Network Status)."""

    #: A message found no room in the transmit buffer in time.
    TX_TIMEOUT = 1
    #: The port did not take what was to be sent from the buffers.
    TX_BUFFER = 2
    #: The checksum of a message to this node was wrong, and the message was dropped.
    RX_CRC = 4
    #: An incomplete or corrupt message has come.
    RX_FRAME = 8


class Taken(NamedTuple):
    """A message to this node has come; told where the engine is verbose."""

    at: float
    message: Message
    frame: bytes


class Passed(NamedTuple):
    """A message to another node was sent on to its end; told where the engine is verbose."""

    at: float
    #: As it came: the address has not been lowered yet.
    frame: bytes


class Queued(NamedTuple):
    """A message of this node went into the transmit buffer; told where the engine is verbose."""

    at: float
    message: Message


class Broken(NamedTuple):
    """A message, or bytes in none, that is not in order."""

    at: float
    #: frame, crc, unknown, range, or truncated where the line fell silent.
    kind: str
    #: The bytes in question, as they came.
    raw: bytes
    #: What is wrong with them.
    text: str
    #: Its head was sent on before this was known, and has been ended as broken.
    cut_short: bool


class Blocked(NamedTuple):
    """A message to another node was not sent on: this one does not pass messages yet."""

    at: float
    #: Its header, as it came.
    header: int


class Dropped(NamedTuple):
    """A message to this node was in order, but the node could not keep all of it."""

    at: float
    message: Message
    #: What is lost, and why.
    text: str


class StatusRaised(NamedTuple):
    """A bit of the network status was set that had not been."""

    at: float
    bit: NetStat


RingEvent = Taken | Passed | Queued | Broken | Blocked | Dropped | StatusRaised


class RingCounters:
    """Counts of one node. They only go up: read twice and subtract.

    Attributes:
        sent: own messages handed to the port.
        taken: messages to this node that were in order.
        passed: messages sent on to their end.
        passed_bytes: bytes sent on, those of broken messages included.
        cut_short: broken messages whose head had been sent on already.
        blocked: messages that were not sent on since the node does not pass any yet.
        refused: own messages that were given up, since the transmit buffer had no room.
        faults: what was not in order, by kind: frame, crc, unknown, range, truncated.
        skipped: bytes in no message, behind a fault that was counted.
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
        """Faults of all kinds."""
        return sum(self.faults.values())

    def as_dict(self) -> dict[str, int | dict[str, int]]:
        """Return the counts by name."""
        return {name: getattr(self, name) for name in self.__slots__}

    def __repr__(self) -> str:
        seen = ", ".join(f"{name}={value}" for name, value in self.as_dict().items() if value)
        return f"RingCounters({seen})"
