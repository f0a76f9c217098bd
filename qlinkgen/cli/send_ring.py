"""``qlinkgen send`` into a ring: a node for a moment, with one message of its own."""

from __future__ import annotations

from types import ModuleType

import click

from qlinkgen.cli import jsonlines
from qlinkgen.cli.common import warn
from qlinkgen.cli.decode import message_record
from qlinkgen.cli.ring_place import RingPlace, netstat_text
from qlinkgen.cli.stopping import StopSignals
from qlinkgen.cli.wire_options import Line, counted, open_free
from qlinkgen.link.codec import Framed
from qlinkgen.link.ring_events import Broken, Passed, RingEvent, Taken
from qlinkgen.model.protocol import Protocol
from qlinkgen.protocols.trio.errors import NoRoom

#: Seconds that the place stays unless told otherwise: a message of full length through 15 nodes takes less
#: from 57600 baud on, and a short one at any usual speed.
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
    """Send the message, stay for so long or until so many have come, and print what comes for this place."""
    stay = STAY if seconds is None else seconds
    with (
        StopSignals() as signals,
        RingPlace(open_free(protocol, port, baud, line), codec) as place,
    ):
        sender = _Sender(protocol, codec, message)
        place.send(message)  # a buffer that is empty has room for any message
        end = place.now() + stay
        while place.now() < end and not signals.stopped and (count is None or sender.taken < count):
            sender.look_at(place.events(end))
        sender.look_at(place.leave())
        counters, netstat = place.node.counters, place.node.netstat
    if not counters.sent:
        raise NoRoom(
            f"{message.NAME}: not sent within {stay:g} s: messages of other nodes come first, and did not "
            "end; try --seconds with more, or look with `qlinkgen ring` who sends without end"
        )
    taken, passed = counted(counters.taken, "message"), counters.passed
    click.echo(
        f"qlinkgen: sent{sender.round_trip}; meanwhile {taken} for this place, {passed} sent on; "
        f"{netstat_text(netstat)}",
        err=True,
    )


class _Sender:
    """Looks for what comes to this place, and for its own message among what comes round.

    Attributes:
        taken: messages that have come to this place.
        round_trip: what is known of the ring by that.
    """

    def __init__(self, protocol: Protocol, codec: ModuleType, message: Framed) -> None:
        self._protocol = protocol
        self._marking = codec.MARKING
        self._own: bytes = message.to_frame()
        self.taken = 0
        self.round_trip = ""

    def look_at(self, events: list[RingEvent]) -> None:
        """Print what came for this place, and warn of what was broken."""
        for event in events:
            if isinstance(event, Taken):
                self.taken += 1
                click.echo(jsonlines.line(message_record(self._protocol, event.message)))
            if isinstance(event, Taken | Passed):
                self._compare(event.frame)
            elif isinstance(event, Broken):
                warn(f"damaged ({event.kind}): {event.text}: {event.raw.hex(' ')}")

    def _compare(self, frame: bytes) -> None:
        """A message of the same type and payload, with its address lowered at each node, has come round."""
        marking, own = self._marking, self._own
        shift, mask = marking.address_shift, marking.address_mask
        lowered = (own[0] >> shift & mask) - (frame[0] >> shift & mask)
        same = frame[1:-1] == own[1:-1] and not (frame[0] ^ own[0]) & marking.id_mask << marking.id_shift
        if same and lowered >= 0 and not self.round_trip:
            self.round_trip = f", and it came round: {counted(lowered + 1, 'place')} on this ring"
