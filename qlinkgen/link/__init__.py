"""Protocol engines without input or output, clock or threads.

They take bytes and times as arguments and return bytes and events, so they run under any driver, and on a
simulated clock.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from qlinkgen.link.counters import LinkCounters
    from qlinkgen.link.dialogue import Dialogue
    from qlinkgen.link.echo import EchoMode
    from qlinkgen.link.events import Event
    from qlinkgen.link.health import HealthPolicy
    from qlinkgen.link.master import MasterEngine
    from qlinkgen.link.monitor import Monitor
    from qlinkgen.link.peer import PeerEngine
    from qlinkgen.link.procedure import Ask, Pause, Procedure, Tell
    from qlinkgen.link.slave import PENDING, Node, Refusal, SlaveEngine
    from qlinkgen.link.timing import Timing
    from qlinkgen.link.transaction import Reply

__all__ = [
    "PENDING",
    "Ask",
    "Dialogue",
    "EchoMode",
    "Event",
    "HealthPolicy",
    "LinkCounters",
    "MasterEngine",
    "Monitor",
    "Node",
    "Pause",
    "PeerEngine",
    "Procedure",
    "Refusal",
    "Reply",
    "SlaveEngine",
    "Tell",
    "Timing",
]

#: Names to the modules that have them, which are imported on use: decoding needs no engine.
_MODULES = {
    "LinkCounters": "counters",
    "Dialogue": "dialogue",
    "EchoMode": "echo",
    "Event": "events",
    "HealthPolicy": "health",
    "MasterEngine": "master",
    "Monitor": "monitor",
    "PeerEngine": "peer",
    "Ask": "procedure",
    "Pause": "procedure",
    "Procedure": "procedure",
    "Tell": "procedure",
    "PENDING": "slave",
    "Node": "slave",
    "Refusal": "slave",
    "SlaveEngine": "slave",
    "Timing": "timing",
    "Reply": "transaction",
}


def __getattr__(name: str) -> object:
    if name in _MODULES:
        found: object = getattr(importlib.import_module(f"{__name__}.{_MODULES[name]}"), name)
        return found
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
