"""The simulated chip set on its own: time, motion, breakpoints, inputs; and its end of the link."""

from __future__ import annotations

from typing import Any

import pytest

from qlinkgen.codecs import mc1231a
from qlinkgen.codecs.mc1231a import AxisStatus
from qlinkgen.protocols.mc1231a import ChipEngine, ChipSet
from qlinkgen.protocols.mc1231a.chip import SAMPLE_TIME

COMMANDS: dict[str, Any] = dict(mc1231a.COMMANDS)


class Bench:
    """A chip set driven by commands, sample by sample."""

    def __init__(self, **options: Any) -> None:
        self.chip = ChipSet(**options)
        self.samples = 0
        self.chip.advance(0.0)

    @property
    def axis(self) -> Any:
        return self.chip.axes[self.chip.current]

    def do(self, name: str, **values: Any) -> Any:
        return self.chip.handle(COMMANDS[name].request(**values), self.now)

    @property
    def now(self) -> float:
        return (self.samples + 0.5) * SAMPLE_TIME

    def wait(self, samples: int) -> None:
        self.samples += samples
        self.chip.advance(self.now)

    def move(self, position: int = 100_000, velocity: float = 2.0, acceleration: float = 0.5) -> None:
        self.do("set_pos", value=position)
        self.do("set_vel", value=velocity)
        self.do("set_acc", value=acceleration)
        self.do("update")

    def has(self, event: int) -> bool:
        return bool(self.axis.status & event)


@pytest.fixture
def bench() -> Bench:
    return Bench()


# Time


def test_time_is_counted_from_the_reset(bench: Bench) -> None:
    bench.wait(10)
    assert bench.do("get_time").value == 10
    bench.move()
    bench.wait(25)  # in motion, sample by sample
    assert bench.do("get_time").value == 35
    bench.do("reset")
    assert bench.do("get_time").value == 0
    bench.wait(3)
    assert bench.do("get_time").value == 3


def test_time_that_runs_backwards_changes_nothing(bench: Bench) -> None:
    bench.wait(10)
    bench.chip.advance(0.0)
    assert bench.chip.time == 10


# Motion


def test_nothing_waits_for_what_was_written_before_it(bench: Bench) -> None:
    bench.do("set_pos", value=5)
    bench.do("set_vel", value=1)
    bench.do("set_acc", value=1)
    bench.wait(100)
    assert bench.axis.actual == 0
    bench.do("update")
    bench.wait(100)
    assert bench.axis.actual == 5


def test_only_a_new_destination_begins_a_move(bench: Bench) -> None:
    bench.move(position=50)
    bench.wait(200)
    bench.do("clr_status")
    bench.do("set_actl_pos", value=0)
    bench.do("set_kp", value=1)
    bench.do("update")
    bench.wait(10)
    assert (bench.axis.actual, bench.axis.events) == (0, 0)


def test_a_motor_that_is_off_does_not_move_and_closing_the_loop_does_not_jump(bench: Bench) -> None:
    bench.do("mtr_off")
    bench.move()
    bench.wait(100)
    assert bench.axis.actual == 0
    bench.do("set_mtr_cmd", value=-123)
    assert bench.do("get_mtr_cmd").value == -123
    bench.do("set_buf_mtr_cmd", value=77)
    assert bench.do("get_mtr_cmd").value == -123
    bench.do("update")
    assert bench.do("get_mtr_cmd").value == 77
    bench.do("mtr_on")
    bench.do("set_mtr_cmd", value=5)  # works with an open loop only
    bench.do("set_mtr_lmt", value=10)
    bench.do("set_mtr_bias", value=-300)
    assert bench.do("get_mtr_cmd").value == -10
    assert bench.axis.target == bench.axis.actual == 0


@pytest.mark.parametrize("command", ["mtr_off", "axis_off", "stop"])
def test_what_ends_a_motion(bench: Bench, command: str) -> None:
    bench.move()
    bench.wait(50)
    bench.do(command)
    bench.do("update")
    here = bench.axis.target
    bench.wait(50)
    assert bench.axis.target == here
    assert not bench.has(AxisStatus.IN_MOTION)
    assert bench.has(AxisStatus.MOTION_COMPLETE) == (command == "stop")


@pytest.mark.parametrize("clear", ["clr_status", "rst_status", "rst_intrpt"])
def test_a_motion_error_cannot_be_cleared_while_it_lasts(bench: Bench, clear: str) -> None:
    mask = {} if clear == "clr_status" else {"mask": 0}
    bench.do("set_intrpt_mask", mask=AxisStatus.MOTION_ERROR)
    bench.do("set_pos_err", value=40)
    bench.chip.hold(1)
    bench.move()
    bench.wait(40)
    bench.do(clear, **mask)
    assert bench.has(AxisStatus.MOTION_ERROR)
    bench.chip.hold(1, held=False)
    bench.do(clear, **mask)
    assert not bench.has(AxisStatus.MOTION_ERROR)


@pytest.mark.parametrize("sign", [1, -1])
def test_the_sign_of_the_position_error_can_be_chosen(sign: int) -> None:
    bench = Bench(error_sign=sign)
    bench.chip.hold(1)
    bench.move()
    bench.wait(20)
    assert bench.do("get_actl_pos_err").value == sign * bench.axis.target != 0
    bench.do("reset")
    bench.chip.hold(1)
    bench.move()
    bench.wait(20)
    assert bench.do("get_actl_pos_err").value == sign * bench.axis.target != 0
    with pytest.raises(ValueError, match="error_sign must be 1 or -1, not 0"):
        ChipSet(error_sign=0)


def test_a_held_motor_falls_behind_until_it_is_an_error(bench: Bench) -> None:
    bench.do("set_pos_err", value=40)
    bench.chip.hold(1)
    bench.move()
    bench.wait(20)
    assert bench.do("get_actl_pos_err").value == bench.axis.target > 0
    assert not bench.has(AxisStatus.MOTION_ERROR)
    bench.wait(20)
    assert bench.has(AxisStatus.MOTION_ERROR)
    assert bench.has(AxisStatus.MOTOR_ON)
    bench.do("clr_status")
    bench.do("set_auto_stop_on")
    bench.wait(1)
    assert not bench.has(AxisStatus.MOTOR_ON)
    bench.do("set_auto_stop_off")
    bench.chip.hold(1, held=False)
    bench.do("mtr_on")
    assert bench.axis.target == bench.axis.actual == 0


def test_a_motor_that_is_let_go_catches_up(bench: Bench) -> None:
    bench.chip.hold(1)
    bench.move(position=10)
    bench.wait(50)
    assert (bench.axis.target, bench.axis.actual) == (10, 0)
    bench.chip.hold(1, held=False)
    assert bench.axis.actual == 10


def test_synchronising_makes_the_target_the_actual_position(bench: Bench) -> None:
    bench.chip.hold(1)
    bench.move(position=10)
    bench.wait(50)
    bench.do("synch_prfl")
    assert bench.axis.target == 10
    bench.do("update")
    assert (bench.axis.target, bench.axis.actual) == (0, 0)


def test_set_actl_pos_keeps_the_error(bench: Bench) -> None:
    bench.chip.hold(1)
    bench.move(position=10)
    bench.wait(50)
    bench.do("set_actl_pos", value=-1000)
    assert (bench.axis.actual, bench.axis.target) == (-1000, -990)


def test_positions_wrap(bench: Bench) -> None:
    bench.do("set_prfl_vel")
    bench.do("set_actl_pos", value=1073741800)
    bench.do("set_vel", value=4)
    bench.do("set_acc", value=1)
    bench.do("update")
    bench.wait(30)
    assert bench.has(AxisStatus.POSITION_WRAPPED)
    assert -1073741824 <= bench.axis.actual < -1073741600


def test_an_electronic_gear_follows_its_master(bench: Bench) -> None:
    bench.do("set_prfl_gear")
    bench.do("set_ratio", value=-0.5)
    bench.do("update")
    bench.chip.turn_master(1, 100)
    assert bench.axis.actual == -50
    bench.do("smooth_stop")  # of no effect here
    bench.do("update")
    bench.chip.turn_master(1, 100)
    assert bench.axis.actual == -100
    bench.chip.set_limit(1, negative=True)
    bench.do("mtr_off")
    bench.chip.turn_master(1, 100)
    assert bench.axis.actual == -100


def test_the_electronic_gear_is_that_of_axis_1_unless_told_otherwise(bench: Bench) -> None:
    bench.do("set_2")
    bench.do("set_prfl_gear")
    bench.do("set_ratio", value=-0.5)
    bench.do("update")
    assert bench.do("get_ratio").value == 0
    bench.move(position=10)  # by its old profile
    bench.wait(50)
    assert bench.axis.actual == 10
    with pytest.raises(ValueError, match="axis 2 has no electronic gear"):
        bench.chip.turn_master(2, 100)

    other = Bench(geared=(1, 2))
    for command in ("reset", "set_2", "set_prfl_gear"):
        other.do(command)
    other.do("set_ratio", value=-0.5)
    other.do("update")
    other.chip.turn_master(2, 100)
    assert other.axis.actual == -50
    with pytest.raises(ValueError, match="axis must be 1 or 2, not 3"):
        ChipSet(geared=(3,))


def test_a_stop_at_rest_completes_nothing(bench: Bench) -> None:
    bench.do("stop")
    bench.do("update")
    assert not bench.has(AxisStatus.MOTION_COMPLETE)


def test_another_profile_begins_at_rest(bench: Bench) -> None:
    bench.move()
    bench.wait(50)
    bench.do("set_prfl_trap")  # the same one
    assert bench.has(AxisStatus.IN_MOTION)
    bench.do("set_prfl_s_crv")
    assert not bench.has(AxisStatus.IN_MOTION)


def test_an_s_curve_without_jerk_does_not_move(bench: Bench) -> None:
    bench.do("set_prfl_s_crv")
    bench.do("set_max_acc", value=0.5)
    bench.move()
    bench.wait(100)
    assert bench.axis.actual == 0
    assert bench.has(AxisStatus.IN_MOTION)


def test_velocity_mode_stops_smoothly_and_needs_no_destination(bench: Bench) -> None:
    bench.do("set_prfl_vel")
    bench.do("set_vel", value=2)
    bench.do("set_acc", value=-0.5)
    bench.do("update")
    bench.wait(100)
    assert bench.do("get_trgt_vel").value == -2
    bench.do("smooth_stop")
    bench.do("update")
    bench.wait(10)
    assert bench.has(AxisStatus.MOTION_COMPLETE)


# Breakpoints


@pytest.mark.parametrize(
    ("arm", "value", "destination"),
    [("pos", 30, 100), ("neg", -30, -100), ("actl_pos", 30, 100), ("actl_neg", -30, -100)],
)
def test_breakpoints_on_positions(bench: Bench, arm: str, value: int, destination: int) -> None:
    bench.do("set_brk_pnt", value=value)
    bench.do(f"set_{arm}_brk")
    bench.move(position=destination)
    while not bench.has(AxisStatus.BREAKPOINT_REACHED):
        assert abs(bench.axis.actual) < 30
        bench.wait(1)
    assert 30 <= abs(bench.axis.actual) < 35
    bench.do("clr_status")
    bench.wait(5)
    assert not bench.has(AxisStatus.BREAKPOINT_REACHED)


def test_a_breakpoint_on_time_updates_only_if_it_may(bench: Bench) -> None:
    for automatic in (False, True):
        bench.do("set_auto_update_on" if automatic else "set_auto_update_off")
        bench.do("set_kp", value=8)
        bench.do("set_brk_pnt", value=bench.chip.time + 20)
        bench.do("set_time_brk")
        bench.wait(19)
        assert not bench.has(AxisStatus.BREAKPOINT_REACHED)
        bench.wait(1)
        assert bench.has(AxisStatus.BREAKPOINT_REACHED)
        assert bench.axis.active["kp"] == 8 * automatic
        bench.do("clr_status")


def test_breakpoints_without_a_value(bench: Bench) -> None:
    bench.do("set_ext_brk")
    bench.wait(5)
    bench.chip.pulse(1, "ext")
    assert bench.has(AxisStatus.BREAKPOINT_REACHED)
    bench.do("clr_status")
    bench.chip.pulse(1, "ext")
    assert not bench.has(AxisStatus.BREAKPOINT_REACHED)
    bench.do("set_mtn_cmplt_brk")
    bench.move(position=4)
    bench.wait(50)
    assert bench.has(AxisStatus.BREAKPOINT_REACHED)


def test_a_breakpoint_that_is_disarmed(bench: Bench) -> None:
    bench.do("set_brk_pnt", value=5)
    bench.do("set_time_brk")
    bench.do("set_brk_off")
    bench.wait(50)
    assert not bench.has(AxisStatus.BREAKPOINT_REACHED)


# Inputs


def test_limits_that_are_off_stop_nothing(bench: Bench) -> None:
    bench.do("lmts_off")
    bench.move()
    bench.wait(50)
    bench.chip.set_limit(1, positive=True)
    assert bench.has(AxisStatus.IN_MOTION)
    assert bench.do("get_lmt_swtch").value == 1
    bench.do("lmts_on")
    assert not bench.has(AxisStatus.IN_MOTION)
    assert bench.has(AxisStatus.POSITIVE_LIMIT)


def test_a_limit_behind_an_axis_does_not_stop_it(bench: Bench) -> None:
    bench.move()
    bench.wait(50)
    bench.chip.set_limit(1, negative=True)
    assert bench.has(AxisStatus.NEGATIVE_LIMIT)
    bench.wait(5)
    assert bench.has(AxisStatus.IN_MOTION)


def test_a_limit_met_on_the_way_in_velocity_mode_is_no_command_error(bench: Bench) -> None:
    bench.do("set_prfl_vel")
    bench.do("set_vel", value=2)
    bench.do("set_acc", value=0.5)
    bench.chip.set_limit(1, positive=True)
    bench.do("update")
    bench.wait(20)
    assert bench.axis.actual == 0
    assert not bench.has(AxisStatus.COMMAND_ERROR)
    bench.do("set_acc", value=-0.5)
    bench.do("update")
    bench.wait(20)
    assert bench.axis.actual < 0


def test_the_sense_of_limits(bench: Bench) -> None:
    bench.do("set_lmt_sense", value=0b1001)
    assert bench.do("get_lmt_swtch").value == 0b1001
    bench.do("set_lmt_sense", value=0b1000)
    assert bench.do("get_lmt_swtch").value == 0b1000
    assert bench.chip.axes[2].events == AxisStatus.NEGATIVE_LIMIT


def test_what_is_wired_stays_after_a_reset(bench: Bench) -> None:
    bench.chip.set_limit(2, positive=True)
    bench.do("reset")
    assert bench.do("get_lmt_swtch").value == 0b0100
    assert bench.chip.axes[2].events == AxisStatus.POSITIVE_LIMIT


def test_arguments_of_what_is_wired(bench: Bench) -> None:
    with pytest.raises(ValueError, match="ext"):
        bench.chip.pulse(1, "zero")
    with pytest.raises(ValueError, match="axis must be 1 or 2"):
        bench.chip.pulse(3, "index")


def test_of_two_interrupts_the_first_one_stays(bench: Bench) -> None:
    for axis in bench.chip.axes.values():
        axis.write("intrpt_mask", 0xFFFF)
    bench.chip.pulse(2, "index")
    bench.chip.pulse(1, "index")
    assert bench.chip.interrupting == 2
    bench.do("rst_intrpt", mask=0xFFF7)
    assert bench.chip.interrupting == 1
    bench.do("clr_status")
    assert bench.chip.interrupting is None


def test_mode_bits_of_our_own(bench: Bench) -> None:
    bench.do("set_prfl_gear")
    bench.do("set_auto_stop_on")
    bench.do("set_auto_update_on")
    bench.do("set_ext_brk")
    assert bench.do("get_mode").value == 0b111_1_1_11


# The end of the link


def test_bytes_may_come_one_by_one() -> None:
    engine = ChipEngine(ChipSet(), record=True)
    for at, byte in enumerate(bytes.fromhex("01 10 00 12 d6 87 1a")):
        engine.receive(bytes((byte,)), at * 1.0)
    assert engine.record == [b"\x01", bytes.fromhex("1000 12d687"), b"\x1a"]
    assert engine.counters.packets == 3
    assert "packets=3" in repr(engine.counters)


def test_answers_take_their_time() -> None:
    engine = ChipEngine(ChipSet(), turnaround=0.25)
    engine.receive(b"\x31", 1.0)
    engine.receive(b"\x31", 1.1)
    assert engine.next_timer() == 1.25
    assert engine.bytes_to_send(1.2) == b""
    assert len(engine.bytes_to_send(1.25)) == 8
    assert engine.next_timer() is None


def test_a_packet_begun_is_forgotten_after_a_silence_only_if_asked_for() -> None:
    for forgets in (0.0, 0.01):
        engine = ChipEngine(ChipSet(), forgets=forgets, record=True)
        engine.receive(b"\x30", -1.0)
        engine.receive(b"\x25\x00", 0.0)
        engine.receive(b"\x31", 0.02)
        assert engine.record == [b"\x30", *([b"\x31"] if forgets else [b"\x25\x00\x31"])]
        assert engine.counters.forgotten == bool(forgets)


def test_a_value_that_cannot_be_changes_nothing_and_its_sum_is_right() -> None:
    engine = ChipEngine(ChipSet())
    engine.receive(bytes.fromhex("25 8000"), 0.0)
    assert engine.bytes_to_send(0.0).hex() == "8025"
    assert engine.chip.axes[1].values["kp"] == 0
    assert engine.counters.out_of_range == 1
