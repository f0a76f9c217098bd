"""A Q.link bus without hardware: nodes on a pty, a master that moves them, and every frame on the wire.

Run it with ``make demo``, or separately with ``python examples/bus.py``. The master opens the pty by its
name, like /dev/ttyUSB0, and works in the same way on a real bus. Its traffic is recorded if a file is named.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from contextlib import ExitStack

from qlinkgen.captures.recording import Recording
from qlinkgen.codecs import qlink
from qlinkgen.link import Monitor, SlaveEngine, Timing
from qlinkgen.link.codec import address_of
from qlinkgen.link.monitor import Asked, Heard, Replied
from qlinkgen.protocols.qlink import Bus, VirtualNode
from qlinkgen.sim import Wire
from qlinkgen.sim.pty_bus import PtyBus

BAUD = 115200
#: Far more than a pty needs, so that the demo works on a busy machine.
SLACK = 0.5
#: A ramp up and down: each word is a displacement in encoder counts.
PATH = [*range(0, 60, 5), *range(60, 0, -5)]


def main() -> int:
    """Scan the bus, move a motor, and show the frames on the wire."""
    nodes = {
        number: VirtualNode(
            number, position_type=qlink.PositionType.JVL_MACTALK, rate=400, serial_number=1000 + number
        )
        for number in (1, 3, 7)
    }
    recorder = Recorder()
    with ExitStack() as ended:
        line = ended.enter_context(simulated(nodes, recorder))
        recording = ended.enter_context(Recording(sys.argv[1])) if len(sys.argv) > 1 else None
        on_frame = recording.port(line.path, qlink, speed=BAUD) if recording else None
        bus = ended.enter_context(Bus.open(line.path, slack=SLACK, on_frame=on_frame))
        print(f"a simulated bus at {line.path}, {BAUD} baud")
        for found in bus.scan(nodes):
            assert found.info is not None
            print(f"  node {found.node}: version {found.info.version_major}.{found.info.version_minor}, "
                  f"serial number {found.info.serial_number}")  # fmt: skip
        node = bus.node(3)
        recorder.clear()
        node.node_start()
        print(f"moving node 3 along {len(PATH)} words, {sum(PATH)} counts in all")
        for _ in bus.stream_motion({3: PATH}):
            pass
        while (state := node.motion()).motor_status & qlink.MotorStatus.RUNNING:
            bus.port.sleep(0.01)
        print(f"  position {state.position}")
        shown = recorder.lines()
        counters = bus.engine.total
    print("on the wire, the first and the last frames:")
    print("\n".join([*shown[:6], "  ...", *shown[-2:]]))
    print(f"{counters.requests} requests, {counters.answers} answers, {counters.timeouts} timeouts")
    return 0 if state.position == sum(PATH) else 1


def simulated(nodes: Mapping[int, VirtualNode], recorder: Recorder) -> PtyBus:
    """Nodes on a paced line with a pty."""
    wire = Wire(baud=BAUD, chunks="byte")
    for node in nodes.values():
        wire.attach(SlaveEngine(qlink, node))
    wire.taps.append(lambda at, _source, data: recorder.monitor.receive(data, at))
    return PtyBus(wire)


class Recorder:
    """Records the frames on the line."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Discard the recorded frames."""
        self.monitor = Monitor(qlink, Timing.of(qlink, host_slack=SLACK))

    def lines(self) -> list[str]:
        """One line for each frame."""
        heard = list(self.monitor.heard)
        return [f"  {(entry.at - heard[0].at) * 1e3:7.2f} ms  {_described(entry)}" for entry in heard]


def _described(entry: Heard) -> str:
    if isinstance(entry, Asked):
        return f"master  {entry.request!r}\n{'':14}{entry.frame.hex(' ')}"
    if isinstance(entry, Replied):
        return f"node {address_of(entry.response)}  {entry.response!r}\n{'':14}{entry.frame.hex(' ')}"
    return repr(entry)


if __name__ == "__main__":
    sys.exit(main())
