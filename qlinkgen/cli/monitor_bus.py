"""``qlinkgen monitor`` for a bus with a master."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from types import ModuleType
from typing import assert_never

import click

from qlinkgen.cli import jsonlines
from qlinkgen.cli.hearing import Teller
from qlinkgen.cli.stopping import StopSignals
from qlinkgen.cli.tracing import Listener
from qlinkgen.cli.wire_options import counted
from qlinkgen.link.codec import Fault, Framed
from qlinkgen.link.events import Damaged, Stray
from qlinkgen.link.monitor import Asked, Heard, Monitor, Replied, Unanswered
from qlinkgen.link.transaction import Accepts
from qlinkgen.model.protocol import Protocol
from qlinkgen.transport.conversation import timing_of
from qlinkgen.transport.port import Port

#: Longest time between two checks of the stop signal, in seconds.
LOOK = 0.1


def monitor_bus(
    protocol: Protocol,
    codec: ModuleType,
    port: Port,
    signals: StopSignals,
    *,
    as_json: bool,
    raw: bool,
    count: int | None,
    end: float,
    slack: float | None,
    accepts: Mapping[str, Accepts] | None,
    listener: Listener | None = None,
) -> None:
    """Print the traffic until a time, a number of frames, or a signal; then a summary."""
    teller = Teller(protocol, codec, port.now(), raw=raw)
    monitor = Monitor(codec, timing_of(codec, port, slack=slack), accepts=accepts)
    session = _Session(monitor, teller, as_json=as_json, count=count, listener=listener)
    try:
        session.listen(port, end, signals)
    finally:
        click.echo(f"qlinkgen: {session.summary()}", err=True)


class _Session:
    """Feeds a monitor from a port, prints its events, and counts."""

    def __init__(
        self,
        monitor: Monitor,
        teller: Teller,
        *,
        as_json: bool,
        count: int | None,
        listener: Listener | None,
    ) -> None:
        """Stop after `count` frames."""
        self._monitor = monitor
        self._teller = teller
        self._listener = listener
        self._as_json = as_json
        self._left = math.inf if count is None else count
        self._frames = self._faults = self._unanswered = 0

    def listen(self, port: Port, end: float, signals: StopSignals) -> None:
        """Listen until a time, a number of frames, or a signal."""
        self._until(port, end, signals)
        # Requests sent before the end may still be answered.
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
            if data and self._listener is not None:
                self._listener.hear(now, data)
            if data:
                monitor.receive(data, now)
            monitor.handle_timer(now)
            self._print()

    def _print(self) -> None:
        heard = self._monitor.heard
        if not heard:
            return
        if self._listener is not None:
            self._listener.found([found for each in heard if (found := _frame(each)) is not None])
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
        """Return the counts as one line."""
        return (
            f"{counted(self._frames, 'frame')}, {self._faults} of them damaged; "
            f"{counted(self._unanswered, 'request')} not answered; "
            f"{self._monitor.skipped} of {counted(self._monitor.bytes, 'byte')} outside frames"
        )


def _frame(heard: Heard) -> tuple[Framed | Fault, bytes] | None:
    """Return the message or the fault of an event, and its bytes; None if it has none."""
    match heard:
        case Asked():
            return heard.request, heard.frame
        case Replied():
            return heard.response, heard.frame
        case Stray():
            return heard.message, heard.message.to_frame()
        case Damaged():
            return heard.fault, bytes(heard.fault.raw)
        case Unanswered():
            return None
        case _:
            assert_never(heard)
