"""The expected state of a chip set after received commands: a simple model of its registers."""

from __future__ import annotations

from typing import Any

from qlinkgen.codecs import mc1231a

AXES = (1, 2)
_VALUES = {
    name.removeprefix("set_"): command
    for name, command in mc1231a.COMMANDS.items()
    if name.startswith("set_") and command.request.FIELDS and command.attributes["axis"] == "current"
}
#: Registers that are written, and read back unchanged. The manual motor command depends on the loop.
REGISTERS = tuple(name for name in _VALUES if f"get_{name}" in mc1231a.COMMANDS and name != "mtr_cmd")
BUFFERED = tuple(name for name in REGISTERS if _VALUES[name].attributes["double_buffered"] is True)
#: Field of a register's request and response.
FIELD = {name: _VALUES[name].request.FIELDS[0] for name in REGISTERS}
#: Commands that choose one of several states, by the choice; no source says how to read them back.
CHOICES = {
    "profile": ("set_prfl_trap", "set_prfl_vel", "set_prfl_s_crv", "set_prfl_gear"),
    "auto_stop": ("set_auto_stop_off", "set_auto_stop_on"),
    "auto_update": ("set_auto_update_off", "set_auto_update_on"),
    "capture": ("set_capt_index", "set_capt_home"),
    "limits": ("lmts_on", "lmts_off"),
    "motor": ("mtr_on", "mtr_off"),
    "armed": ("set_brk_off", "set_ext_brk", "set_mtn_cmplt_brk"),
}
CHOOSES = {command: choice for choice, commands in CHOICES.items() for command in commands}


class ModelAxis:
    """Registers and choices of one axis, which is not serviced, so that it does not move."""

    def __init__(self) -> None:
        self.values: dict[str, Any] = dict.fromkeys(REGISTERS, 0)
        self.values.update(pos_err=32767, mtr_lmt=32767, phase_cnts=129)
        self.active = {name: self.values[name] for name in BUFFERED}
        self.chosen = {choice: commands[0] for choice, commands in CHOICES.items()}

    def update(self) -> None:
        """Take over the buffered values."""
        self.active = {name: self.values[name] for name in BUFFERED}


class Model:
    """The whole chip set."""

    def __init__(self) -> None:
        self.axes = {axis: ModelAxis() for axis in AXES}
        self.output = mc1231a.OutputMode.PWM

    def differences(self, chip: Any) -> list[str]:
        """The differences to a simulated chip set."""
        found = []
        for number, axis in self.axes.items():
            there = chip.axes[number]
            held = {**there.values, "actl_pos": there.actual}
            wanted = axis.values
            found += [
                f"axis {number}: {name} is {held[name]}, not {wanted[name]}"
                for name in REGISTERS
                if held[name] != wanted[name]
            ]
            found += [
                f"axis {number}: {name} active is {there.active[name]}, not {axis.active[name]}"
                for name in BUFFERED
                if there.active[name] != axis.active[name]
            ]
            flags = _chosen(there)
            found += [
                f"axis {number}: {choice} is {flags[choice]}, not {command}"
                for choice, command in axis.chosen.items()
                if flags[choice] != command
            ]
        return found


def _chosen(axis: Any) -> dict[str, str]:
    """The choices of a simulated axis, as the commands that make them."""
    return {
        "profile": CHOICES["profile"][axis.trajectory.mode],
        "auto_stop": CHOICES["auto_stop"][axis.auto_stop],
        "auto_update": CHOICES["auto_update"][axis.auto_update],
        "capture": CHOICES["capture"][axis.capture_source == "home"],
        "limits": CHOICES["limits"][not axis.limits_on],
        "motor": CHOICES["motor"][not axis.motor_on],
        "armed": "set_brk_off" if axis.armed == "off" else f"set_{axis.armed}_brk",
    }
