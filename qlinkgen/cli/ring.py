"""``qlinkgen ring``: a passive node of a ring, which forwards and prints every message."""

from __future__ import annotations

import math

import click

from qlinkgen.cli.arguments import driven_protocol_argument, port_argument
from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.codec import load_codec
from qlinkgen.cli.common import crc_option, load_protocol, warn
from qlinkgen.cli.kinds import RING, kind_of
from qlinkgen.cli.ring_hearing import RingPrinter, RingTeller
from qlinkgen.cli.ring_place import RingPlace, netstat_text
from qlinkgen.cli.stopping import StopSignals
from qlinkgen.cli.wire_options import (
    Parity,
    baud_option,
    counted,
    line_of,
    open_free,
    parity_option,
    seconds,
    stop_bits_option,
)
from qlinkgen.link.ring_events import RingEvent
from qlinkgen.model.replacement import Replacement


@click.command("ring")
@driven_protocol_argument
@port_argument
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per line instead of text.")
@click.option("--raw", is_flag=True, help="Add the bytes of each message, as received.")
@click.option("--count", type=click.IntRange(1), metavar="N", help="End after N messages, damaged ones too.")
@click.option("--seconds", "length", callback=seconds, metavar="SECONDS", help="End after this time.")
@baud_option
@parity_option
@stop_bits_option
@crc_option
def command(  # noqa: PLR0917  # click passes them by name
    protocol: str,
    port: str,
    as_json: bool,
    raw: bool,
    count: int | None,
    length: float | None,
    baud: int | None,
    parity: Parity,
    stop_bits: str,
    crc: Replacement | None,
) -> None:
    """Join a ring as a passive node: forward and print every message, until Ctrl-C.

    PORT receives from the previous node and transmits to the next one. A message is forwarded while it is
    being received; if it turns out to be damaged, it is terminated so that no node accepts it.

    A line has seconds since the start, the address as received (1 is this node, 2 the next one), message and
    fields. With --json, it is an object as printed by decode, with "at" and "sent_on"; a damaged message is
    {"at", "error": {...}, "sent_on"}. After the end of the command, the ring is open at this node.

    \b
    qlinkgen ring trio /dev/ttyUSB0 --baud 38400
    qlinkgen ring trio /dev/ttyUSB0 --baud 38400 --json --count 1000 > traffic.jsonl
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    loaded = load_protocol(protocol, crc)
    if kind_of(loaded) is not RING:
        raise Failure(f"{loaded.name} is not a ring; use `qlinkgen monitor {protocol} {port}`")
    codec = load_codec(loaded)
    opened = open_free(loaded, port, baud, line_of(parity, stop_bits))
    with StopSignals() as signals, RingPlace(opened, codec) as place:
        teller = RingTeller(loaded, codec, place.start, raw=raw)
        session = _Session(place, teller, RingPrinter(teller, as_json=as_json, count=count))
        click.echo(f"qlinkgen: joined the ring on {port}; press Ctrl-C to stop", err=True)
        try:
            session.run(math.inf if length is None else place.start + length, signals)
        finally:
            session.say_summary()


class _Session:
    """Prints the events of a place on the ring."""

    def __init__(self, place: RingPlace, teller: RingTeller, printer: RingPrinter) -> None:
        self._place = place
        self._teller = teller
        self._printer = printer

    def run(self, end: float, signals: StopSignals) -> None:
        """Run until a time, a number of messages, or a signal, and leave between two messages."""
        place = self._place
        while not self._printer.done and place.now() < end and not signals.stopped:
            self._print(place.events(end))
        self._print(place.leave())

    def _print(self, events: list[RingEvent]) -> None:
        for event in events:
            telling = self._teller.event(event)
            if telling is not None:
                self._printer.show(event.at, telling)
        if events:
            self._printer.flush()

    def say_summary(self) -> None:
        """Print the counts as one line, and warn of messages not shown."""
        counters, printer = self._place.node.counters, self._printer
        missing = counters.taken + counters.passed + counters.total_faults - printer.shown
        if missing > 0 and not printer.done:
            warn(f"{counted(missing, 'message')} not shown: received faster than printed")
        click.echo(
            f"qlinkgen: {printer.summary()}; {counters.passed} forwarded, {counters.taken} for this node, "
            f"{counters.total_faults} broken on arrival; {netstat_text(self._place.node.netstat)}",
            err=True,
        )
