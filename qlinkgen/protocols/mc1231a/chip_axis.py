"""One axis of the simulated chip set: its registers, its motion, its events.

docs/mc1231a.md lists the assumptions where the sources are silent.
"""

from __future__ import annotations

from typing import Final

from qlinkgen.protocols.mc1231a.facts import EVENTS, AxisStatus
from qlinkgen.protocols.mc1231a.registers import BUFFERED, after_reset
from qlinkgen.protocols.mc1231a.trajectory import COUNTS, GEAR, S_CURVE, TRAPEZOIDAL, VELOCITY, Trajectory

#: Positions wrap at the range of set_actl_pos.
HALF_TURN: Final = 1 << 30
#: Breakpoints that are compared in every sample.
COMPARING: Final = ("time", "pos", "neg", "actl_pos", "actl_neg")
_BREAKS: Final = ("off", "time", "pos", "neg", "actl_pos", "actl_neg", "mtn_cmplt", "ext")
#: Registers that an update must not change during a motion.
_FIXED: Final = {TRAPEZOIDAL: ("acc",), S_CURVE: ("vel", "max_acc", "jerk")}


class ChipAxis:
    """An axis.

    Attributes:
        values: registers as read back, both buffered and immediate ones.
        active: active values of the buffered registers, as of the last update.
        pending: registers written since the last update, actions included.
        trajectory: target position over time.
        events: the latched bits of the status word.
        lost: position error in counts, caused by `hold`.
        limits: inputs of the limit switches, positive and negative; True if active.
    """

    def __init__(self, limits: list[bool] | None = None, *, error_sign: int = 1, geared: bool = True) -> None:
        self.limits = limits if limits is not None else [False, False]
        self._error_sign = error_sign
        self._geared = geared
        self.values: dict[str, float] = after_reset()
        self.active: dict[str, float] = {name: self.values[name] for name in BUFFERED}
        self.pending: set[str] = set()
        self.trajectory = Trajectory()
        self.events = 0
        self.motor_on = self.axis_on = self.limits_on = True
        self.auto_stop = self.auto_update = False
        self.armed = "off"
        self.capture_source = "index"
        self.capture_armed = True
        self.captured = 0
        self.held = False
        self.lost = 0
        self._open_loop_command = 0

    # Reading ------------------------------------------------------------------------------------------------

    @property
    def status(self) -> int:
        """The status word."""
        levels = (
            self.motor_on * AxisStatus.MOTOR_ON
            | self.axis_on * AxisStatus.AXIS_ON
            | self.in_motion * AxisStatus.IN_MOTION
        )
        return self.events | levels

    @property
    def in_motion(self) -> bool:
        """Whether the trajectory has not ended."""
        return self.trajectory.moving

    @property
    def target(self) -> int:
        """Target position in counts."""
        return self.trajectory.position >> COUNTS

    @property
    def actual(self) -> int:
        """Actual position in counts: the motor follows without lag, unless it is held or off."""
        return self.target - self.lost

    @property
    def resting(self) -> bool:
        """Whether the axis does not change over time."""
        return not self.in_motion and self.armed not in COMPARING

    @property
    def mode(self) -> int:
        """Mode bits, in our own layout: profile 0-1, automatic stop 2, automatic update 3, breakpoint 4-6."""
        kind = _BREAKS.index(self.armed)
        return self.trajectory.mode | self.auto_stop << 2 | self.auto_update << 3 | kind << 4

    @property
    def velocity(self) -> float:
        """Movement of the target in the last sample, in counts."""
        return (self.trajectory.velocity >> 16) / 65536

    @property
    def position_error(self) -> int:
        """Position error as reported, limited to a word."""
        return max(min(self._error_sign * self.lost, 32767), -32768)

    @property
    def motor_command(self) -> int:
        """Motor output: the manual command with an open loop, else the bias, as no force is simulated."""
        if not self.motor_on:
            return self._open_loop_command
        most = int(self.values["mtr_lmt"])
        return max(min(int(self.values["mtr_bias"]), most), -most)

    def take_capture(self) -> int:
        """Return the captured position, and rearm the capture."""
        self.capture_armed = True
        return self.captured

    # Switching ----------------------------------------------------------------------------------------------

    def set_mode(self, mode: int) -> None:
        """Select a profile. It begins at rest: the transition of a motion was not found in the sources.

        An axis without electronic gear keeps its profile instead.
        """
        if mode != self.trajectory.mode and (self._geared or mode != GEAR):
            self.trajectory.halt()
            self.trajectory.mode = mode

    def switch_limits(self, *, on: bool) -> None:
        """Enable or disable the limit switches."""
        self.limits_on = on
        self.meet_limits()

    def switch_motor(self, *, on: bool) -> None:
        """Close the loop, with the target at the motor; or open it, which ends the motion."""
        if on and not self.motor_on:
            self.synchronise()
        elif not on:
            self.trajectory.halt()
        self.motor_on = on

    def switch_axis(self, *, on: bool) -> None:
        """Enable the axis, or disable it, which ends its motion."""
        self.axis_on = on
        if not on:
            self.trajectory.halt()

    def set_motor_command(self, value: int) -> None:
        """Output a motor command, effective only with an open loop."""
        if not self.motor_on:
            self._open_loop_command = value

    def set_actual(self, value: int) -> None:
        """Set the actual position to `value`; the target is shifted, so the error does not change."""
        self.trajectory.shift((value - self.actual) << COUNTS)

    # Events -------------------------------------------------------------------------------------------------

    def keep_events(self, mask: int = 0) -> None:
        """Clear every event that has a 0 in the mask; a motion error stays as long as the error lasts."""
        self.events &= mask
        self._judge_error()

    def raise_event(self, event: int) -> None:
        """Set an event of the status word."""
        self.events |= event & EVENTS

    # Breakpoints and captures -------------------------------------------------------------------------------

    def pulse(self, source: str) -> None:
        """Handle an index pulse, a home signal, or the external signal of a breakpoint."""
        if source == "ext":
            if self.armed == "ext":
                self.break_now()
        elif source == self.capture_source and self.capture_armed:
            self.captured = self.actual
            self.capture_armed = False
            self.raise_event(AxisStatus.CAPTURE_RECEIVED)

    def look_at_breakpoint(self, time: int) -> None:
        """Compare the breakpoint; `time` is in cycles since the reset."""
        value = int(self.values["brk_pnt"])
        here = {"time": time, "pos": self.target, "neg": -self.target, "actl_pos": self.actual}
        reached = here.get(self.armed, -self.actual)
        wanted = -value if self.armed in {"neg", "actl_neg"} else value
        if self.armed in COMPARING and reached >= wanted:
            self.break_now()

    def break_now(self) -> None:
        """Handle a reached breakpoint: disarm it, and update if enabled."""
        self.armed = "off"
        self.raise_event(AxisStatus.BREAKPOINT_REACHED)
        if self.auto_update:
            self.update()

    # Updates ------------------------------------------------------------------------------------------------

    def write(self, name: str, value: float) -> None:
        """Write a register; an axis without electronic gear has no gear ratio."""
        if name == "ratio" and not self._geared:
            return
        self.values[name] = value
        if name in self.active:
            self.pending.add(name)

    def update(self) -> None:
        """Activate all buffered values, except those that are invalid now."""
        pending, self.pending = self.pending, set()
        refused = self._refused(pending)
        if refused:
            self.raise_event(AxisStatus.COMMAND_ERROR)
            pending -= refused
        for name in BUFFERED:
            if name in refused:
                self.values[name] = self.active[name]
            else:
                self.active[name] = self.values[name]
        if "buf_mtr_cmd" in pending and not self.motor_on:
            self._open_loop_command = int(self.active["buf_mtr_cmd"])
        self._act(pending)

    def _refused(self, pending: set[str]) -> set[str]:
        """Return the written registers that are invalid now."""
        mode = self.trajectory.mode
        refused = pending & set(_FIXED.get(mode, ())) if self.in_motion else set()
        if mode == TRAPEZOIDAL and "acc" in pending and self.values["acc"] < 0:
            refused.add("acc")
        if mode in _FIXED and "pos" in pending and self._blocked(self.values["pos"] - self.target):
            refused.add("pos")
        return refused

    def _act(self, pending: set[str]) -> None:
        trajectory = self.trajectory
        if "synch_prfl" in pending:
            self.synchronise()
        if "stop" in pending:
            self._end(complete=self.in_motion)
        elif "smooth_stop" in pending:
            trajectory.slow_down(abs(self._acceleration()))
        elif not (self.motor_on and self.axis_on):
            return
        elif trajectory.mode in _FIXED:
            if "pos" in pending:
                trajectory.move_to(int(self.active["pos"]) << COUNTS, self._ramp())
        elif trajectory.mode == VELOCITY and self.active["acc"] and not self._blocked(self.active["acc"]):
            trajectory.run_free()

    def _ramp(self) -> int:
        jerk: int = round(self.active["jerk"] * (1 << 32))
        return -(-self._acceleration() // jerk) if jerk else 1

    def _acceleration(self) -> int:
        """Return the acceleration of the profile, in 1/2^32 counts; 0 also for an S-curve without jerk."""
        smooth = self.trajectory.mode == S_CURVE
        if smooth and not self.active["jerk"]:
            return 0
        steps: int = round(self.active["max_acc" if smooth else "acc"] * 65536)
        return steps << 16

    def synchronise(self) -> None:
        """Make the target position the actual one, at rest."""
        self.trajectory.halt()
        self.trajectory.position = self.actual << COUNTS
        self.lost = 0

    # Motion -------------------------------------------------------------------------------------------------

    def sample(self) -> None:
        """Advance by one sample."""
        trajectory = self.trajectory
        if not trajectory.moving:
            return
        before = self.target
        trajectory.sample(round(self.active["vel"] * 65536) << 16, self._acceleration())
        arrived = not trajectory.moving
        self._moved(self.target - before, trajectory.velocity)
        if arrived:
            self._end(complete=True)

    def follow(self, counts: int) -> None:
        """Follow a movement of the master encoder of the electronic gear."""
        if self.trajectory.mode == GEAR and self.motor_on and self.axis_on:
            before = self.target
            self.trajectory.position += counts * (round(self.active["ratio"] * 65536) << 16)
            self._moved(self.target - before, self.target - before)

    def _moved(self, counts: int, direction: int) -> None:
        if self.held:
            self.lost += counts
        self._wrap()
        if self._blocked(direction):
            self._end(complete=False)
        if self._judge_error() and self.auto_stop:
            self.switch_motor(on=False)

    def _judge_error(self) -> bool:
        """Raise the motion error while the position error is too large; return whether it is."""
        too_large = abs(self.lost) > self.values["pos_err"]
        if too_large:
            self.raise_event(AxisStatus.MOTION_ERROR)
        return too_large

    def _wrap(self) -> None:
        turns = (self.target + HALF_TURN) // (2 * HALF_TURN)
        if turns:
            self.trajectory.shift(-turns * (2 * HALF_TURN) << COUNTS)
            self.raise_event(AxisStatus.POSITION_WRAPPED)

    def _blocked(self, direction: float) -> bool:
        positive, negative = self.limits
        return self.limits_on and ((positive and direction > 0) or (negative and direction < 0))

    def meet_limits(self) -> None:
        """Check the limit switches after a change."""
        if self.limits_on:
            for met, event in zip(
                self.limits, (AxisStatus.POSITIVE_LIMIT, AxisStatus.NEGATIVE_LIMIT), strict=True
            ):
                if met:
                    self.raise_event(event)
            if self._blocked(self.trajectory.velocity):
                self._end(complete=False)

    def _end(self, *, complete: bool) -> None:
        """Handle the end of the trajectory, by arrival or by a stop."""
        self.trajectory.halt()
        if complete:
            self.raise_event(AxisStatus.MOTION_COMPLETE)
            if self.armed == "mtn_cmplt":
                self.break_now()
