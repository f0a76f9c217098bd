"""Behaviour of a chip set for a user: the same with every client and transport."""

from __future__ import annotations

import pytest

from qlinkgen.codecs import mc1231a
from qlinkgen.codecs.mc1231a import Axes, AxisStatus, EventMask, LimitSwitches, OutputMode
from qlinkgen.errors import BadReply, CommandError, IllegalCommand, NoReply
from tests.mc1231a.conftest import MakeRig
from tests.mc1231a.rig import Rig, flip, lose


def begin_move(rig: Rig, axis: int, position: int = 1_000_000, velocity: float = 2.75) -> None:
    """A trapezoidal move that takes minutes unless the position says otherwise."""
    there = rig.host.axis(axis)
    there.set_pos(value=position)
    there.set_vel(value=velocity)
    there.set_acc(value=0.125)
    there.update()


# Axes


def test_the_example_of_the_page(rig: Rig) -> None:
    two, one = rig.host.axis(2), rig.host.axis(1)
    two.set_pos(value=0x02345678)
    two.update()
    one.set_acc(value=0x1234 / 65536)
    one.update()
    assert rig.packets == ["02", "1002345678", "1a", "01", "1200001234", "1a"]
    assert rig.wired(lambda chip: chip.axes[2].active["pos"]) == 0x02345678
    assert rig.wired(lambda chip: chip.axes[1].active["acc"]) == 0x1234 / 65536


def test_an_axis_is_selected_only_when_it_must_be(rig: Rig) -> None:
    for _ in range(3):
        rig.host.axis(1).get_status()
        rig.host.get_status(1)
    assert rig.packets == ["01", *["31"] * 6]
    rig.host.get_time()
    rig.host.multi_update(axes=Axes.AXIS_1 | Axes.AXIS_2)
    rig.host.axis(1).get_status()
    assert rig.packets[7:] == ["3e", "5b0003", "31"]
    rig.host.set_2()
    rig.host.axis(2).get_status()
    assert rig.packets[10:] == ["02", "31"]


def test_after_set_i_the_axis_is_unknown(rig: Rig) -> None:
    rig.host.axis(1).set_intrpt_mask(mask=EventMask.MOTION_COMPLETE)
    rig.host.set_i()
    rig.host.axis(1).get_status()
    assert rig.packets == ["01", "2f0001", "08", "01", "31"]


def test_after_a_reset_the_axis_is_unknown_to_the_host(rig: Rig) -> None:
    rig.host.axis(1).set_kp(value=5)
    rig.host.reset()
    assert rig.host.axis(1).get_kp().value == 0
    assert rig.packets == ["01", "250005", "39", "01", "50"]


def test_there_are_two_axes(rig: Rig) -> None:
    for call in (lambda: rig.host.axis(3), lambda: rig.host.get_status(0), lambda: rig.host.update(3)):
        with pytest.raises(ValueError, match="axis must be 1 or 2"):
            call()
    assert rig.packets == []


# Registers


def test_values_are_physical_and_stay_apart_by_axis(rig: Rig) -> None:
    one, two = rig.host.axis(1), rig.host.axis(2)
    one.set_vel(value=2.75)
    two.set_vel(value=0.5)
    one.set_jerk(value=3 / 2**32)
    two.set_pos(value=-746_455)
    assert one.get_vel().value == 2.75
    assert two.get_vel().value == 0.5
    assert one.get_jerk().value == 3 / 2**32
    assert (one.get_pos().value, two.get_pos().value) == (0, -746_455)
    assert rig.packets[1] == "110002c000"


def test_buffered_values_wait_for_the_update(rig: Rig) -> None:
    axis = rig.host.axis(1)
    axis.set_kp(value=100)
    axis.set_mtr_bias(value=-7)
    assert rig.wired(lambda chip: chip.axes[1].active["kp"]) == 0
    assert axis.get_kp().value == 100
    assert axis.get_mtr_cmd().value == -7  # not buffered
    axis.update()
    assert rig.wired(lambda chip: chip.axes[1].active["kp"]) == 100


def test_a_value_out_of_range_sends_nothing(rig: Rig) -> None:
    with pytest.raises(mc1231a.EncodeError, match=r"0\.\.32767"):
        rig.host.axis(1).set_kp(value=40000)
    assert rig.port.sent == []


def test_globals(rig: Rig) -> None:
    rig.host.set_output_dac16()
    assert rig.host.get_output_mode().mode == OutputMode.DAC16
    rig.host.set_output_pwm()
    assert rig.host.get_output_mode().mode == OutputMode.PWM
    rig.host.set_smpl_time(value=77)
    assert rig.host.get_smpl_time().value == 77
    rig.wired(lambda chip: chip.home.update({2: True}))
    assert rig.host.get_home().value == 0b10
    before = rig.host.get_time().value
    rig.sleep(0.05)
    assert rig.host.get_time().value > before
    assert "01" not in rig.packets


# Motion


def test_a_move_begins_runs_and_ends(rig: Rig) -> None:
    begin_move(rig, 2, position=-300)
    status = rig.until(2, AxisStatus.MOTION_COMPLETE)
    assert status == AxisStatus.MOTION_COMPLETE | AxisStatus.MOTOR_ON | AxisStatus.AXIS_ON
    axis = rig.host.axis(2)
    assert axis.get_actl_pos().value == axis.get_trgt_pos().value == -300
    assert axis.get_trgt_vel().value == 0
    axis.clr_status()
    assert axis.get_status().status == AxisStatus.MOTOR_ON | AxisStatus.AXIS_ON


def test_several_axes_begin_at_the_same_instant(rig: Rig) -> None:
    for axis in (1, 2):
        rig.host.axis(axis).set_pos(value=1_000_000)
        rig.host.axis(axis).set_vel(value=1)
        rig.host.axis(axis).set_acc(value=1)
    rig.host.multi_update(axes=Axes.AXIS_1 | Axes.AXIS_2)
    rig.sleep(0.02)
    here = rig.wired(lambda chip: [axis.target for axis in chip.axes.values()])
    assert here[0] == here[1] > 0


def test_stops(rig: Rig) -> None:
    axis = rig.host.axis(1)
    begin_move(rig, 1)
    rig.until(1, AxisStatus.IN_MOTION)
    axis.stop()
    axis.update()
    assert not axis.get_status().status & AxisStatus.IN_MOTION
    begin_move(rig, 1)
    rig.sleep(0.05)
    axis.smooth_stop()
    axis.update()
    rig.arrive(1)
    assert 0 < axis.get_actl_pos().value < 1_000_000


# Command errors


def test_a_command_error_is_raised_where_it_is_asked_for(rig: Rig) -> None:
    begin_move(rig, 1)
    axis = rig.host.axis(1)
    axis.set_acc(value=0.25)
    axis.set_kp(value=9)
    axis.update()  # not checked
    with pytest.raises(CommandError, match=r"axis 1: .*clr_status") as info:
        axis.raise_command_error()
    assert info.value.status & AxisStatus.COMMAND_ERROR
    assert info.value.node == 1
    axis.clr_status()
    assert not axis.raise_command_error() & AxisStatus.COMMAND_ERROR
    # Dropped, while the rest of the same update has taken effect.
    assert axis.get_acc().value == 0.125
    assert rig.wired(lambda chip: chip.axes[1].active["kp"]) == 9
    axis.set_acc(value=0.25)
    with pytest.raises(CommandError):
        axis.update(check=True)


def test_a_host_may_always_look_for_command_errors(make: MakeRig) -> None:
    rig = make(command_errors=True)
    begin_move(rig, 2)
    rig.host.axis(2).set_acc(value=0.25)
    with pytest.raises(CommandError, match="axis 2"):
        rig.host.axis(2).update()
    rig.host.axis(2).update(check=False)
    with pytest.raises(CommandError, match="axis 2"):
        rig.host.multi_update(axes=Axes.AXIS_1 | Axes.AXIS_2)
    rig.host.multi_update(axes=Axes.AXIS_1)
    rig.host.multi_update(axes=Axes.AXIS_2, check=False)


# What happens by itself: limits, interrupts, breakpoints and captures


def test_a_limit_switch_stops_and_refuses_further_moves(rig: Rig) -> None:
    axis = rig.host.axis(1)
    begin_move(rig, 1)
    rig.until(1, AxisStatus.IN_MOTION)
    rig.wired(lambda chip: chip.set_limit(1, positive=True))
    assert rig.host.get_lmt_swtch().value == LimitSwitches.AXIS_1_POSITIVE
    # It stops with the first count in that direction, which takes a few samples if it has just begun.
    assert rig.arrive(1) & AxisStatus.POSITIVE_LIMIT
    here = axis.get_actl_pos().value
    axis.set_pos(value=2_000_000)
    axis.set_kd(value=3)
    with pytest.raises(CommandError):
        axis.update(check=True)
    assert rig.wired(lambda chip: chip.axes[1].active["kd"]) == 3
    assert axis.get_actl_pos().value == here
    axis.clr_status()
    axis.set_pos(value=here - 50)
    axis.update(check=True)
    rig.arrive(1)
    assert axis.get_actl_pos().value == here - 50


def test_interrupts(rig: Rig) -> None:
    axis = rig.host.axis(2)
    axis.set_intrpt_mask(mask=EventMask.CAPTURE_RECEIVED)
    assert axis.get_intrpt_mask().mask == EventMask.CAPTURE_RECEIVED
    rig.host.axis(1).get_status()
    rig.wired(lambda chip: chip.pulse(2, "index"))
    assert rig.host.get_intrpt().status & AxisStatus.CAPTURE_RECEIVED
    assert rig.host.set_i().status & AxisStatus.CAPTURE_RECEIVED
    assert rig.wired(lambda chip: (chip.current, chip.interrupting)) == (2, 2)
    rig.host.rst_intrpt(mask=0xFFFF & ~EventMask.CAPTURE_RECEIVED)
    assert rig.wired(lambda chip: chip.interrupting) is None
    assert not rig.host.axis(2).get_status().status & AxisStatus.CAPTURE_RECEIVED


def test_a_breakpoint_updates(rig: Rig) -> None:
    axis = rig.host.axis(1)
    axis.set_auto_update_on()
    axis.set_brk_pnt(value=50)
    axis.set_pos_brk()
    begin_move(rig, 1, position=200)
    axis.set_kp(value=44)
    rig.until(1, AxisStatus.BREAKPOINT_REACHED)
    assert rig.wired(lambda chip: (chip.axes[1].active["kp"], chip.axes[1].armed)) == (44, "off")


def test_a_capture(rig: Rig) -> None:
    axis = rig.host.axis(2)
    axis.set_actl_pos(value=1234)
    axis.set_capt_home()
    rig.wired(lambda chip: chip.pulse(2, "index"))
    assert not axis.get_status().status & AxisStatus.CAPTURE_RECEIVED
    rig.wired(lambda chip: chip.pulse(2, "home"))
    assert axis.get_status().status & AxisStatus.CAPTURE_RECEIVED
    axis.set_actl_pos(value=0)
    rig.wired(lambda chip: chip.pulse(2, "home"))  # not armed again yet
    assert axis.get_capt().value == 1234
    rig.wired(lambda chip: chip.pulse(2, "home"))
    assert axis.get_capt().value == 0


# Errors on the line


def test_an_illegal_command(make: MakeRig) -> None:
    rig = make(illegal=("set_kvff", "get_kvff", "init_phase"))
    axis = rig.host.axis(1)
    for call in (lambda: axis.set_kvff(value=3), axis.get_kvff, axis.init_phase):
        with pytest.raises(IllegalCommand, match="unknown command"):
            call()
    axis.set_kp(value=3)
    assert axis.get_kp().value == 3
    assert rig.port.sent.count(b"\x7a") == 1


@pytest.mark.parametrize("place", range(5))
def test_a_byte_lost_on_the_way_there(rig: Rig, place: int) -> None:
    """The chip set never drops an incomplete packet, and the host resynchronises it."""
    axis = rig.host.axis(1)
    axis.set_vel(value=1.5)
    rig.port.outward.append(lose(place))
    axis.set_vel(value=0x03040506 / 65536)
    assert rig.host.engine.in_step
    assert axis.get_vel().value == 0x03040506 / 65536
    assert rig.host.engine.total.out_of_step == 1


@pytest.mark.parametrize("places", [(0,), (3,), (5,), (0, 1), (2, 3, 4, 5)])
def test_bytes_lost_on_the_way_back(rig: Rig, places: tuple[int, ...]) -> None:
    axis = rig.host.axis(1)
    axis.set_actl_pos(value=0x0BCDEF01)
    rig.port.inward.append(lose(*places))
    assert axis.get_actl_pos().value == 0x0BCDEF01
    assert rig.host.engine.total.repeats == 1


def test_an_action_is_not_repeated(rig: Rig) -> None:
    axis = rig.host.axis(1)
    axis.set_kp(value=1)
    rig.port.inward.append(lose(0, 1))
    with pytest.raises(NoReply, match="may have been executed"):
        axis.update()
    assert axis.get_kp().value == 1
    rig.port.inward.append(flip(1, 0x80))
    with pytest.raises(BadReply, match="may have been executed"):
        axis.update()
    assert rig.packets.count("1a") == rig.port.sent.count(b"\x1a") == 2
    assert axis.get_kp().value == 1


def test_after_an_error_the_axis_is_selected_again(rig: Rig) -> None:
    axis = rig.host.axis(2)
    axis.get_status()
    rig.port.inward.append(lose(0))
    axis.get_status()
    assert rig.packets[0] == "02"
    assert rig.packets[-3:] == ["02", "31", "31"]  # the axis, the proof, the request again


# Checksums


def test_checksums_that_nobody_reads(make: MakeRig) -> None:
    rig = make(checksum="never")
    axis = rig.host.axis(2)
    for value in range(50):
        axis.set_kp(value=value)
        axis.set_pos(value=-value)
    assert axis.get_kp().value == 49
    assert axis.get_pos().value == -49
    axis.update()
    assert rig.host.axis(1).get_kp().value == 0
    assert axis.get_kp().value == 49
    for value in range(200):  # more comes back than goes out, so the answers queue
        rig.host.axis(1 + value % 2).set_kd(value=value)
    assert rig.host.axis(1).get_kd().value == 198
    assert rig.host.engine.total.out_of_step == 0
    assert rig.packets[:3] == ["02", "250000", "1000000000"]


def test_checksums_of_chosen_commands(make: MakeRig) -> None:
    rig = make(checksum={"update", "get_kp"})
    axis = rig.host.axis(1)
    axis.set_kp(value=7)
    rig.port.inward.append(None)
    axis.update()
    assert axis.get_kp().value == 7
    assert axis.get_kd().value == 0
    assert rig.host.engine.total.out_of_step == 0


def test_a_checksum_policy_that_there_is_not(make: MakeRig) -> None:
    with pytest.raises(ValueError, match="always"):
        make(checksum="sometimes")
    with pytest.raises(ValueError, match="did you mean set_kp"):
        make(checksum=["set_kpp"])
