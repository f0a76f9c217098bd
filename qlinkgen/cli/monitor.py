"""``qlinkgen monitor``: what goes over a bus that is only listened to."""

from __future__ import annotations

import math
import sys

import click

from qlinkgen.cli import jsonlines
from qlinkgen.cli.codec import load_codec
from qlinkgen.cli.common import crc_option, load_protocol
from qlinkgen.cli.hearing import Teller
from qlinkgen.cli.stopping import StopSignals
from qlinkgen.cli.wire_options import (
    baud_option,
    check_master_slave,
    counted,
    line_of,
    matching,
    open_line,
    parity_option,
    seconds,
    slack_option,
    speed,
    stop_bits_option,
)
from qlinkgen.link.events import Damaged
from qlinkgen.link.monitor import Heard, Monitor, Unanswered
from qlinkgen.transport.conversation import timing_of
from qlinkgen.transport.port import Port

#: Most seconds between two looks at whether to stop.
LOOK = 0.1


@click.command("monitor")
@click.argument("port")
@click.option(
    "--protocol", default="qlink", show_default=True, metavar="PROTOCOL", help="What is spoken on the line."
)
@click.option("--json", "as_json", is_flag=True, help="One object a line instead of text.")
@click.option("--raw", is_flag=True, help="Add the bytes of each frame.")
@click.option("--count", type=click.IntRange(1), metavar="N", help="End after N frames, damaged ones too.")
@click.option("--seconds", "length", callback=seconds, metavar="SECONDS", help="End after this time.")
@baud_option
@slack_option
@parity_option
@stop_bits_option
@crc_option
def command(  # noqa: PLR0917  # click passes them by name
    port: str,
    protocol: str,
    as_json: bool,
    raw: bool,
    count: int | None,
    length: float | None,
    baud: int | None,
    slack: float | None,
    parity: str,
    stop_bits: str,
    crc: str | None,
) -> None:
    """Listen to a bus and print who asks whom and what is answered, until Ctrl-C. Nothing is ever sent.

    A line has seconds since the start, who spoke to whom, message, fields, and in brackets how long an answer
    took, or what is not as usual: repeat, late, not answered, a second answer, one to nothing. The times are
    those at which this computer got the bytes; --slack is what an answer may be late by for that.

    With --json a frame is an object as decode prints it, with "at", "from" and "to"; requests have "repeat",
    answers "delay" and "late", frames that answer nothing "stray". {"at", "unanswered": {...}} is a request
    without an answer, {"at", "asked", "error": {...}} a damaged frame, with the node that was being asked.

    \b
    qlinkgen monitor /dev/ttyUSB1
    qlinkgen monitor /dev/ttyUSB1 --json --count 1000 > traffic.jsonl
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    loaded = load_protocol(protocol, crc)
    check_master_slave(loaded, "monitor")
    codec = load_codec(loaded)
    with StopSignals() as signals, open_line(port, speed(loaded, baud), line_of(parity, stop_bits)) as opened:
        start = opened.now()
        teller = Teller(loaded, codec, start, raw=raw)
        monitor = Monitor(codec, timing_of(codec, opened, slack=slack), accepts=matching(protocol))
        session = _Session(monitor, teller, as_json=as_json, count=count)
        click.echo(f"qlinkgen: listening to {loaded.name} on {port}; Ctrl-C ends it", err=True)
        try:
            session.listen(opened, math.inf if length is None else start + length, signals)
        finally:
            click.echo(f"qlinkgen: {session.summary()}", err=True)


class _Session:
    """Feeds a monitor from a port, prints what it hears, and counts."""

    def __init__(self, monitor: Monitor, teller: Teller, *, as_json: bool, count: int | None) -> None:
        """`count` frames end it."""
        self._monitor = monitor
        self._teller = teller
        self._as_json = as_json
        self._left = math.inf if count is None else count
        self._frames = self._faults = self._unanswered = 0

    def listen(self, port: Port, end: float, signals: StopSignals) -> None:
        """Listen until a time, a number of frames, or a signal."""
        self._until(port, end, signals)
        # What was asked before the end has its time to be answered.
        due = self._monitor.next_timer()
        if due is not None:
            self._until(port, due, None)
        self._monitor.finish(port.now())
        self._print()

    def _until(self, port: Port, end: float, signals: StopSignals | None) -> None:
        monitor, now = self._monitor, port.now()
        while self._left and now < end and not (signals and signals.stopped):
            due = monitor.next_timer()
            limit = min(end, now + LOOK if due is None else min(due, now + LOOK))
            data = port.read(max(0.0, limit - now))
            now = port.now()
            if data:
                monitor.receive(data, now)
            monitor.handle_timer(now)
            self._print()

    def _print(self) -> None:
        heard = self._monitor.heard
        if not heard:
            return
        while heard and self._left:
            self._show(heard.popleft())
        heard.clear()
        sys.stdout.flush()

    def _show(self, heard: Heard) -> None:
        if isinstance(heard, Unanswered):
            self._unanswered += 1
        else:
            self._left -= 1
            self._frames += 1
            self._faults += isinstance(heard, Damaged)
        teller = self._teller
        text = jsonlines.line(teller.tell(heard).record) if self._as_json else teller.line(heard)
        sys.stdout.write(f"{text}\n")

    def summary(self) -> str:
        """What there was, in a line."""
        return (
            f"{counted(self._frames, 'frame')}, {self._faults} of them damaged; "
            f"{counted(self._unanswered, 'request')} not answered; "
            f"{self._monitor.skipped} of {counted(self._monitor.bytes, 'byte')} in no frame"
        )
