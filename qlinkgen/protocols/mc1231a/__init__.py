"""The MC1231A chip set: hosts, blocking and for asyncio, and a simulated chip set.

`Host` and `AsyncHost` send packets, a `ChipSet` with a `ChipEngine` answers. Messages and their errors are in
`qlinkgen.codecs.mc1231a`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from qlinkgen.bus.options import Checksum
from qlinkgen.protocols.clients import asyncio_clients
from qlinkgen.protocols.mc1231a.chip import ChipSet
from qlinkgen.protocols.mc1231a.chip_engine import ChipEngine
from qlinkgen.protocols.mc1231a.host import Axis, Host
from qlinkgen.protocols.mc1231a.usage import UnconfirmedCommand

if TYPE_CHECKING:
    from qlinkgen.protocols.mc1231a.aio import AsyncAxis, AsyncHost

__all__ = [
    "AsyncAxis",
    "AsyncHost",
    "Axis",
    "Checksum",
    "ChipEngine",
    "ChipSet",
    "Host",
    "UnconfirmedCommand",
]

__getattr__ = asyncio_clients(__name__, ("AsyncAxis", "AsyncHost"))
