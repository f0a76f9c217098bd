"""The Trio fibre-optic network: nodes of the ring, for blocking programs and for asyncio.

`MotionCoordinator` has the network commands of Trio BASIC as methods, `MembraneKeypad` keys and a display.
Each joins the ring at one port, and forwards messages for others. Messages and their errors are in
`qlinkgen.codecs.trio`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from qlinkgen.errors import NoRoom, NothingCame
from qlinkgen.link.ring_events import CommsError, NetStat
from qlinkgen.protocols.clients import asyncio_clients
from qlinkgen.protocols.trio.coordinator_node import CoordinatorNode
from qlinkgen.protocols.trio.display import Display
from qlinkgen.protocols.trio.keypad_node import KeypadNode
from qlinkgen.protocols.trio.nodes import MembraneKeypad, MotionCoordinator, PassiveNode
from qlinkgen.protocols.trio.printing import CHR, CURSOR, VALUE

if TYPE_CHECKING:
    from qlinkgen.protocols.trio.aio import AsyncMembraneKeypad, AsyncMotionCoordinator, AsyncPassiveNode

__all__ = [
    "CHR",
    "CURSOR",
    "VALUE",
    "AsyncMembraneKeypad",
    "AsyncMotionCoordinator",
    "AsyncPassiveNode",
    "CommsError",
    "CoordinatorNode",
    "Display",
    "KeypadNode",
    "MembraneKeypad",
    "MotionCoordinator",
    "NetStat",
    "NoRoom",
    "NothingCame",
    "PassiveNode",
]

__getattr__ = asyncio_clients(__name__, ("AsyncMembraneKeypad", "AsyncMotionCoordinator", "AsyncPassiveNode"))
