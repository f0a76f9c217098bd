"""Protocol engines without input or output, clock or threads.

They take bytes and times as arguments and return bytes and events, so they run under any driver, and on a
simulated clock.
"""

from __future__ import annotations

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
