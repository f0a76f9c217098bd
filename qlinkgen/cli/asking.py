"""Common parts of the commands that ask the nodes of a bus: their options, and the master at the port."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import NamedTuple, TypeVar

from qlinkgen.bus.making import make_host
from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.hosting import check_resync
from qlinkgen.cli.tracing import trace_of, trace_option
from qlinkgen.cli.wire_options import (
    Parity,
    baud_option,
    echo_mode,
    echo_option,
    line_of,
    open_free,
    open_usual,
    parity_option,
    slack_option,
    stop_bits_option,
)
from qlinkgen.link.events import Event
from qlinkgen.link.host import HostEngine
from qlinkgen.link.master import MasterEngine
from qlinkgen.model.protocol import Protocol
from qlinkgen.protocols.registry import support_of
from qlinkgen.transport.blocking import BlockingMaster
from qlinkgen.transport.conversation import timing_of
from qlinkgen.transport.port import Port

R = TypeVar("R")


class Asking(NamedTuple):
    """The options of a master at a port."""

    baud: int | None
    slack: float | None
    echo: str | None
    parity: Parity
    stop_bits: str
    traced: bool


def asking_options(command: Callable[..., R]) -> Callable[..., R]:
    """Add the options of a master at a port to a command, which takes them as `asking`."""

    @functools.wraps(command)
    def merged(**options: object) -> R:
        own = {name: options.pop(name) for name in Asking._fields}
        return command(**options, asking=Asking(**own))  # type: ignore[arg-type]  # click has checked them

    for option in (trace_option, stop_bits_option, parity_option, echo_option, slack_option, baud_option):
        merged = option(merged)
    return merged


@contextlib.contextmanager
def master_at(  # what a master consists of
    port: str,
    protocol: Protocol,
    codec: ModuleType,
    asking: Asking,
    *,
    attempts: int = 3,
    on_event: Callable[[Event], None] | None = None,
) -> Iterator[tuple[MasterEngine, BlockingMaster]]:
    """Open a port, and make the engine and the driver of a master at it.

    Args:
        port: name of the port.
        protocol: the protocol.
        codec: its module.
        asking: the options.
        attempts: most transmissions of a request.
        on_event: called with each event of the engine.

    Raises:
        PortError: the port is missing or busy.
    """
    with _opened(port, protocol, codec, asking) as opened:
        timing = timing_of(codec, opened, slack=asking.slack, attempts=attempts)
        accepts = support_of(protocol).accepts()
        engine = MasterEngine(codec, timing, echo=echo_mode(protocol, asking.echo), accepts=accepts)
        yield engine, BlockingMaster(engine, opened, on_event=on_event)


@contextlib.contextmanager
def host_at(
    port: str, protocol: Protocol, codec: ModuleType, asking: Asking, *, attempts: int = 3
) -> Iterator[tuple[HostEngine, BlockingMaster]]:
    """Do the same for the host of a device, which takes no echo.

    Raises:
        Failure: the schema does not say how the host comes back in step.
        PortError: the port is missing or busy.
    """
    check_resync(protocol)
    if asking.echo is not None:
        raise Failure(f"--echo requires a bus with a master; {protocol.name} has one host and one device")
    with _opened(port, protocol, codec, asking) as opened:
        engine = make_host(codec, opened, attempts=attempts, slack=asking.slack)
        yield engine, BlockingMaster(engine, opened)


@contextlib.contextmanager
def _opened(port: str, protocol: Protocol, codec: ModuleType, asking: Asking) -> Iterator[Port]:
    with contextlib.ExitStack() as ended:
        trace = trace_of(protocol, codec, port, ended, traced=asking.traced, record=None)
        line = line_of(asking.parity, asking.stop_bits, trace.hear if trace else None)
        opener = open_free if protocol.bus.kind == "host" else open_usual
        yield ended.enter_context(opener(protocol, port, asking.baud, line))
