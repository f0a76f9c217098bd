"""Q.link on the wire: masters, blocking and for asyncio, and a simulated slave.

`Bus` and `AsyncBus` are masters, `VirtualNode` is a slave. Messages and their errors are in
`qlinkgen.codecs.qlink`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from qlinkgen.protocols.clients import asyncio_clients
from qlinkgen.protocols.qlink.bus import Bus, Node
from qlinkgen.protocols.qlink.loading import LoadProgress, LoadReport
from qlinkgen.protocols.qlink.motion import MotionProgress
from qlinkgen.protocols.qlink.pacing import SyncReport, SyncTick
from qlinkgen.protocols.qlink.survey import Found, NodeStatus
from qlinkgen.protocols.qlink.virtual_node import VirtualNode

if TYPE_CHECKING:
    from qlinkgen.protocols.qlink.aio import AsyncBus, AsyncNode

__all__ = [
    "AsyncBus",
    "AsyncNode",
    "Bus",
    "Found",
    "LoadProgress",
    "LoadReport",
    "MotionProgress",
    "Node",
    "NodeStatus",
    "SyncReport",
    "SyncTick",
    "VirtualNode",
]

__getattr__ = asyncio_clients(__name__, ("AsyncBus", "AsyncNode"))
