"""``qlinkgen simulate mc1231a``: a chip set at the end of a serial link."""

from __future__ import annotations

from contextlib import ExitStack

from qlinkgen.cli.common import load_protocol
from qlinkgen.cli.simulating import port_of, run_bus, say, watch_line
from qlinkgen.cli.wire_options import counted
from qlinkgen.codecs import mc1231a
from qlinkgen.protocols.mc1231a import ChipEngine, ChipSet
from qlinkgen.sim import FaultPlan
from qlinkgen.sim.chip_bus import chip_wire


def simulate_host(
    *, link: str | None, listen: str | None, baud: int | None, plan: FaultPlan | None, record: str | None
) -> None:
    """Run the chip set on a pty until a signal."""
    from qlinkgen.sim.pty_bus import PtyBus  # noqa: PLC0415  # needs a system that has ptys

    port = port_of(listen, link, baud)
    chip = ChipEngine(ChipSet())
    wire = chip_wire(chip, baud=baud, faults=plan, chunks="byte" if baud is not None else "frame")
    with ExitStack() as ended:
        if record is not None:
            loaded = load_protocol("mc1231a")
            watch_line(wire, loaded, mc1231a, link or "simulated mc1231a", ended, traced=False, record=record)
        run_bus(PtyBus(wire, link=link, port=port), link, "an mc1231a chip set")
    for number, axis in chip.chip.axes.items():
        say(f"axis {number}: position {axis.actual}, status 0x{axis.status:04X}", None)
    seen = chip.counters
    say(
        f"{counted(seen.packets, 'packet')} executed, {seen.illegal} illegal, "
        f"{seen.out_of_range} out of range",
        plan,
    )
