"""The simulated chip set: two axes, one of them current, and their common parts.

Like an engine it has no clock and does no input or output: `now` is an argument, in seconds. Each call first
advances the simulation to that time, sample by sample.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from typing import Final

from qlinkgen.codecs import mc1231a
from qlinkgen.protocols.mc1231a.axis_commands import AXIS_COMMANDS
from qlinkgen.protocols.mc1231a.chip_axis import ChipAxis
from qlinkgen.protocols.mc1231a.facts import AXES, NEEDS, check_axis

#: Seconds of one sample of the trajectories; set_smpl_time has no unit, so it is only kept.
SAMPLE_TIME: Final = 0.0005
#: Answer to get_vrsn; its layout was not found.
VERSION: Final = 0x1231
_Handler = Callable[[mc1231a.Request], float | None]


class ChipSet:
    """A simulated chip set of two axes.

    Attributes:
        axes: each axis by its number.
        current: number of the current axis.
        illegal: names of commands unknown to this chip set.
        time: cycles since the reset.
        values: registers of the whole chip set.
        home: level of the home inputs, by axis.
    """

    def __init__(
        self,
        *,
        illegal: Iterable[str] = (),
        sample_time: float = SAMPLE_TIME,
        error_sign: int = 1,
        geared: Collection[int] = (1,),
    ) -> None:
        """Make a chip set.

        Args:
            illegal: names of commands that it answers by a checksum of 0.
            sample_time: seconds of a sample.
            error_sign: 1 if get_actl_pos_err reports target minus actual position, -1 for the reverse: the
                sources do not agree.
            geared: axes with an electronic gear; a manual says that its commands are for axis 1 only. Other
                axes ignore them.

        Raises:
            ValueError: a command or an axis is unknown, `sample_time` not positive, or `error_sign` another
                number.
        """
        if error_sign not in {1, -1}:
            raise ValueError(f"error_sign must be 1 or -1, not {error_sign}")
        self._error_sign = error_sign
        self._geared = frozenset(map(check_axis, geared))
        self.illegal = frozenset(illegal)
        if unknown := self.illegal - set(mc1231a.COMMANDS):
            raise ValueError(f"illegal: unknown command {min(unknown)!r}; see `qlinkgen show mc1231a`")
        if not sample_time > 0:
            raise ValueError(f"sample_time must be more than 0 s, not {sample_time}")
        self.home = dict.fromkeys(AXES, False)
        self._sample_time = sample_time
        self._started: float | None = None
        self._samples = 0
        self._handlers = {
            command.request: (name, self._handler(name), _respond(command.response))
            for name, command in mc1231a.COMMANDS.items()
        }
        self._limits = {axis: [False, False] for axis in AXES}
        self._reset()

    def _reset(self) -> None:
        """Reset, as after power-on; the levels of the inputs do not change."""
        self.axes = {
            axis: ChipAxis(limits, error_sign=self._error_sign, geared=axis in self._geared)
            for axis, limits in self._limits.items()
        }
        self.current = 1
        self.time = 0
        self.values = {"smpl_time": 0, "lmt_sense": 0}
        self._output = mc1231a.OutputMode.PWM
        self._interrupting: int | None = None
        for axis in self.axes.values():
            axis.meet_limits()

    # Commands -----------------------------------------------------------------------------------------------

    def handle(self, request: mc1231a.Request, now: float) -> mc1231a.Response | None:
        """Execute a packet; return its response, None if the command is illegal here."""
        name, handler, respond = self._handlers[type(request)]
        if name in self.illegal:
            return None
        self.advance(now)
        result = handler(request)
        self._look_at_interrupts()
        return respond(result)

    def _handler(self, name: str) -> _Handler:
        """Return the function of a command: a method of the chip set, or an action of the axis."""
        fields = mc1231a.COMMANDS[name].request.FIELDS
        own = getattr(self, f"_do_{name}", None)
        if own is not None:
            return lambda request: own(*(getattr(request, field) for field in fields))
        action = AXIS_COMMANDS[name]
        return lambda request: action(self._axis, *(getattr(request, field) for field in fields))

    @property
    def _axis(self) -> ChipAxis:
        return self.axes[self.current]

    def _do_set_1(self) -> int:
        self.current = 1
        return self._axis.status

    def _do_set_2(self) -> int:
        self.current = 2
        return self._axis.status

    def _do_set_i(self) -> int:
        if self._interrupting is not None:
            self.current = self._interrupting
        return self._axis.status

    def _do_get_intrpt(self) -> int:
        return self.axes[self._interrupting or self.current].status

    def _do_rst_intrpt(self, mask: int) -> None:
        if self._interrupting is not None:
            self.axes[self._interrupting].keep_events(mask)
            self._interrupting = None

    def _do_multi_update(self, axes: int) -> None:
        for number, axis in self.axes.items():
            if axes >> (number - 1) & 1:
                axis.update()

    def _do_reset(self) -> None:
        self._reset()

    def _do_set_output_pwm(self) -> None:
        self._output = mc1231a.OutputMode.PWM

    def _do_set_output_dac16(self) -> None:
        self._output = mc1231a.OutputMode.DAC16

    def _do_get_output_mode(self) -> mc1231a.OutputMode:
        return self._output

    def _do_set_lmt_sense(self, value: int) -> None:
        """Set the sense of the limits; a bit of 1 makes an input active low, so active if not connected."""
        changed = value ^ self.values["lmt_sense"]
        self.values["lmt_sense"] = value
        for number, axis in self.axes.items():
            for place in range(2):
                if changed >> (2 * (number - 1) + place) & 1:
                    axis.limits[place] = not axis.limits[place]
            axis.meet_limits()

    def _do_get_lmt_swtch(self) -> int:
        bits = [met for axis in self.axes.values() for met in axis.limits]
        return sum(met << place for place, met in enumerate(bits))

    def _do_get_home(self) -> int:
        return sum(level << (number - 1) for number, level in self.home.items())

    def _do_set_smpl_time(self, value: int) -> None:
        self.values["smpl_time"] = value

    def _do_get_smpl_time(self) -> int:
        return self.values["smpl_time"]

    def _do_get_vrsn(self) -> int:
        return VERSION

    def _do_get_time(self) -> int:
        return self.time & 0xFFFFFFFF

    # Interrupts ---------------------------------------------------------------------------------------------

    @property
    def interrupting(self) -> int | None:
        """Number of the axis that raises the host interrupt, None without one."""
        return self._interrupting

    def _look_at_interrupts(self) -> None:
        """Determine the interrupting axis: the first one keeps the interrupt; if simultaneous, axis 1."""
        asking = [n for n, axis in self.axes.items() if axis.events & int(axis.values["intrpt_mask"])]
        if self._interrupting not in asking:
            self._interrupting = asking[0] if asking else None

    # Time, and what is wired to the chip set ----------------------------------------------------------------

    def advance(self, now: float) -> None:
        """Advance the simulation to `now`."""
        if self._started is None:
            self._started = now
        samples = int((now - self._started) / self._sample_time) - self._samples
        if samples <= 0:
            return
        self._samples += samples
        axes = tuple(self.axes.values())
        while samples and not all(axis.resting for axis in axes):
            samples -= 1
            self.time += 1
            for axis in axes:
                axis.sample()
                if axis.armed != "off":
                    axis.look_at_breakpoint(self.time)
            self._look_at_interrupts()
        self.time += samples

    def set_limit(self, axis: int, *, positive: bool | None = None, negative: bool | None = None) -> None:
        """Activate or release a limit switch of an axis."""
        limits = self.axes[check_axis(axis)].limits
        for place, met in enumerate((positive, negative)):
            if met is not None:
                limits[place] = met
        self.axes[axis].meet_limits()
        self._look_at_interrupts()

    def pulse(self, axis: int, source: str) -> None:
        """Give an axis an "index" pulse, a "home" signal, or the signal of an external breakpoint, "ext"."""
        if source not in {"index", "home", "ext"}:
            raise ValueError(f"source must be 'index', 'home' or 'ext', not {source!r}")
        self.axes[check_axis(axis)].pulse(source)
        self._look_at_interrupts()

    def hold(self, axis: int, *, held: bool = True) -> None:
        """Hold a motor, so that it does not follow its target; on release it catches up immediately."""
        state = self.axes[check_axis(axis)]
        state.held = held
        if not held and state.motor_on:
            state.lost = 0

    def turn_master(self, axis: int, counts: int) -> None:
        """Turn the master encoder of an axis in electronic gear.

        Raises:
            ValueError: the axis has no electronic gear.
        """
        if check_axis(axis) not in self._geared:
            raise ValueError(f"axis {axis} has no electronic gear; see `geared` of ChipSet")
        self.axes[axis].follow(counts)
        self._look_at_interrupts()

    def raise_event(self, axis: int, event: int) -> None:
        """Set an event that is not simulated, such as a commutation error."""
        self.axes[check_axis(axis)].raise_event(event)
        self._look_at_interrupts()


_OWN: Final = {name.removeprefix("_do_") for name in vars(ChipSet) if name.startswith("_do_")}
NEEDS.commands({*AXIS_COMMANDS, *_OWN})


def _respond(response: type[mc1231a.Response] | None) -> Callable[[float | None], mc1231a.Response]:
    """Return the function that converts a result to a response of one field or none."""
    assert response is not None  # every packet is answered
    make: Callable[..., mc1231a.Response] = response
    if not response.FIELDS:
        return lambda _result: make()
    (field,) = response.FIELDS
    return lambda result: make(**{field: result})
