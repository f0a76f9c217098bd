"""Simulation: lines with faults, virtual clocks, buses on ptys.

`pty_bus` is not imported here: it needs a POSIX system, the rest does not.
"""

from __future__ import annotations

from qlinkgen.sim.echo import Echo
from qlinkgen.sim.errors import FaultPlanError, SimulationError
from qlinkgen.sim.faults import FaultPlan
from qlinkgen.sim.virtual import VirtualPort
from qlinkgen.sim.wire import LINE, OUTSIDE, Engine, Wire

__all__ = [
    "LINE",
    "OUTSIDE",
    "Echo",
    "Engine",
    "FaultPlan",
    "FaultPlanError",
    "SimulationError",
    "VirtualPort",
    "Wire",
]
