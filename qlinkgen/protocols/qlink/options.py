"""Keyword arguments of the clients of a Q.link bus."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypedDict

from qlinkgen.link.echo import EchoMode
from qlinkgen.link.events import Event
from qlinkgen.link.health import HealthPolicy
from qlinkgen.protocols.qlink.motion import Repeats


class BusOptions(TypedDict, total=False):
    """Options of `Bus` and `AsyncBus`, with which `open` makes one; `Bus` says what they mean."""

    attempts: int
    echo: EchoMode
    health: HealthPolicy | None
    slack: float | None
    crc: str | None
    repeats: Repeats
    on_event: Callable[[Event], None] | None
