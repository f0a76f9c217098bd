"""Each statement of the page on host packets, at the host and at the simulated chip set."""

from __future__ import annotations

import itertools
from typing import Any

import pytest

from qlinkgen.codecs import mc1231a
from qlinkgen.codecs.mc1231a import AxisStatus
from qlinkgen.errors import BadReply, CommandError, IllegalCommand
from qlinkgen.protocols.mc1231a import ChipEngine, ChipSet
from tests.mc1231a.line import sample
from tests.mc1231a.rig import Rig, become, virtual

ALL: dict[str, Any] = dict(mc1231a.COMMANDS)


def answer(*packets: str, chip: ChipSet | None = None) -> str:
    """What a chip set says to bytes."""
    engine = ChipEngine(chip or ChipSet())
    engine.receive(bytes.fromhex("".join(packets)), 0.0)
    return engine.bytes_to_send(0.0).hex()


# Packet and checksum


def test_the_example_of_the_checksum() -> None:
    assert answer("11 fedc ba98") == "b985"
    with virtual() as rig:
        rig.host.axis(1).set_vel(value=0xFEDCBA98 / 65536)
        assert rig.packets[-1] == "11fedcba98"
        rig.port.inward.append(become("b984"))
        rig.host.axis(1).set_vel(value=0xFEDCBA98 / 65536)
        assert rig.host.engine.total.damaged == {"crc": 1}


def test_words_that_are_read_are_in_the_checksum() -> None:
    chip = ChipSet()
    chip.axes[1].write("brk_pnt", -2)
    assert answer("57", chip=chip) == "fffffffe" + f"{(0x57 + 0xFFFF + 0xFFFE) & 0xFFFF:04x}"


@pytest.mark.parametrize(("value", "words"), [(1_234_567, "0012d687"), (-746_455, "fff49c29")])
def test_high_byte_first_high_word_first_and_twos_complement(value: int, words: str) -> None:
    with virtual() as rig:
        rig.host.axis(1).set_pos(value=value)
        assert rig.packets[-1] == f"10{words}"


def test_two_point_seven_five() -> None:
    with virtual() as rig:
        rig.host.axis(1).set_vel(value=2.75)
        assert rig.packets[-1] == "110002c000"


def test_reading_the_checksum_is_optional() -> None:
    """The next command byte begins a new packet; so it does in place of the word of set_1, set_2, set_i."""
    for checksum in ("always", "never"):
        with virtual(checksum=checksum) as rig:
            for axis in (1, 2, 1, 2):
                rig.host.axis(axis).set_kp(value=axis)
            rig.host.set_i()
            assert rig.host.axis(1).get_kp().value == 1
            assert rig.packets == ["01", "250001", "02", "250002"] * 2 + ["08", "01", "50"]


# Illegal commands


@pytest.mark.parametrize("code", sorted({*range(256)} - {each.id for each in ALL.values()}))
def test_an_unknown_code_is_answered_by_zero(code: int) -> None:
    assert answer(f"{code:02x}") == "0000"


@pytest.mark.parametrize("words", ["0000", "ffff", "1234"])
def test_an_illegal_command_is_answered_by_zero_whatever_its_data(words: str) -> None:
    assert answer(f"2b {words}", chip=ChipSet(illegal=["set_kvff"])) == "0000"
    with virtual(illegal=("set_kvff",)) as rig, pytest.raises(IllegalCommand):
        rig.host.axis(1).set_kvff(value=int(words, 16) & 0x7FFF)


def test_a_legal_packet_may_sum_to_zero() -> None:
    """Where the expected sum is 0, a refusal and success cannot be told apart, so it is success."""
    assert answer("10 ffff fff1") == "0000"
    for illegal in ((), ("set_pos",)):
        with virtual(illegal=illegal) as rig:
            rig.host.axis(1).set_pos(value=-15)
            assert rig.port.sent[-1].hex() == "10fffffff1"
            assert rig.host.engine.total.illegal == 0


def test_a_chip_set_is_made_of_commands_that_there_are() -> None:
    with pytest.raises(ValueError, match="unknown command 'set_kpp'"):
        ChipSet(illegal=["set_kpp"])
    with pytest.raises(ValueError, match="sample"):
        ChipSet(sample_time=0)
    with pytest.raises(ValueError, match="forgets"):
        ChipEngine(ChipSet(), forgets=-1)


# Repeats


def test_reads_and_writes_are_repeated_and_actions_only_as_the_schema_says() -> None:
    for command in ALL.values():
        with virtual() as rig:
            rig.host.axis(1).get_status()
            rig.port.sent.clear()
            rig.port.inward.append(become(("abcd" * 3)[: 2 * command.response.MAX_WIRE_SIZE]))
            request = sample(command)
            if command.repeat_safe:
                rig.host.ask(request, command.response)
            else:
                with pytest.raises(BadReply):
                    rig.host.ask(request, command.response)
            proof = command.name in {"set_1", "get_status"}
            assert rig.port.sent.count(request.to_frame()) == 1 + command.repeat_safe + proof


# Axes


def test_after_reset_axis_1_is_current() -> None:
    chip = ChipSet()
    assert chip.current == 1
    answer("02", chip=chip)
    assert chip.current == 2
    answer("39", chip=chip)
    assert chip.current == 1


def test_the_current_axis_stays_until_it_is_changed() -> None:
    chip = ChipSet()
    answer("02", "25 0001", "30", "32 ffff", "5b 0003", "3e", "1a", "26 0002", chip=chip)
    assert chip.current == 2
    assert chip.axes[2].values["kp"] == 1
    assert chip.axes[2].values["ki"] == 2
    assert chip.axes[1].values["kp"] == 0


@pytest.mark.parametrize("command", [n for n, c in ALL.items() if c.attributes["axis"] == "current"])
def test_whatever_is_marked_current_acts_on_the_current_axis_alone(command: str) -> None:
    untouched = _state(ChipSet(), 1)
    chip = ChipSet()
    chip.current = 2
    chip.handle(sample(ALL[command]), 0.0)
    assert _state(chip, 1) == untouched
    assert chip.current == 2


def _state(chip: ChipSet, number: int) -> tuple[Any, ...]:
    axis = chip.axes[number]
    return (axis.values, axis.active, axis.pending, axis.mode, axis.status, axis.captured, axis.actual)


def test_set_i_makes_the_interrupting_axis_current_and_others_leave_it() -> None:
    chip = ChipSet()
    chip.axes[2].write("intrpt_mask", 0x08)
    chip.pulse(2, "index")
    assert answer("30", chip=chip) == "0308" + f"{0x30 + 0x308:04x}"
    assert chip.current == 1
    assert answer("32 fff7", chip=chip)
    assert (chip.current, chip.axes[2].events) == (1, 0)
    chip.axes[2].write("intrpt_mask", 0x10)
    chip.raise_event(2, AxisStatus.MOTION_ERROR)
    assert answer("08", chip=chip)[:4] == "0310"
    assert chip.current == 2


def test_without_an_interrupt_the_current_axis_is_meant_and_nothing_is_cleared() -> None:
    chip = ChipSet()
    chip.pulse(1, "index")
    assert chip.interrupting is None
    assert answer("30", chip=chip)[:4] == "0308"
    answer("02", "08", "32 0000", chip=chip)
    assert (chip.current, chip.axes[1].events) == (2, AxisStatus.CAPTURE_RECEIVED)


# Command errors


def moving(rig: Rig, profile: str) -> Any:
    """An axis on its way, which takes hours."""
    axis = rig.host.axis(1)
    getattr(axis, f"set_prfl_{profile}")()
    axis.set_pos(value=1_000_000)
    axis.set_vel(value=1)
    axis.set_acc(value=0.01)
    axis.set_max_acc(value=0.01)
    axis.set_jerk(value=0.001)
    axis.update()
    rig.sleep(0.1)
    assert axis.get_status().status & AxisStatus.IN_MOTION
    return axis


@pytest.mark.parametrize(
    ("profile", "command"), [("trap", "acc"), ("s_crv", "vel"), ("s_crv", "max_acc"), ("s_crv", "jerk")]
)
def test_changes_that_are_not_valid_in_motion(profile: str, command: str) -> None:
    with virtual() as rig:
        axis = moving(rig, profile)
        before = getattr(axis, f"get_{command}")().value
        getattr(axis, f"set_{command}")(value=0.25)
        axis.set_pos(value=500)
        axis.set_ki(value=17)
        with pytest.raises(CommandError):
            axis.update(check=True)
        active = rig.chip.axes[1].active
        assert active[command] == before  # dropped
        assert (active["pos"], active["ki"]) == (500, 17)  # the rest takes effect
        rig.arrive(1)
        assert axis.get_actl_pos().value == 500
        assert getattr(axis, f"get_{command}")().value == before
        axis.clr_status()
        getattr(axis, f"set_{command}")(value=0.25)
        axis.update(check=True)  # at rest it is valid
        assert rig.chip.axes[1].active[command] == 0.25


@pytest.mark.parametrize(
    ("profile", "command"),
    [("trap", "vel"), ("trap", "max_acc"), ("trap", "jerk"), ("s_crv", "acc"), ("s_crv", "pos")],
)
def test_changes_that_are_valid_in_motion(profile: str, command: str) -> None:
    with virtual() as rig:
        axis = moving(rig, profile)
        getattr(axis, f"set_{command}")(value=0 if command == "pos" else 0.002)
        axis.update(check=True)


@pytest.mark.parametrize(("profile", "sign"), [*itertools.product(("trap", "s_crv"), (1, -1))])
def test_a_move_further_into_a_limit_switch(profile: str, sign: int) -> None:
    with virtual() as rig:
        axis = moving(rig, profile)
        axis.set_pos(value=sign * 1_000_000)
        axis.update()
        rig.sleep(0.5)
        rig.wired(lambda chip: chip.set_limit(1, positive=sign > 0, negative=sign < 0))
        here = axis.get_actl_pos().value
        event = AxisStatus.POSITIVE_LIMIT if sign > 0 else AxisStatus.NEGATIVE_LIMIT
        assert axis.get_status().status & (event | AxisStatus.IN_MOTION) == event
        axis.set_pos(value=here + sign)
        axis.set_kp(value=1)
        with pytest.raises(CommandError):
            axis.update(check=True)
        assert axis.get_actl_pos().value == here
        assert rig.chip.axes[1].active["kp"] == 1
        axis.clr_status()
        axis.set_pos(value=here - sign * 10)
        axis.update(check=True)
        rig.arrive(1)
        assert axis.get_actl_pos().value == here - sign * 10


def test_set_acc_is_checked_by_its_mode() -> None:
    with virtual() as rig:
        axis = rig.host.axis(1)
        axis.set_acc(value=-1)
        with pytest.raises(CommandError):
            axis.update(check=True)
        axis.clr_status()
        axis.set_prfl_vel()
        axis.set_vel(value=1)
        axis.set_acc(value=-1)
        axis.update(check=True)
        rig.sleep(0.05)
        assert axis.get_actl_pos().value < 0


# The status word


def test_events_stay_until_they_are_cleared_and_levels_do_not() -> None:
    with virtual() as rig:
        axis = rig.host.axis(1)
        every = 0x08FF
        rig.wired(lambda chip: chip.raise_event(1, 0xFFFF))
        assert axis.get_status().status == every | AxisStatus.MOTOR_ON | AxisStatus.AXIS_ON
        axis.rst_status(mask=0xFFFF & ~AxisStatus.MOTION_ERROR)
        assert axis.get_status().status & every == every & ~AxisStatus.MOTION_ERROR
        axis.clr_status()
        assert axis.get_status().status == AxisStatus.MOTOR_ON | AxisStatus.AXIS_ON
        axis.mtr_off()
        assert axis.get_status().status == AxisStatus.AXIS_ON
        axis.axis_off()
        assert axis.get_status().status == 0
        axis.mtr_on()
        axis.axis_on()
        assert axis.get_status().status == AxisStatus.MOTOR_ON | AxisStatus.AXIS_ON


@pytest.mark.parametrize("bit", [*range(8), 11])
def test_each_event_may_interrupt_and_is_cleared_alone(bit: int) -> None:
    chip = ChipSet()
    chip.axes[1].write("intrpt_mask", 1 << bit)
    chip.raise_event(1, 0x0FFF & ~(1 << bit))
    seen = [chip.interrupting]
    chip.raise_event(1, 1 << bit)
    seen.append(chip.interrupting)
    answer(f"32 {0xFFFF & ~(1 << bit):04x}", chip=chip)
    seen.append(chip.interrupting)
    assert seen == [None, 1, None]
    assert chip.axes[1].events == 0x08FF & ~(1 << bit)
