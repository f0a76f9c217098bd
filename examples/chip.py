"""An MC1231A chip set without hardware: a pty, a host that moves an axis, and every packet on the wire.

Run it with ``make demo``, or separately with ``python examples/chip.py``. The host opens the pty by its name,
like /dev/ttyUSB0.
"""

from __future__ import annotations

import sys

from qlinkgen.codecs import mc1231a
from qlinkgen.codecs.mc1231a import AxisStatus
from qlinkgen.errors import CommandError
from qlinkgen.protocols.mc1231a import ChipSet, Host
from qlinkgen.sim import OUTSIDE
from qlinkgen.sim.chip_bus import chip_wire
from qlinkgen.sim.pty_bus import PtyBus

BAUD = 57600
#: Far more than a pty needs, so that the demo works on a busy machine.
SLACK = 0.5
TARGET = 3000
#: Commands by the first byte of a packet.
NAMES = {command.id: name for name, command in mc1231a.COMMANDS.items()}


def main() -> int:
    """Move axis 2, try an invalid change, and show the packets on the wire."""
    wire = chip_wire(ChipSet(), baud=BAUD)
    recorder = Recorder()
    wire.taps.append(recorder.hear)
    with PtyBus(wire) as line, Host.open(line.path, baud=BAUD, slack=SLACK, command_errors=True) as host:
        print(f"a simulated chip set at {line.path}, {BAUD} baud")
        axis = host.axis(2)
        axis.set_prfl_trap()
        axis.set_pos(value=TARGET)
        axis.set_vel(value=2.75)
        axis.set_acc(value=0.01)
        axis.update()
        print(f"moving axis 2 to {TARGET} counts, at most 2.75 per sample")
        axis.set_acc(value=0.02)  # invalid while the axis moves: dropped, with a bit in the status word
        try:
            axis.update()
        except CommandError as error:
            print(f"  {error}")
        while axis.get_status().status & AxisStatus.IN_MOTION:
            host.port.sleep(0.05)
        position = axis.get_actl_pos().value
        counters = host.engine.total
    print(f"  position {position}")
    print("on the wire, the first and the last packets:")
    print("\n".join([*recorder.lines[:14], "  ...", *recorder.lines[-4:]]))
    print(f"{counters.requests} packets, {counters.answers} answers, {counters.timeouts} timeouts")
    return 0 if position == TARGET else 1


class Recorder:
    """Records both lines: one line of text for each packet and each answer."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self._start: float | None = None

    def hear(self, at: float, source: str, data: bytes) -> None:
        """Record received bytes; each packet and each answer is sent in one piece."""
        if self._start is None:
            self._start = at
        who = f"host  {NAMES.get(data[0], '?'):16}" if source == OUTSIDE else f"chip  {'':16}"
        self.lines.append(f"  {(at - self._start) * 1e3:7.2f} ms  {who} {data.hex(' ')}")


if __name__ == "__main__":
    sys.exit(main())
