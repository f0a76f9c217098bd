"""``qlinkgen send`` into a ring: a temporary node that sends one message."""

from __future__ import annotations

from types import ModuleType

import click

from qlinkgen.cli import jsonlines
from qlinkgen.cli.common import warn
from qlinkgen.cli.decode import message_record
from qlinkgen.cli.ring_place import RingPlace, netstat_text
from qlinkgen.cli.stopping import StopSignals
from qlinkgen.cli.wire_options import Line, counted, open_free
from qlinkgen.errors import NoRoom
from qlinkgen.link.codec import Framed
from qlinkgen.link.ring_events import Broken, Passed, RingEvent, Taken
from qlinkgen.model.protocol import Protocol

#: Default time on the ring in seconds: a message of full length passes 15 nodes in less from 57600 baud on, a
#: short one at any usual speed.
STAY = 0.2


def send_into_ring(
    protocol: Protocol,
    codec: ModuleType,
    message: Framed,
    port: str,
    *,
    seconds: float | None,
    count: int | None,
    baud: int | None,
    line: Line,
) -> None:
    """Send the message, stay for a time or a number of messages, and print the messages for this node."""
    stay = STAY if seconds is None else seconds
    with (
        StopSignals() as signals,
        RingPlace(open_free(protocol, port, baud, line), codec) as place,
    ):
        sender = _Sender(protocol, codec, message)
        place.send(message)  # an empty buffer has room for any message
        end = place.now() + stay
        while place.now() < end and not signals.stopped and (count is None or sender.taken < count):
            sender.look_at(place.events(end))
        sender.look_at(place.leave())
        counters, netstat = place.node.counters, place.node.netstat
    if not counters.sent:
        raise NoRoom(
            f"{message.NAME}: not sent within {stay:g} s: forwarded messages go first, and left no gap; "
            "increase --seconds, or find the node that keeps sending with `qlinkgen ring`"
        )
    taken, passed = counted(counters.taken, "message"), counters.passed
    click.echo(
        f"qlinkgen: sent{sender.round_trip}; {taken} for this node, {passed} forwarded; "
        f"{netstat_text(netstat)}",
        err=True,
    )


class _Sender:
    """Prints the messages for this node, and detects its own message coming back around the ring.

    Attributes:
        taken: number of messages for this node.
        round_trip: text about the size of the ring, if the own message came back.
    """

    def __init__(self, protocol: Protocol, codec: ModuleType, message: Framed) -> None:
        self._protocol = protocol
        self._marking = codec.MARKING
        self._own: bytes = message.to_frame()
        self.taken = 0
        self.round_trip = ""

    def look_at(self, events: list[RingEvent]) -> None:
        """Print the messages for this node, and warn of damaged ones."""
        for event in events:
            if isinstance(event, Taken):
                self.taken += 1
                click.echo(jsonlines.line(message_record(self._protocol, event.message)))
            if isinstance(event, Taken | Passed):
                self._compare(event.frame)
            elif isinstance(event, Broken):
                warn(f"damaged ({event.kind}): {event.text}: {event.raw.hex(' ')}")

    def _compare(self, frame: bytes) -> None:
        """Detect the own message: same type and payload, its address decremented by each node."""
        marking, own = self._marking, self._own
        shift, mask = marking.address_shift, marking.address_mask
        lowered = (own[0] >> shift & mask) - (frame[0] >> shift & mask)
        same = frame[1:-1] == own[1:-1] and not (frame[0] ^ own[0]) & marking.id_mask << marking.id_shift
        if same and lowered >= 0 and not self.round_trip:
            self.round_trip = f", and returned: {counted(lowered + 1, 'node')} on this ring"
