"""``--trace`` and ``--record``: print or keep the bytes of a port with their times, frame by frame."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from types import ModuleType

import click

from qlinkgen.captures.recording import RecordedPort, Recording
from qlinkgen.cli.cutting import Cutter, Piece
from qlinkgen.cli.hearing import values_text
from qlinkgen.cli.streams import Event, OneWay
from qlinkgen.link.codec import Fault, Framed, address_of, is_message
from qlinkgen.link.gaps import silence_of
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.texts import visible
from qlinkgen.plan.framing import frame_plan
from qlinkgen.transport.port import Port

trace_option = click.option(
    "--trace", "traced", is_flag=True, help="Print the bytes sent and received with their times to stderr."
)
record_option = click.option(
    "--record",
    type=click.Path(),
    metavar="FILE",
    help="Write each frame with its time and direction to a pcapng file.",
)

#: Called with each frame, and bytes that are none, and whether they were sent.
Tell = Callable[[Piece, bool], None]


class Printer:
    """Prints a line for each frame.

    Args:
        protocol: the protocol on the line.
        sent: what frames of either way are called.
    """

    def __init__(self, protocol: Protocol, sent: str = "sent", received: str = "received") -> None:
        self._protocol = protocol
        self._labels: Mapping[bool, str] = {True: sent, False: received}
        self._start: float | None = None

    def __call__(self, piece: Piece, sent: bool) -> None:  # as all that are told of pieces
        """Print one line."""
        self._start = piece.at if self._start is None else self._start
        told = "" if piece.event is None else f" [{self._told(piece.event)}]"
        text = f"{piece.at - self._start:12.6f}  {self._labels[sent]:8}  {piece.data.hex(' ')}{told}"
        click.echo(visible(text), err=True)

    def _told(self, event: Framed | Fault) -> str:
        if not is_message(event):
            return f"damaged ({event.kind}): {event.message}"
        node = address_of(event)
        where = "" if node is None else f"{event.ADDRESS} {node}"
        return " ".join(part for part in (event.NAME, where, values_text(self._protocol, event)) if part)


def keep(port: RecordedPort, *, turned: bool = False) -> Tell:
    """Return what keeps frames in a recording; ``turned``: as the other end of the line sees them."""

    def tell(piece: Piece, sent: bool) -> None:
        fault = None if piece.event is None or is_message(piece.event) else piece.event
        port.add(piece.at, piece.data, sent=sent is not turned, fault=fault)

    return tell


class Trace:
    """Cuts the bytes of a port into frames, and tells of each; `hear` is called with the bytes."""

    def __init__(self, protocol: Protocol, codec: ModuleType, *tells: Tell) -> None:
        self._tells = tells
        self._ways: dict[bool, OneWay] = {}
        if not frame_plan(protocol.frame).needs_request:  # an answer without its request tells nothing
            for sent, way in ((True, protocol.directions[0]), (False, protocol.directions[-1])):
                self._ways[sent] = OneWay(codec, way)
        self._cutter = Cutter()
        self._sent = False  # whether the bytes in it are

    def hear(self, at: float, sent: bool, data: bytes) -> None:
        """Take bytes; those of an answer are collected until it is complete."""
        if sent:
            self.end()
        self._collect(at, sent, data)
        if sent:
            self.end()

    def _collect(self, at: float, sent: bool, data: bytes) -> None:
        """Take bytes of an incomplete frame."""
        self._sent = sent
        self._cutter.take(at, data)
        way = self._ways.get(sent)
        self._cut(way.feed(data) if way else ())

    def end(self) -> None:
        """Tell of the bytes of a frame that is not complete, or was ended by silence."""
        way = self._ways.get(self._sent)
        self._cut(way.finish() if way else ())
        self._tell(self._cutter.rest())

    def _cut(self, events: Iterable[Event]) -> None:
        found = [(event, event.to_frame() if is_message(event) else event.raw) for event in events]
        self._tell(self._cutter.cut(found))

    def _tell(self, pieces: Iterable[Piece]) -> None:
        for piece in pieces:
            for tell in self._tells:
                tell(piece, self._sent)


class LineTrace(Trace):
    """Tells of the frames on a simulated line: those of the master are sent in pieces, too.

    A frame ends at the latest when the other side sends, and where the protocol has silences between frames,
    by one of those.
    """

    def __init__(self, protocol: Protocol, codec: ModuleType, *tells: Tell, baud: int) -> None:
        super().__init__(protocol, codec, *tells)
        self._silence = silence_of(codec, codec.BUS.bits_per_byte / baud)
        self._latest = 0.0

    def hear(self, at: float, sent: bool, data: bytes) -> None:
        """Take bytes of the master (`sent`) or a node."""
        if sent is not self._sent or (self._silence and at - self._latest > self._silence):
            self.end()
        self._latest = at
        self._collect(at, sent, data)


class FibreTrace(Trace):
    """Tells of the messages on one fibre of a ring."""

    def hear(self, at: float, sent: bool, data: bytes) -> None:
        """Take bytes."""
        self._collect(at, sent, data)


class Listener:
    """Keeps the frames that a monitor has found, and the bytes between them.

    Args:
        ended: the last bytes are kept at its end.
        record: path of the recording.
        port: the port, and its name.
        codec: the live module of the protocol.
    """

    def __init__(self, ended: ExitStack, record: str, name: str, port: Port, codec: ModuleType) -> None:
        recording = ended.enter_context(Recording(record))
        self._tell = keep(recording.port(name, codec, speed=port.baud, clock=port.now))
        self._cutter = Cutter()
        ended.callback(lambda: self._keep(self._cutter.rest()))

    def hear(self, at: float, data: bytes) -> None:
        """Take the bytes of a read."""
        self._cutter.take(at, data)

    def found(self, events: Iterable[tuple[Framed | Fault, bytes]]) -> None:
        """Keep frames and faults, with their bytes."""
        self._keep(self._cutter.cut(events))

    def _keep(self, pieces: Iterable[Piece]) -> None:
        for piece in pieces:
            self._tell(piece, False)


def trace_of(
    protocol: Protocol,
    codec: ModuleType,
    port: str,
    ended: ExitStack,
    *,
    traced: bool,
    record: str | None,
) -> Trace | None:
    """Return the trace of the options of a command that uses a port; it ends with `ended`."""
    tells: list[Tell] = [Printer(protocol)] if traced else []
    if record is not None:
        tells.append(keep(ended.enter_context(Recording(record)).port(port, codec)))
    if not tells:
        return None
    trace = Trace(protocol, codec, *tells)
    ended.callback(trace.end)
    return trace
