"""The effect of each command on its axis, as a table: name to a function of the axis."""

from __future__ import annotations

from collections.abc import Callable
from operator import attrgetter
from typing import Final

from qlinkgen.protocols.mc1231a.chip_axis import ChipAxis
from qlinkgen.protocols.mc1231a.registers import BUFFERED, IMMEDIATE, READABLE
from qlinkgen.protocols.mc1231a.trajectory import GEAR, S_CURVE, TRAPEZOIDAL, VELOCITY

Action = Callable[..., float | None]


def _writes(register: str) -> Action:
    return lambda axis, value: axis.write(register, value)


def _reads(register: str) -> Action:
    return lambda axis: axis.values[register]


def _sets(attribute: str, value: str | bool) -> Action:
    return lambda axis: setattr(axis, attribute, value)


def _selects(mode: int) -> Action:
    return lambda axis: axis.set_mode(mode)


def _waits(action: str) -> Action:
    return lambda axis: axis.pending.add(action)


_PROFILES = {"trap": TRAPEZOIDAL, "vel": VELOCITY, "s_crv": S_CURVE, "gear": GEAR}
_BREAKPOINTS = ("time", "pos", "neg", "actl_pos", "actl_neg", "mtn_cmplt", "ext")

AXIS_COMMANDS: Final[dict[str, Action]] = {
    **{f"set_{register}": _writes(register) for register in (*BUFFERED, *IMMEDIATE)},
    **{f"get_{register}": _reads(register) for register in READABLE},
    **{f"set_prfl_{name}": _selects(mode) for name, mode in _PROFILES.items()},
    **{f"set_{kind}_brk": _sets("armed", kind) for kind in _BREAKPOINTS},
    **{action: _waits(action) for action in ("stop", "smooth_stop", "synch_prfl")},
    "set_brk_off": _sets("armed", "off"),
    "set_auto_stop_on": _sets("auto_stop", True),
    "set_auto_stop_off": _sets("auto_stop", False),
    "set_auto_update_on": _sets("auto_update", True),
    "set_auto_update_off": _sets("auto_update", False),
    "set_capt_index": _sets("capture_source", "index"),
    "set_capt_home": _sets("capture_source", "home"),
    "mtr_on": lambda axis: axis.switch_motor(on=True),
    "mtr_off": lambda axis: axis.switch_motor(on=False),
    "axis_on": lambda axis: axis.switch_axis(on=True),
    "axis_off": lambda axis: axis.switch_axis(on=False),
    "lmts_on": lambda axis: axis.switch_limits(on=True),
    "lmts_off": lambda axis: axis.switch_limits(on=False),
    "set_mtr_cmd": ChipAxis.set_motor_command,
    "set_actl_pos": ChipAxis.set_actual,
    "update": ChipAxis.update,
    "clr_status": ChipAxis.keep_events,
    "rst_status": ChipAxis.keep_events,
    "get_capt": ChipAxis.take_capture,
    "get_status": attrgetter("status"),
    "get_mode": attrgetter("mode"),
    "get_trgt_pos": attrgetter("target"),
    "get_trgt_vel": attrgetter("velocity"),
    "get_actl_pos": attrgetter("actual"),
    "get_actl_pos_err": attrgetter("position_error"),
    "get_mtr_cmd": attrgetter("motor_command"),
    # Neither a filter nor a commutation is simulated.
    "get_intgr": lambda _axis: 0,
    "get_phase_info": lambda _axis: 0,
    "init_phase": lambda _axis: None,
}
