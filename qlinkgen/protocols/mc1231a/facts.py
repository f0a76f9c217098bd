"""Facts of the protocol beyond its schema, for the host and the simulated chip set."""

from __future__ import annotations

from typing import Final

from qlinkgen.codecs import mc1231a
from qlinkgen.codecs.mc1231a import AxisStatus
from qlinkgen.link.host_rules import HostRules

AXES: Final = (1, 2)
#: Packet that selects an axis.
SELECT: Final[dict[int, mc1231a.Request]] = {1: mc1231a.Set1Request(), 2: mc1231a.Set2Request()}

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

#: Fill bytes: 0x00 and 0xFF are not commands. As data, zeros update no axis and move little; but in the masks
#: of events to keep they would clear events, where ones have no effect.
RULES: Final = HostRules(
    proof=mc1231a.GetStatusRequest(),
    context=SELECT[1],
    contexts={
        mc1231a.Set1Request: mc1231a.Set1Request,
        mc1231a.Set2Request: mc1231a.Set2Request,
        mc1231a.SetIRequest: None,
        mc1231a.ResetRequest: None,
    },
    fill=0x00,
    fills={mc1231a.RstStatusRequest: 0xFF, mc1231a.RstIntrptRequest: 0xFF},
)


def check_axis(axis: int) -> int:
    """Return the number of an axis after checking it."""
    if axis not in AXES:
        raise ValueError(f"axis must be 1 or 2, not {axis}")
    return axis
