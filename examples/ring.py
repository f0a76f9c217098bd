"""A Trio ring without hardware: keypad, coordinator, a program at a pty, and every message on the wire.

Run it with ``make demo``, or separately with ``python examples/ring.py``. The program is another Motion
Coordinator: it opens the pty by its name, like /dev/ttyUSB0, and is between the last node and the first. So
    the
keypad is 10, the other coordinator 11, and the program itself 12.
"""

from __future__ import annotations

import sys

from qlinkgen.codecs import trio
from qlinkgen.protocols.trio import CHR, VALUE, CoordinatorNode, KeypadNode, MotionCoordinator
from qlinkgen.sim.port_ring import RingBus, ring_bus

BAUD = 38400
KEYPAD, OTHER, SELF = 10, 11, 12
#: SEND's types, and the channel of GET for unchanged characters.
VARIABLE, OFFSET, CHARACTERS = 1, 2, 4
#: Seconds; far more than a pty needs, so that the demo works on a busy machine.
PATIENCE = 30


def main() -> int:
    """Write on the display, read a key, set a variable, and show the messages on the wire."""
    keypad, other = KeypadNode(baud=BAUD), CoordinatorNode(baud=BAUD)
    ring = ring_bus([keypad, other], baud=BAUD)
    recorder = Recorder(ring)
    with ring, MotionCoordinator.open(ring.path, BAUD) as mc:
        print(f"a simulated ring at {ring.path}, {BAUD} baud: keypad, coordinator, and this program")
        mc.send(KEYPAD, OFFSET, 11)  # the receiver of its keys is two nodes after it: this program
        mc.print_(KEYPAD, CHR(12), "SPEED:", VALUE(150, 6, 0), end="")
        mc.send(OTHER, VARIABLE, 7, -0.25)
        mc.send(SELF, VARIABLE, 0, 42)  # once around: when it returns, all earlier messages have arrived
        mc.wait_until(lambda: mc.vr[0] == 42, PATIENCE)
        ring.call(lambda: press(ring, keypad, "5"))
        key = mc.get(CHARACTERS, PATIENCE)
        status = int(mc.netstat)
    print(f"  the keypad shows {keypad.display.lines[0]!r}, its key {chr(key)!r} was received")
    print(f"  VR(7) of the coordinator is {other.vr[7]}, VR(0) of the program {mc.vr[0]:g}, NETSTAT {status}")
    print("on the wire, each message on each fibre:")
    print("\n".join(recorder.lines))
    right = keypad.display.lines[0] == "SPEED:   150" and other.vr[7] == -0.25
    return 0 if right and key == ord("5") and not status else 1


def press(ring: RingBus, keypad: KeypadNode, key: str) -> None:
    """Press a key of a simulated keypad, in the thread that runs the ring."""
    keypad.press(key, ring.port.now())
    ring.wire.wake(keypad.link)


class Recorder:
    """Records the messages on each fibre of the ring."""

    def __init__(self, ring: RingBus) -> None:
        self.lines: list[str] = []
        self._decoders: dict[str, trio.StreamDecoder] = {}
        self._names = {"node 0": "from keypad", "node 1": "from coordinator"}
        self._start: float | None = None
        ring.wire.taps.append(self._hear)

    def _hear(self, at: float, source: str, data: bytes) -> None:
        if self._start is None:
            self._start = at
        for found in self._decoders.setdefault(source, trio.StreamDecoder()).feed(data):
            raw = found.raw if isinstance(found, trio.Fault) else found.to_frame()
            when, who = (at - self._start) * 1e3, self._names.get(source, "from program")
            self.lines.append(f"  {when:7.2f} ms  {who:16} {found!r}\n{'':14}{raw.hex(' ')}")


if __name__ == "__main__":
    sys.exit(main())
