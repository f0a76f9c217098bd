"""What the host and the simulated chip set have to know of the protocol beside its schema."""

from __future__ import annotations

from typing import Final

from qlinkgen.codecs import mc1231a
from qlinkgen.codecs.mc1231a import AxisStatus
from qlinkgen.link.host_rules import HostRules

AXES: Final = (1, 2)
#: Packet that makes an axis current.
SELECT: Final[dict[int, mc1231a.Request]] = {1: mc1231a.Set1Request(), 2: mc1231a.Set2Request()}

#: Bits of the status word that stay set until they are cleared.
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

#: 0x00 and 0xFF are no commands. As data a zero updates no axis and moves little; but in the masks that say
#: which events to keep it would clear them, and there ones do nothing.
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
    """Return the number of an axis, if it is one."""
    if axis not in AXES:
        raise ValueError(f"axis: {axis} was given; the chip set has axes 1 and 2")
    return axis
