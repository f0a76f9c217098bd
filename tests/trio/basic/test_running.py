"""What each word does, on a ring with simulated time."""

from __future__ import annotations

import pytest

from qlinkgen.bus.ring_status import TX_TIMEOUT
from qlinkgen.link.ring_events import CommsError, NetStat
from qlinkgen.protocols.trio import KeypadNode
from qlinkgen.protocols.trio.basic import ProgrammedNode, parse
from qlinkgen.protocols.trio.basic.machine import CALLS, STEPS, TICK
from qlinkgen.sim.virtual_ring import VirtualRing

#: Lets the keypad send its keys to the next node, the coordinator.
OFFSET = "SEND(10,2,10)\n"


class Rig:
    """A coordinator with a program, and a keypad."""

    def __init__(self, text: str, *, baud: int | None = None, seconds: float = 0.05) -> None:
        self.node = ProgrammedNode(parse(text, "x.bas"), baud=baud)
        self.ring = VirtualRing([self.node, KeypadNode(baud=baud)], baud=baud)
        self.keypad = self.ring.keypad(1)
        self.ring.sleep(seconds)

    @property
    def failure(self) -> str:
        return str(self.node.machine.failure)

    def press(self, *keys: int | str) -> None:
        for key in keys:
            self.keypad.press(key)
            self.ring.sleep(0.01)


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("2+3*4-10/4", 11.5),
        ("-(2+3)*-2", 10),
        ("8/4/2", 1),
        ("7-2-1", 4),
        (".5+1.25e1", 13),
        ("(1=1)+(1<>1)", -1),
        ("1<2 AND 2<=2", -1),
        ("3>=4 OR 4>5", 0),
        ("NOT 1=2", -1),
        ("NOT(0)&12", 12),
        ("12 AND 10", 8),
        ("12 OR 3 XOR 1", 14),
        ("6.9 AND 255", 6),
        ("TRUE", -1),
        ("FALSE", 0),
        ("VR(VR(1)+1)", 7),
        ("KEY#4", 0),
        ("unset", 0),
        ("+".join("1" * 20000), 20000),
    ],
)
def test_expressions(expression: str, value: float) -> None:
    rig = Rig(f"unset=unset\nVR(1)=1:VR(2)=7\nVR(0)={expression}", seconds=0.001)
    assert rig.failure == "None"
    assert rig.node.vr[0] == value


@pytest.mark.parametrize(
    ("items", "row"),
    [
        ('"a";1[0];"b"', "a1b"),
        ("1.5", "1.5000"),
        ("1.5,2[1]", "1.5000 2.0"),
        ("-2[6,1]", "  -2.0"),
        ("-2[6.1]", "    -2.0"),
        ("12345[3,0]", "***"),
        ('CURSOR(3);"x";CHR(27);CHR(72);CHR(0);"y"', "y  x"),
    ],
)
def test_items_of_print(items: str, row: str) -> None:
    rig = Rig(f'{OFFSET}IF 1 THEN PRINT #10,{items} ELSE PRINT #10,"no"')
    assert rig.keypad.lines[0] == row
    assert rig.keypad.node.display.place == 20, "a line end follows"


def test_a_semicolon_keeps_the_cursor_in_its_row() -> None:
    rig = Rig(f'{OFFSET}PRINT #10:PRINT #10,"ab";:PRINT #10,"c";')
    assert rig.keypad.lines[:2] == ["", "abc"]
    assert rig.keypad.node.display.place == 23


def test_keys() -> None:
    text = "DEFKEY(48,100,101)\nWAIT UNTIL KEY#3\nGET #3,a\nGET #4,VR(1)\nGET #3,VR(2)\nVR(0)=a"
    rig = Rig(OFFSET + text)
    assert str(rig.node.machine.place) == "x.bas:3:1"
    rig.press("1", "1", 7)
    assert [rig.node.vr[number] for number in range(3)] == [101, 49, 7]
    assert rig.node.machine.ended
    assert rig.node.machine.place is None


def test_a_variable_from_another_node_ends_a_wait() -> None:
    node = ProgrammedNode(parse("SEND(10,1,5,0.25)\nWAIT UNTIL VR(9)=-1.5\nVR(1)=1"))
    other = ProgrammedNode(parse("WAIT UNTIL VR(5)\nWA(250)\nSEND(10,1,9,-VR(5)*6)"))
    ring = VirtualRing([node, other])
    ring.sleep(0.249)
    assert node.vr[1] == 0
    ring.sleep(0.002)
    assert node.vr[1] == 1


def test_order() -> None:
    text = """
    i=0
    REPEAT: i=i+1: IF i=3 THEN GOTO out ELSE GOSUB add
    UNTIL i=10
    STOP
out: VR(1)=i
    REPEAT
      REPEAT: i=i+1: UNTIL i>=20
      VR(2)=VR(2)+1: i=0
    UNTIL VR(2)=2
    IF i=0 THEN IF VR(2)=1 THEN VR(3)=1 ELSE VR(3)=2: VR(4)=4
    STOP
    VR(5)=5
add: VR(0)=VR(0)+i
    RETURN
    """
    rig = Rig(text)
    assert rig.failure == "None"
    assert [rig.node.vr[number] for number in range(6)] == [3, 3, 2, 2, 4, 0]


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("VR(251)=1", "1:1: VR(251): a Motion Coordinator has the variables VR(0) to VR(250)"),
        ("VR(1e300)=1", "1:4: 1e+300 was given; give a whole number"),
        ("a=VR(1.5)", "1:6: 1.5 was given; give a whole number"),
        ("a=1:a=a/(a-1)", "1:8: 1 is divided by 0; test the divisor first"),
        ("a=1e300\na=a*a", "2:4: the number is too large; keep it below 1e308"),
        ("a=1e300 AND 1", "1:9: 1e+300 was given; NOT, AND, OR and XOR work on numbers up to"),
        ("a=NOT 1e300", "1:7: 1e+300 was given; NOT, AND, OR and XOR work on numbers up to"),
        ("PRINT #9", "1:8: n: 9 was given; nodes along the ring have the numbers 10"),
        ("PRINT #10,CHR(128)", "1:15: CHR: 128 was given; the ring carries characters 0 to 127"),
        ("PRINT #10,1[1,200]", "1:11: decimals: 200 was given; give 0 to 127"),
        ("PRINT #10,1[999.1]", "1:11: width: 1001 was given; give 0 to 127"),
        ("GET #5,a", "1:6: channel: 5 was given; the network's are 3"),
        ("a=KEY#0", "1:7: channel: 0 was given; the network's are 3"),
        ("SEND(10,3,1)", "1:1: type: 3 was given; SEND has 1"),
        ("SEND(10,1,1)", "1:1: data2: None was given; a direct variable transfer needs the value"),
        ("SEND(10,1,1,1e10)", "1:1: "),
        ("DEFKEY(127,1,2)", "1:1: defkey: key 127 and 2 values were given"),
        ("NETSTAT=4", "1:1: NETSTAT is set to 4; it can only be set to 0, which clears it"),
        ("WA(-1)", "1:4: -1 ms was given; give 0 or more"),
        ("RETURN", "1:1: RETURN without GOSUB; put STOP or GOTO before the subroutine"),
        ("x: GOSUB x", f"1:10: GOSUB x: more than {CALLS} subroutines wait for their RETURN"),
        ("GOSUB x\nx: VR(0)=1", "1:7: the program has ended inside the subroutine x; end that with RETURN"),
    ],
)
def test_a_program_that_cannot_go_on_stops_at_a_place(text: str, error: str) -> None:
    rig = Rig(text)
    assert f"x.bas:{error}" in rig.failure
    assert rig.node.machine.ended
    assert rig.node.link.next_timer() is None
    rig.node.machine.wake(rig.ring.now)
    assert rig.node.link.next_timer() is None


def test_subroutines_may_call_others_eight_deep() -> None:
    calls = [f"s{n}: GOSUB s{n + 1}: VR(0)=VR(0)+1: RETURN" for n in range(1, CALLS)]
    rig = Rig("\n".join(["GOSUB s1: STOP", *calls, f"s{CALLS}: RETURN"]))
    assert (rig.failure, rig.node.vr[0]) == ("None", CALLS - 1)


def test_a_program_that_never_waits_has_so_many_steps_in_a_tick() -> None:
    rig = Rig("x: VR(0)=VR(0)+1: GOTO x", seconds=0.0995)
    assert rig.node.vr[0] == pytest.approx(0.1 / TICK * STEPS / 2, abs=STEPS)


def test_a_program_that_asks_for_keys_in_vain_asks_once_a_tick() -> None:
    rig = Rig("x: VR(0)=VR(0)+1: IF NOT(KEY#4) THEN GOTO x", seconds=0.0995)
    assert rig.node.vr[0] == pytest.approx(0.1 / TICK, abs=1)


def test_a_waiting_program_costs_nothing() -> None:
    node = ProgrammedNode(parse("WAIT UNTIL VR(1)"))
    ring = VirtualRing([node, "coordinator"])
    ring.sleep(0.01)
    assert node.link.next_timer() is None


def test_a_full_transmit_buffer_is_waited_for_then_the_message_is_dropped() -> None:
    rig = Rig(f'{OFFSET}x: PRINT #10,"{"x" * 200}": VR(0)=VR(0)+1: GOTO x', baud=2400, seconds=3)
    assert rig.node.link.netstat == 0, "the buffer empties in time"
    slow = 150  # one message takes 13 s
    rig = Rig(f'x: PRINT #10,"{"x" * 200}": VR(0)=VR(0)+1: GOTO x', baud=slow, seconds=TX_TIMEOUT + 0.1)
    assert rig.node.link.netstat == NetStat.TX_TIMEOUT
    assert rig.node.link.counters.refused == 1


@pytest.mark.parametrize(
    ("word", "other", "bit"),
    [("NETSTAT", "COMMSERROR", NetStat.RX_FRAME), ("COMMSERROR", "NETSTAT", CommsError.RX_STRUCTURE)],
)
def test_a_program_sees_and_clears_the_status(word: str, other: str, bit: int) -> None:
    rig = Rig(f"WAIT UNTIL {word}\nVR(0)={word}\n{word}=0\nVR(1)=1\nVR(2)={word}")
    assert rig.node.vr[1] == 0
    rig.node.link.receive(b"\x01", rig.ring.now)
    rig.ring.wire.wake(rig.node.link)
    rig.ring.sleep(0.001)
    assert (rig.node.vr[0], rig.node.vr[1], rig.node.vr[2]) == (bit, 1, 0)
    assert getattr(rig.node.link, word.lower()) == 0
    assert getattr(rig.node.link, other.lower()) != 0
    assert f"{word} is set to 1; it can only be set to 0" in Rig(f"{word}=1").failure


def test_switched_on_again_the_program_begins_again() -> None:
    rig = Rig("a=a+1\nVR(0)=VR(0)+a\nGOSUB x\nx: WAIT UNTIL FALSE")
    for _ in range(2):
        rig.ring.switch_off(0)
        rig.ring.switch_on(0)
        rig.ring.sleep(0.01)
    assert (rig.node.vr[0], rig.node.machine.scope.names) == (3, {"a": 1})
