"""Keyword arguments of buses."""

from __future__ import annotations

from collections.abc import Callable, Collection
from logging import Logger
from typing import Literal, TypedDict

from qlinkgen.link.echo import EchoMode
from qlinkgen.link.events import Event, Frame
from qlinkgen.link.health import HealthPolicy
from qlinkgen.link.ring_events import RingEvent

Parity = Literal["none", "even", "odd"]
StopBits = Literal[1, 2]


class Observers(TypedDict, total=False):
    """Who is told what happens on a port.

    on_event: called with each event, in the calling thread or task.
    on_frame: called with each frame, sent or received, and with bytes that are none.
    logger: gets a record of each event with its values as attributes (`extra`); None: nothing is logged.
    """

    on_event: Callable[[Event], None] | None
    on_frame: Callable[[Frame], None] | None
    logger: Logger | None


class AskingOptions(TypedDict, total=False):
    """Options of an engine that asks.

    attempts: most transmissions of a request, the first included; 3 by default.
    slack: largest delay in seconds that driver, adapter and operating system add to a transaction; by default
        derived from the port.
    """

    attempts: int
    slack: float | None


class MasterOptions(AskingOptions, total=False):
    """Options of the engine of a master.

    echo: whether the adapter echoes sent bytes: `expect`, `none`, or `auto` to probe with two zero bytes
        before the first request, the default where no frame begins with them.
    health: when a silent node is offline; None: never.
    number: the number of the master, where frames have a destination and a source.
    """

    echo: EchoMode
    health: HealthPolicy | None
    number: int | None


class PeerOptions(AskingOptions, total=False):
    """Options of the engine of one side of a link whose sides both ask.

    turnaround: seconds from a request to its answer.
    """

    turnaround: float


#: Commands whose check value is read: all, none, or those listed.
Checksum = Literal["always", "never"] | Collection[str]


class HostEngineOptions(AskingOptions, total=False):
    """Options of the engine of a host.

    checksum: commands whose check value is read: "always", "never", or names. Without it, the loss or
        corruption of a packet is not detected.
    forgets: seconds of silence after which the device discards an incomplete packet; 0 if it never does.
    """

    checksum: Checksum
    forgets: float


class HostOptions(HostEngineOptions, Observers, total=False):
    """Options of the host of a device."""


class BusOptions(MasterOptions, Observers, total=False):
    """Options of a bus."""


class LinkOptions(PeerOptions, Observers, total=False):
    """Options of one side of a link."""


class SlaveOptions(TypedDict, total=False):
    """Options of slaves.

    turnaround: seconds from a request to its answer, so that the master can release the line; by default the
        silence that the schema requires between two frames, on a port that sends at the baud rate.
    echo: whether the adapter echoes sent bytes.
    slack: largest delay in seconds with which bytes of one frame arrive; where a silence ends a frame, slaves
        wait for it that much longer. By default derived from the port.
    on_frame: called with each frame, sent or received, and with bytes that are none.
    """

    turnaround: float | None
    echo: Literal["expect", "none"]
    slack: float | None
    on_frame: Callable[[Frame], None] | None


class DeviceOptions(TypedDict, total=False):
    """Options of the device at a host's port.

    turnaround: seconds from the end of a packet to its answer.
    forgets: seconds of silence within a packet after which it is discarded; 0, the default: never.
    on_frame: called with each packet and answer, and with bytes that are none.
    """

    turnaround: float
    forgets: float
    on_frame: Callable[[Frame], None] | None


class RingEngineOptions(TypedDict, total=False):
    """Options of the engine of a ring node.

    cut_through: forward messages while they are received, not only when they are complete; the default.
    patience: seconds of silence inside a message after which it is broken; 0.5 by default.
    room: size of the transmit buffer in bytes.
    """

    cut_through: bool
    patience: float
    room: int


class RingOptions(RingEngineOptions, total=False):
    """Options of a ring node.

    tx_timeout: seconds that a message waits for room in the transmit buffer; 1 by default.
    on_event: called with each event of the engine.
    on_frame: called with each frame, sent, taken or forwarded, and with bytes that are none.
    logger: gets a record of each event.
    """

    tx_timeout: float
    on_event: Callable[[RingEvent], object] | None
    on_frame: Callable[[Frame], None] | None
    logger: Logger | None
