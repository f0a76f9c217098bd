"""An MC1231A chip set on a simulated serial link: on a virtual clock, or on a pty.

wire = chip_wire(ChipSet())
host = Host(VirtualPort(wire))                    # on a virtual clock
with PtyBus(wire, link="chip") as bus: ...        # for any program, in real time
"""

from __future__ import annotations

from qlinkgen.protocols.mc1231a.chip import ChipSet
from qlinkgen.protocols.mc1231a.chip_engine import ChipEngine
from qlinkgen.sim.faults import FaultPlan
from qlinkgen.sim.wire import Chunks, Wire

__all__ = ["chip_wire"]


def chip_wire(
    chip: ChipSet | ChipEngine,
    *,
    baud: int | None = 115200,
    faults: FaultPlan | None = None,
    chunks: Chunks = "frame",
    forgets: float = 0.0,
) -> Wire:
    """Return a link with a chip set at its end, for a `VirtualPort` or a `PtyBus`.

    Args:
        chip: the chip set, or a configured engine of it.
        baud: bits per second, or None for an unpaced link.
        faults: faults of the link; "slaves" is the chip set, "master" the host.
        chunks: chunks in which bytes arrive; see `Wire`.
        forgets: seconds of silence after which the chip's end discards an incomplete packet; 0: never.
    """
    engine = chip if isinstance(chip, ChipEngine) else ChipEngine(chip, forgets=forgets)
    wire = Wire(baud=baud, faults=faults, chunks=chunks, collisions=False)  # a line for each direction
    wire.attach(engine, "chip set")
    return wire
