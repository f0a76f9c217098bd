"""Common parts of the commands that ask the nodes of a bus: their options, and the master at the port."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import NamedTuple, TypeVar

from qlinkgen.cli.tracing import trace_of, trace_option
from qlinkgen.cli.wire_options import (
    Parity,
    baud_option,
    echo_mode,
    echo_option,
    line_of,
    matching,
    open_usual,
    parity_option,
    slack_option,
    stop_bits_option,
)
from qlinkgen.link.events import Event
from qlinkgen.link.master import MasterEngine
from qlinkgen.model.protocol import Protocol
from qlinkgen.transport.blocking import BlockingMaster
from qlinkgen.transport.conversation import timing_of

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
    name: str,
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
        name: PROTOCOL, as given.
        protocol: the protocol.
        codec: its module.
        asking: the options.
        attempts: most transmissions of a request.
        on_event: called with each event of the engine.

    Raises:
        PortError: the port is missing or busy.
    """
    with contextlib.ExitStack() as ended:
        trace = trace_of(protocol, codec, port, ended, traced=asking.traced, record=None)
        line = line_of(asking.parity, asking.stop_bits, trace.hear if trace else None)
        opened = ended.enter_context(open_usual(protocol, port, asking.baud, line))
        timing = timing_of(codec, opened, slack=asking.slack, attempts=attempts)
        engine = MasterEngine(codec, timing, echo=echo_mode(protocol, asking.echo), accepts=matching(name))
        yield engine, BlockingMaster(engine, opened, on_event=on_event)
