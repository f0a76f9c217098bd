"""Two Motion Coordinators and a keypad on a simulated ring: one prompts the operator, and commands the other.

This is Example 2 of the Trio fibre-optic network document, rewritten. The ring is the master with three axes,
the slave with two, and the keypad. The slave must not send through the keypad before the keypad has its
offset: it waits for an "I", which the master sends after the offset. Run it with ``python
examples/trio_two_coordinators.py``; time is simulated, so it does not wait.

The document's listing leaves the cursor after the feed length; here `CURSOR(40)` puts the speed on a separate
row, which gives the place 46 that the listing updates.
"""

from __future__ import annotations

import sys

from qlinkgen.protocols.trio import CHR, CURSOR, VALUE, MembraneKeypad, MotionCoordinator
from qlinkgen.sim.virtual_ring import VirtualRing

#: Seen from the master.
SLAVE, KEYPAD = 10, 11
#: Seen from the slave; the keypad is between.
MASTER = 11
#: Variables: feed length and speed on both, the latest key, and the slave's report to the master.
FEED, SPEED, KEY, REPORT = 0, 1, 100, 200
READY, STARTED = 99, 999
MORE, LESS, ENTER, START = 10, 11, 13, 20


def master(mc: MotionCoordinator) -> None:
    """The program on the coordinator with three axes."""
    vr = mc.vr
    mc.send(KEYPAD, 2, 10)
    mc.print_(KEYPAD, CHR(12), CHR(14), "INITIALISING.....")
    mc.print_(SLAVE, "I", end="")
    mc.wait_until(lambda: vr[REPORT] == READY)
    mc.print_(KEYPAD, CHR(12), CHR(14), "MACHINE READY")

    mc.print_(KEYPAD, "FEED LENGTH:", VALUE(vr[FEED], 6, 1), end="")
    while (pressed := read_key(mc)) != ENTER:
        if pressed == MORE and vr[FEED] < 1_000_000:
            vr[FEED] += 0.1
        if pressed == LESS and vr[FEED] > 0.1:
            vr[FEED] -= 0.1
        mc.print_(KEYPAD, CHR(27), CHR(72), CHR(32), VALUE(vr[FEED], 6, 1), end="")

    mc.print_(KEYPAD, CURSOR(40), "SPEED:", VALUE(vr[SPEED], decimals=2), end="")
    while (pressed := read_key(mc)) != ENTER:
        if pressed == MORE and vr[SPEED] < 100:
            vr[SPEED] += 0.01
        if pressed == LESS and vr[SPEED] > 0.01:
            vr[SPEED] -= 0.01
        mc.print_(KEYPAD, CHR(27), CHR(72), CHR(46), VALUE(vr[SPEED], decimals=2), end="")

    mc.send(SLAVE, 1, FEED, vr[FEED])
    mc.send(SLAVE, 1, SPEED, vr[SPEED])
    mc.print_(KEYPAD, CHR(12), CHR(14), "PRESS START TO RUN")
    while read_key(mc) != START:
        pass
    mc.print_(SLAVE, "G", end="")
    mc.wait_until(lambda: vr[REPORT] == STARTED)


def read_key(mc: MotionCoordinator) -> int:
    """Wait for a key, and keep it in its variable."""
    mc.vr[KEY] = mc.get(3)
    return int(mc.vr[KEY])


def slave(mc: MotionCoordinator) -> float:
    """The program on the coordinator with two axes; returns the speed at which it starts to move."""
    wait_for(mc, "I")
    mc.send(MASTER, 1, REPORT, READY)
    wait_for(mc, "G")
    speed = mc.vr[SPEED]
    mc.send(MASTER, 1, REPORT, STARTED)
    return speed


def wait_for(mc: MotionCoordinator, character: str) -> None:
    """Drop characters until a given one is received."""
    while True:
        mc.vr[KEY] = mc.get(4)
        if mc.vr[KEY] == ord(character):
            return


def operator(keypad: MembraneKeypad) -> list[list[str]]:
    """Set both values and start the machine; return the displayed screens."""
    shown = []
    keypad.wait_until(lambda: "FEED LENGTH" in keypad.lines[1])
    shown.append(keypad.lines)
    press(keypad, *[MORE] * 26, LESS, ENTER)
    keypad.wait_until(lambda: "SPEED" in keypad.lines[2])
    press(keypad, MORE, MORE, MORE)
    shown.append(keypad.lines)
    press(keypad, ENTER)
    keypad.wait_until(lambda: keypad.lines[0] == "PRESS START TO RUN")
    press(keypad, ENTER, START)  # it ignores the first key
    return shown


def press(keypad: MembraneKeypad, *keys: int) -> None:
    """Press keys at a realistic speed."""
    for key in keys:
        keypad.press(key)
        keypad.sleep(0.1)


def main() -> int:
    """Run the ring, and check its final state."""
    ring = VirtualRing("coordinator,coordinator,keypad", baud=38400)
    three_axes, two_axes, keypad = ring.coordinator(0), ring.coordinator(1), ring.keypad(2)
    speeds: list[float] = []
    shown: list[list[str]] = []
    ring.run(
        lambda: master(three_axes),
        lambda: speeds.append(slave(two_axes)),
        lambda: shown.extend(operator(keypad)),
    )
    ring.settle()
    for lines in [*shown, keypad.lines]:
        print("\n".join([f"|{line:20}|" for line in lines]), end="\n\n")
    assert shown[0] == ["MACHINE READY", "FEED LENGTH:   0.0", "", ""]
    assert shown[1] == ["MACHINE READY", "FEED LENGTH:   2.5", "SPEED:0.03", ""]
    assert keypad.lines == ["PRESS START TO RUN", "", "", ""]
    print(f"the slave starts with feed length {two_axes.vr[FEED]:.1f} and speed {speeds[0]:.2f}")
    assert round(two_axes.vr[FEED], 6) == 2.5
    assert round(speeds[0], 6) == 0.03
    assert three_axes.vr[REPORT] == STARTED
    assert three_axes.vr[KEY] == START
    assert two_axes.vr[KEY] == ord("G")
    assert three_axes.netstat == two_axes.netstat == 0
    return 0


if __name__ == "__main__":
    sys.exit(main())
