"""``qlinkgen monitor`` on one fibre of a ring."""

from __future__ import annotations

from collections.abc import Sequence
from types import ModuleType

import click

from qlinkgen.cli.ring_hearing import RingPrinter, RingTeller
from qlinkgen.cli.stopping import StopSignals
from qlinkgen.cli.tracing import Listener
from qlinkgen.cli.wire_options import counted
from qlinkgen.link.codec import Fault, Framed, is_message
from qlinkgen.model.protocol import Protocol
from qlinkgen.transport.port import Port

#: Longest time between two checks of the stop signal, in seconds.
LOOK = 0.1


def monitor_ring(
    protocol: Protocol,
    codec: ModuleType,
    port: Port,
    signals: StopSignals,
    *,
    as_json: bool,
    raw: bool,
    count: int | None,
    end: float,
    listener: Listener | None = None,
) -> None:
    """Print the traffic of a fibre until a time, a number of messages, or a signal; then a summary."""
    teller = RingTeller(protocol, codec, port.now(), raw=raw)
    session = _Session(codec, teller, RingPrinter(teller, as_json=as_json, count=count), listener)
    try:
        session.listen(port, end, signals)
    finally:
        click.echo(f"qlinkgen: {session.summary()}", err=True)


class _Session:
    """Feeds a decoder from a port, and prints its events."""

    def __init__(
        self, codec: ModuleType, teller: RingTeller, printer: RingPrinter, listener: Listener | None
    ) -> None:
        self._decoder = codec.StreamDecoder()
        self._teller = teller
        self._printer = printer
        self._listener = listener
        self._bytes = 0

    def listen(self, port: Port, end: float, signals: StopSignals) -> None:
        """Listen until a time, a number of messages, or a signal."""
        while not self._printer.done and port.now() < end and not signals.stopped:
            data = port.read(max(0.0, min(LOOK, end - port.now())))
            self._bytes += len(data)
            if self._listener is not None:
                self._listener.hear(port.now(), data)
            self._print(self._decoder.feed(data), port.now())
        self._print(self._decoder.finish(), port.now())

    def _print(self, found: Sequence[Framed | Fault], now: float) -> None:
        if self._listener is not None:
            self._listener.found(
                [(each, each.to_frame() if is_message(each) else bytes(each.raw)) for each in found]
            )
        for each in found:
            if is_message(each):
                told = self._teller.message(now, each, each.to_frame())
            else:
                told = self._teller.broken(now, each.kind, bytes(each.raw), each.message, offset=each.offset)
            self._printer.show(now, told)
        if found:
            self._printer.flush()

    def summary(self) -> str:
        """Return the counts as one line."""
        skipped = self._decoder.counters.skipped
        return f"{self._printer.summary()}; {skipped} of {counted(self._bytes, 'byte')} outside messages"
