"""``qlinkgen simulate`` for a host: the device at the end of a serial link."""

from __future__ import annotations

from contextlib import ExitStack

from qlinkgen.cli.behaviour import Behaviour, Nodes
from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.codec import load_codec
from qlinkgen.cli.common import load_protocol
from qlinkgen.cli.hosting import check_resync
from qlinkgen.cli.simulating import port_of, run_bus, say, watch_line
from qlinkgen.cli.wire_options import counted
from qlinkgen.link.device import DeviceEngine
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import plan_of
from qlinkgen.protocols.registry import support_of
from qlinkgen.sim import FaultPlan, Wire


def simulate_host(
    name: str,
    *,
    link: str | None,
    listen: str | None,
    baud: int | None,
    plan: FaultPlan | None,
    behaviour: Behaviour,
    record: str | None,
) -> None:
    """Run the device of a protocol on a pty until a signal."""
    from qlinkgen.sim.pty_bus import PtyBus  # noqa: PLC0415  # needs a system that has ptys

    loaded = load_protocol(name)
    written = support_of(loaded).device()
    if written is not None and behaviour:
        raise Failure(
            f"{written.what} behaves as documented, and takes no values; omit --value, --values, --memory "
            "and --delay"
        )
    engine = _device(loaded, behaviour) if written is None else written.engine
    port = port_of(listen, link, baud)
    bits = loaded.bus.bits_per_byte
    wire = Wire(
        baud=baud,
        bits_per_byte=bits,
        faults=plan,
        chunks="byte" if baud is not None else "frame",
        collisions=False,  # a line for each direction
    )
    wire.attach(engine, "device")
    with ExitStack() as ended:
        if record is not None:
            codec, where = load_codec(loaded), link or f"simulated {loaded.name}"
            watch_line(wire, loaded, codec, where, ended, traced=False, record=record)
        run_bus(PtyBus(wire, link=link, port=port), link, written.what if written else f"a device of {name}")
    for line in written.report() if written else ():
        say(line, None)
    seen = engine.counters
    say(
        f"{counted(seen.packets, 'packet')} executed, {seen.illegal} illegal, "
        f"{seen.out_of_range} out of range",
        plan,
    )


def _device(protocol: Protocol, behaviour: Behaviour) -> DeviceEngine:
    check_resync(protocol)
    codec = load_codec(protocol)
    made = Nodes(protocol, codec, plan_of(protocol), behaviour)
    engine = DeviceEngine(codec, made.node())
    engine.delays = made.delays
    return engine
