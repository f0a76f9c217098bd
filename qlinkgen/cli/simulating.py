"""Common parts of all simulations: faults from the command line, running a pty, the summary."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from contextlib import ExitStack
from types import ModuleType
from typing import TYPE_CHECKING

import click

from qlinkgen.captures.recording import Recording
from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.stopping import StopSignals
from qlinkgen.cli.tracing import FibreTrace, LineTrace, Printer, Tell, Trace, keep
from qlinkgen.cli.wire_options import ANY_SPEED, counted
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.values import whole_number
from qlinkgen.sim import OUTSIDE, FaultPlan, FaultPlanError, Wire
from qlinkgen.sim.wire import Tap
from qlinkgen.transport.listening import ListeningPort

if TYPE_CHECKING:
    from qlinkgen.sim.pty_bus import PtyBus


#: A host in brackets is an address of IPv6.
_LISTEN = re.compile(r"tcp:((?P<host>\[[^\]]+\]|[^:\[\]]+):)?(?P<port>[0-9]{1,5})")


def plan_of(text: str | None, seed: int | None) -> FaultPlan | None:
    """Return the faults of ``--faults`` and ``--seed``."""
    if text is None:
        return None
    try:
        plan = FaultPlan.parse(text)
        if seed is None:
            return plan
        return FaultPlan.parse(f"{text},seed={seed}")
    except FaultPlanError as error:
        raise Failure(f"--faults {text}: {error}") from None


def watch_line(
    wire: Wire,
    protocol: Protocol,
    codec: ModuleType,
    name: str,
    ended: ExitStack,
    *,
    traced: bool,
    record: str | None,
) -> None:
    """Print or record the requests and answers of a line until `ended`; `name` is that of the port."""
    tells: list[Tell] = [Printer(protocol, "request", "answer")] if traced else []
    if record is not None:
        recording = ended.enter_context(Recording(record))
        tells.append(keep(recording.port(name, codec, speed=wire.baud), turned=True))
    if not tells:
        return
    trace = LineTrace(protocol, codec, *tells, baud=wire.baud or protocol.bus.baud or ANY_SPEED)
    ended.callback(trace.end)
    wire.taps.append(lambda at, source, data: trace.hear(at, source == OUTSIDE, data))


def ring_tap(
    protocol: Protocol,
    codec: ModuleType,
    ended: ExitStack,
    *,
    record: str,
    baud: int | None,
    clock: Callable[[], float],
) -> Tap:
    """Return what records each fibre of a ring until `ended`, as an interface named after who sends on it."""
    recording = ended.enter_context(Recording(record))
    fibres: dict[str, Trace] = {}

    def tap(at: float, source: str, data: bytes) -> None:
        if source not in fibres:
            port = recording.port(source, codec, speed=baud, clock=clock)
            fibres[source] = FibreTrace(protocol, codec, keep(port))
            ended.callback(fibres[source].end)
        fibres[source].hear(at, True, data)

    return tap


def port_of(listen: str | None, link: str | None, baud: int | None) -> ListeningPort | None:
    """Return the port of ``--listen``, None for a pty."""
    if listen is None:
        if sys.platform == "win32":
            raise Failure("this system has no ptys; add --listen tcp:0, and pass the URL that is printed")
        return None
    if link is not None:
        raise Failure(f"--link {link}: a TCP port has no link; omit --link or --listen")
    found = _LISTEN.fullmatch(listen)
    number = whole_number(found["port"]) if found else None
    if found is None or number is None or number > 65535:
        raise Failure(
            f"--listen {listen}: write tcp:PORT or tcp:HOST:PORT with a port of 0..65535, 0 for a free one"
        )
    host = found["host"] or "127.0.0.1"
    return ListeningPort(host.strip("[]"), number, baud=baud or ANY_SPEED)


def run_bus(bus: PtyBus, link: str | None, what: str) -> None:
    """Print the path of the port, run until a signal, and close the port."""
    try:
        with StopSignals(bus.request_stop):
            say_port(bus.path, link, what)
            bus.run()
    finally:
        bus.close()


def say_port(path: str | None, link: str | None, what: str) -> None:
    """Print the first lines of a simulation, the first one for scripts."""
    click.echo(json.dumps({"port": path}))
    where = "" if path is None else f" on {path}" if link is None else f" on {path}, linked as {link}"
    say(f"{what}{where}; press Ctrl-C to stop", None)


def say(text: str, plan: FaultPlan | None) -> None:
    """Print a line of the summary, with the injected faults if a plan is given."""
    click.echo(f"qlinkgen: {text}{_faults(plan)}", err=True)


def _faults(plan: FaultPlan | None) -> str:
    if plan is None:
        return ""
    kinds = ", ".join(f"{kind} {plan.counts[kind]}" for kind in plan.rates if plan.counts[kind])
    return f", {counted(plan.counts.total, 'fault')}{kinds and f' ({kinds})'}; seed {plan.seed}"
