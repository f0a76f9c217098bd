"""Keyword arguments of the clients of a Q.link bus."""

from __future__ import annotations

from qlinkgen.bus.options import BusOptions
from qlinkgen.protocols.qlink.motion import Repeats


class QlinkOptions(BusOptions, total=False):
    """Options of `Bus` and `AsyncBus`, with which `open` makes one; `Bus` says what its own ones mean."""

    crc: str | None
    repeats: Repeats
