"""Facts of the protocol beyond its schema, for the host and the simulated chip set."""

from __future__ import annotations

from typing import Final

from qlinkgen.codecs import mc1231a
from qlinkgen.codecs.mc1231a import AxisStatus
from qlinkgen.link.host_rules import HostRules

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
