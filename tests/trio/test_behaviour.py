"""What nodes do for programs, over every client and every transport."""

from __future__ import annotations

from decimal import Decimal

import pytest

from qlinkgen.codecs import trio
from qlinkgen.protocols.trio import CHR, CURSOR, VALUE, NetStat, NothingCame
from tests.trio.behaviour_rig import PATIENCE
from tests.trio.conftest import MakeRig


def test_characters_reach_the_node_that_is_counted(make: MakeRig) -> None:
    ring = make("coordinator,coordinator,coordinator")
    first, second, third = (ring.coordinator(place) for place in range(3))
    first.print_(10, "A", end="")
    first.print_(11, "B", end="")
    assert second.get(4, PATIENCE) == ord("A")
    assert third.get(4, PATIENCE) == ord("B")
    assert not second.key(4)
    assert not third.key(4)


def test_13_comes_back_to_the_sender_on_a_ring_of_four(make: MakeRig) -> None:
    ring = make("coordinator,coordinator,coordinator,coordinator")
    first = ring.coordinator()
    first.print_(13, "me", end="")
    assert [first.get(4, PATIENCE) for _ in "me"] == [ord("m"), ord("e")]
    assert [ring.coordinator(place).counters.passed for place in range(4)] == [0, 1, 1, 1]


@pytest.mark.parametrize("number", [10, 14, 18, 22])
def test_numbers_past_the_end_go_round_to_the_same_node(make: MakeRig, number: int) -> None:
    ring = make("coordinator,coordinator,coordinator,coordinator")
    ring.coordinator().print_(number, "x", end="")
    assert ring.coordinator(1).get(4, PATIENCE) == ord("x")
    rounds = (number - 10) // 4
    assert [ring.coordinator(place).counters.passed for place in range(4)] == [rounds] * 4
    assert ring.coordinator(1).counters.taken == 1


def test_key_tells_and_does_not_take(make: MakeRig) -> None:
    ring = make("coordinator,coordinator")
    first, second = ring.coordinator(0), ring.coordinator(1)
    assert not second.key(4)
    first.print_(10, "ab", end="")
    ring.until(lambda: second.key(4))
    assert second.key(4)
    assert second.key(3)
    assert second.get(4) == ord("a")
    assert second.key(4)
    assert second.get(4) == ord("b")
    assert not second.key(4)


def test_get_waits_no_longer_than_it_is_told(make: MakeRig) -> None:
    first = make("coordinator,coordinator").coordinator()
    start = first.now()
    with pytest.raises(NothingCame, match=r"GET #4: no character in 0\.05 s"):
        first.get(4, timeout=0.05)
    assert first.now() - start >= 0.05


def test_channel_3_goes_by_the_defkey_table(make: MakeRig) -> None:
    ring = make("coordinator,coordinator")
    first, second = ring.coordinator(0), ring.coordinator(1)
    second.defkey("0", *range(10))
    second.defkey(65, 1234)
    first.print_(10, "07A!7", end="")
    assert [second.get(3, PATIENCE) for _ in range(4)] == [0, 7, 1234, ord("!")]
    assert second.get(4, PATIENCE) == ord("7")


@pytest.mark.parametrize("value", [0, 1, -1, 99, 2.5, -0.25, 2147483647, -2147483648, Decimal("0.1")])
def test_send_sets_a_variable_without_the_program_there(make: MakeRig, value: float | Decimal) -> None:
    ring = make("coordinator,coordinator,coordinator")
    target = ring.coordinator(2)
    target.vr[250] = 7
    ring.coordinator(0).send(11, 1, 250, value)
    steps = round(Decimal(value) * 2**32)
    ring.until(lambda: target.vr.exact(250) != 7)
    assert target.vr.exact(250) * 2**32 == steps
    assert target.vr[250] == pytest.approx(float(value))
    assert ring.coordinator(1).vr[250] == 0


def test_two_keypads_send_their_keys_to_the_coordinator(make: MakeRig) -> None:
    ring = make("coordinator,keypad,keypad")
    mc, first, second = ring.coordinator(0), ring.keypad(1), ring.keypad(2)
    mc.send(10, 2, 11)
    mc.send(11, 2, 10)
    ring.until(lambda: second.node.offset)
    assert (first.node.offset, second.node.offset) == (2, 1)
    first.press("5")
    assert mc.get(4, PATIENCE) == ord("5")
    second.press(13)
    assert mc.get(4, PATIENCE) == 13


def test_a_keypad_sends_nothing_and_passes_nothing_before_its_offset(make: MakeRig) -> None:
    ring = make("coordinator,keypad,coordinator")
    mc, keypad, behind = ring.coordinator(0), ring.keypad(1), ring.coordinator(2)
    assert keypad.key_down("1") is False
    mc.print_(10, "early")
    mc.print_(11, "lost", end="")
    mc.send(10, 2, 11)
    ring.until(lambda: keypad.node.offset)
    assert keypad.lines == ["", "", "", ""]
    counters = keypad.node.counters
    assert (counters.early_keys, counters.early_messages, keypad.counters.blocked) == (1, 1, 1)
    assert keypad.counters.sent == keypad.counters.passed == 0
    mc.print_(11, "now", end="")
    assert [behind.get(4, PATIENCE) for _ in "now"] == list(b"now")
    keypad.press("2")
    assert mc.get(4, PATIENCE) == ord("2")


def test_mode_on_off_sends_another_character_for_the_key_going_up(make: MakeRig) -> None:
    ring = make("coordinator,keypad")
    mc, keypad = ring.coordinator(0), ring.keypad(1)
    mc.send(10, 2, 10)
    ring.until(lambda: keypad.node.offset)
    keypad.press("1")
    mc.keypad_mode(10, trio.KeypadModeEnum.ON_OFF)
    ring.until(lambda: keypad.node.mode == trio.KeypadModeEnum.ON_OFF)
    keypad.press("1")
    mc.keypad_mode(10, trio.KeypadModeEnum.ON_ONLY)
    ring.until(lambda: keypad.node.mode == trio.KeypadModeEnum.ON_ONLY)
    keypad.press("2")
    assert [mc.get(4, PATIENCE) for _ in range(4)] == [49, 49, 49 + 64, 50]


def test_a_display_shows_what_it_was_sent(make: MakeRig) -> None:
    ring = make("coordinator,keypad")
    mc, keypad = ring.coordinator(0), ring.keypad(1)
    mc.send(10, 2, 10)
    mc.print_(10, "rubbish")
    mc.print_(10, CHR(12), CHR(14), CHR(20), "SPEED:")
    mc.print_(10, "LENGTH:", end="")
    mc.print_(10, CHR(27), CHR(72), CHR(7), VALUE(150, 6, 0))
    mc.print_(10, CURSOR(28), VALUE(2.25, 8, 1))
    ring.until(lambda: "2.2" in keypad.lines[1])
    assert keypad.lines == ["SPEED:    150", "LENGTH:      2.2", "", ""]
    assert not keypad.node.display.cursor_visible
    assert str(keypad) == "SPEED:    150\nLENGTH:      2.2\n\n"


def test_keypads_ignore_variables(make: MakeRig) -> None:
    ring = make("coordinator,keypad")
    mc, keypad = ring.coordinator(0), ring.keypad(1)
    mc.send(10, 2, 10)
    mc.send(10, 1, 5, 1.5)
    ring.until(lambda: keypad.node.counters.ignored)
    assert keypad.node.counters.ignored == 1
    assert keypad.netstat == 0


def test_the_buffer_keeps_256_characters_and_drops_the_newest(make: MakeRig) -> None:
    ring = make("coordinator,coordinator")
    first, second = ring.coordinator(0), ring.coordinator(1)
    text = "".join(chr(32 + at % 90) for at in range(300))
    first.print_(10, text[:200], end="")
    first.print_(10, text[200:], end="")
    ring.until(lambda: second.node.counters.characters_lost)
    assert second.node.counters.characters_lost == 44
    assert "".join(chr(second.get(4)) for _ in range(256)) == text[:256]
    assert not second.key(4)
    first.print_(10, "more", end="")
    assert [second.get(4, PATIENCE) for _ in "more"] == list(b"more")


def test_a_long_text_takes_several_messages(make: MakeRig) -> None:
    ring = make("coordinator,coordinator")
    first, second = ring.coordinator(0), ring.coordinator(1)
    first.print_(10, "x" * 255)
    ring.until(lambda: second.counters.taken == 2)
    assert second.counters.taken == 2
    assert second.node.counters.characters_lost == 1
    assert first.counters.sent == 2


def test_a_variable_that_there_is_not_is_dropped_and_counted(make: MakeRig) -> None:
    ring = make("coordinator,coordinator")
    first, second = ring.coordinator(0), ring.coordinator(1)
    first.send(10, 1, 251, 1)
    first.send(10, 1, 16383, 1)
    first.send(10, 1, 250, 1)
    ring.until(lambda: second.vr[250] == 1)
    assert second.node.counters.variables_lost == 2
    assert not any(list(second.vr)[:250])
    assert second.netstat == 0


def test_netstat_is_cleared_by_the_user(make: MakeRig) -> None:
    ring = make("coordinator,coordinator")
    first = ring.coordinator()
    first.engine.raise_status(NetStat.RX_CRC, first.now())
    first.engine.raise_status(NetStat.RX_FRAME, first.now())
    assert first.netstat == 12
    assert first.clear_netstat() == NetStat.RX_CRC | NetStat.RX_FRAME
    assert first.netstat == 0
    first.engine.raise_status(NetStat.TX_BUFFER, first.now())
    first.netstat = 0  # as in BASIC
    assert first.netstat == 0


def test_wait_until_a_variable_has_a_value(make: MakeRig) -> None:
    ring = make("coordinator,coordinator")
    first, second = ring.coordinator(0), ring.coordinator(1)
    first.send(10, 1, 200, 98)
    first.send(10, 1, 200, 99)
    second.wait_until(lambda: second.vr[200] == 99, PATIENCE)
    with pytest.raises(NothingCame):
        second.wait_until(lambda: second.vr[200] == 98, 0.02)


def test_any_message_may_be_sent(make: MakeRig) -> None:
    ring = make("coordinator,coordinator")
    first, second = ring.coordinator(0), ring.coordinator(1)
    first.transmit(trio.CharacterTransfer(address=3, characters="\0\x7f"))
    assert [second.get(4, PATIENCE), second.get(4, PATIENCE)] == [0, 127]
    with pytest.raises(trio.EncodeError):
        first.transmit(trio.CharacterTransfer(address=16, characters="x"))


def test_what_means_nothing_to_a_coordinator_is_counted(make: MakeRig) -> None:
    ring = make("coordinator,coordinator")
    first, second = ring.coordinator(0), ring.coordinator(1)
    first.send(10, 2, 11)
    first.keypad_mode(10, 127)
    ring.until(lambda: second.node.counters.ignored == 2)
    assert second.counters.taken == 2


def test_messages_arrive_in_their_order(make: MakeRig) -> None:
    ring = make("coordinator,coordinator,coordinator,coordinator")
    first, last = ring.coordinator(0), ring.coordinator(3)
    for turn in range(50):
        first.print_(12, f"{turn:02}", end="")
    got = "".join(chr(last.get(4, PATIENCE)) for _ in range(100))
    assert got == "".join(f"{turn:02}" for turn in range(50))
    assert first.counters.sent == last.counters.taken == 50
