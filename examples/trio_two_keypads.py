"""One Motion Coordinator and two keypads on a simulated ring: both operators set the same speed and length.

This is Example 1 of the Trio fibre-optic network document, rewritten. The ring is coordinator, first keypad,
second keypad; keys of the first pass through the second. Run it with ``python examples/trio_two_keypads.py``;
time is simulated, so it does not wait.

Two lines differ from the document's. The display is cleared without a line end (a semicolon in BASIC), since
the numbers go to the first two rows; and key 11 decreases the length, where the listing has a plus.
"""

from __future__ import annotations

import sys
from collections.abc import Callable

from qlinkgen.protocols.trio import CHR, CURSOR, VALUE, MembraneKeypad, MotionCoordinator
from qlinkgen.sim.virtual_ring import VirtualRing

FIRST, SECOND = 10, 11
KEYPADS = (FIRST, SECOND)
#: VR(2) holds the length.
LENGTH = 2
#: Values of the keys "0" to "9", "+" and "-" in the DEFKEY table.
MORE, LESS = 10, 11


class Machine:
    """The program on the Motion Coordinator."""

    def __init__(self, mc: MotionCoordinator) -> None:
        self.mc = mc
        self.speed = 0
        self.turns = 0

    def start(self) -> None:
        """Put the keypads into network mode, then draw the fixed text of their displays."""
        mc = self.mc
        mc.send(FIRST, 2, 11)  # the receiver of its keys is two nodes after it, past the second keypad
        mc.send(SECOND, 2, 10)
        mc.defkey("0", *range(10))
        mc.defkey("+", MORE)
        mc.defkey("-", LESS)
        for keypad in KEYPADS:
            mc.print_(keypad, CHR(12), CHR(14), CHR(20), end="")
            mc.print_(keypad, "SPEED:")
            mc.print_(keypad, "LENGTH:")

    def run(self, ended: Callable[[], bool]) -> None:
        """Read keys, and move the machine in between."""
        while not ended():
            if self.mc.key(3):
                self.read_key()
            else:
                self.turns += 1  # the main motion routine

    def read_key(self) -> None:
        """Append a digit to the speed, or change the length by a step."""
        mc = self.mc
        key = mc.get(3)
        if key <= 9:
            self.speed = self.speed * 10 + key
            if self.speed > 9999:
                self.speed = 0
            for keypad in KEYPADS:
                mc.print_(keypad, CHR(27), CHR(72), CHR(7), VALUE(self.speed, 6, 0))
        if key == MORE and mc.vr[LENGTH] < 10000:
            mc.vr[LENGTH] += 0.1
        if key == LESS and mc.vr[LENGTH] > 0.1:
            mc.vr[LENGTH] -= 0.1
        for keypad in KEYPADS:
            mc.print_(keypad, CURSOR(28), VALUE(mc.vr[LENGTH], 8, 1))


def operators(first: MembraneKeypad, second: MembraneKeypad) -> None:
    """Type a speed at one end of the machine, change the length at both."""
    second.wait_until(lambda: second.lines[1] == "LENGTH:")
    for keypad, key in (
        (first, "1"),
        (first, "5"),
        (second, "0"),
        *[(second, "+")] * 3,
        (first, "+"),
        (first, "-"),
    ):
        keypad.press(key)
        keypad.sleep(0.1)


def main() -> int:
    """Run the ring, and check its final state."""
    ring = VirtualRing("coordinator,keypad,keypad", baud=38400)
    mc, first, second = ring.coordinator(0), ring.keypad(1), ring.keypad(2)
    machine = Machine(mc)
    done: list[bool] = []

    def machine_program() -> None:
        machine.start()
        machine.run(lambda: bool(done))

    def operator_program() -> None:
        operators(first, second)
        done.append(True)

    ring.run(machine_program, operator_program)
    ring.settle()
    for name, keypad in (("first", first), ("second", second)):
        print(f"{name} keypad\n{keypad}")
        assert keypad.lines == ["SPEED:    150", "LENGTH:      0.3", "", ""], keypad.lines
        assert not keypad.node.display.cursor_visible
    print(f"VR({LENGTH}) = {mc.vr[LENGTH]:.1f}, speed {machine.speed}, NETSTAT {int(mc.netstat)}")
    assert machine.speed == 150
    assert round(mc.vr[LENGTH], 6) == 0.3
    assert machine.turns > 0
    assert mc.netstat == 0
    return 0


if __name__ == "__main__":
    sys.exit(main())
