"""Facts of the protocol beyond its schema, for the host and the simulated chip set."""

from __future__ import annotations

from typing import Final, TypeAlias

from qlinkgen.codecs import mc1231a
from qlinkgen.link.host_rules import HostRules
from qlinkgen.protocols.needs import Needs

#: Fields by message, and values by enum or flags, that this package uses.
FIELDS: Final = {
    **dict.fromkeys(("set_1.request", "set_2.request", "set_i.request", "reset.request"), ""),
    **dict.fromkeys(("update.request", "update.response", "rst_status.request", "rst_intrpt.request"), ""),
    "multi_update.request": "axes",
    "multi_update.response": "",
    "get_status.request": "",
    "get_status.response": "status",
    **{
        f"set_{register}.request": "value"
        for register in ("pos", "vel", "acc", "max_acc", "jerk", "ratio", "buf_mtr_cmd", "brk_pnt")
    },
    **{f"set_{register}.request": "value" for register in ("pos_err", "mtr_lmt", "mtr_bias")},
    "set_intrpt_mask.request": "mask",
}
ENUMS: Final = {
    "axis_status": (
        "motion_complete position_wrapped breakpoint_reached capture_received motion_error positive_limit "
        "negative_limit command_error motor_on axis_on in_motion commutation_error"
    ),
    "output_mode": "pwm dac16",
}
NEEDS: Final = Needs(mc1231a, "qlinkgen/protocols/mc1231a")
NEEDS.check(FIELDS, enums=ENUMS, attributes=("axis", "double_buffered"))
AxisStatus: TypeAlias = mc1231a.AxisStatus

#: Latched bits of the status word.
EVENTS: Final = (
    AxisStatus.MOTION_COMPLETE
    | AxisStatus.POSITION_WRAPPED
    | AxisStatus.BREAKPOINT_REACHED
    | AxisStatus.CAPTURE_RECEIVED
    | AxisStatus.MOTION_ERROR
    | AxisStatus.POSITIVE_LIMIT
    | AxisStatus.NEGATIVE_LIMIT
    | AxisStatus.COMMAND_ERROR
    | AxisStatus.COMMUTATION_ERROR
)

#: How the host comes back in step, and selects an axis.
RULES: Final = HostRules.of(mc1231a)
#: Packet that selects an axis.
SELECT: Final = RULES.selects
AXES: Final = tuple(SELECT)


def check_axis(axis: int) -> int:
    """Return the number of an axis after checking it."""
    if axis not in AXES:
        raise ValueError(f"axis must be 1 or 2, not {axis}")
    return axis
