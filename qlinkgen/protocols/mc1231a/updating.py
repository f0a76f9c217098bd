"""Procedures of updates with a check for the command error, for both clients."""

from __future__ import annotations

from qlinkgen.codecs import mc1231a
from qlinkgen.errors import CommandError
from qlinkgen.link.procedure import Ask, Procedure
from qlinkgen.link.transaction import Packet, Reply
from qlinkgen.protocols.mc1231a.facts import AXES, SELECT, AxisStatus, check_axis


def raise_command_error(axis: int) -> Procedure[int]:
    """Read the status word of an axis and return it.

    Raises:
        CommandError: its command error bit is set.
    """
    packet = Packet(mc1231a.GetStatusRequest(), SELECT[check_axis(axis)], check=True)
    reply: Reply = yield Ask(packet)
    status: int = reply.response.status
    if status & AxisStatus.COMMAND_ERROR:
        raise CommandError(
            f"axis {axis}: command error, status 0x{status:04X}: an invalid change was dropped, the rest of "
            "its update took effect; the bit stays set until clr_status or rst_status",
            status=status,
            node=axis,
            attempts=reply.attempts,
            elapsed=reply.elapsed,
        )
    return status


def update(axis: int, *, check: bool) -> Procedure[mc1231a.UpdateResponse]:
    """Update one axis; with `check`, then check for the command error."""
    reply: Reply = yield Ask(Packet(mc1231a.UpdateRequest(), SELECT[check_axis(axis)]))
    if check:
        yield from raise_command_error(axis)
    response: mc1231a.UpdateResponse = reply.response
    return response


def multi_update(axes: int, *, check: bool) -> Procedure[mc1231a.MultiUpdateResponse]:
    """Update several axes; with `check`, then check each for the command error."""
    reply: Reply = yield Ask(Packet(mc1231a.MultiUpdateRequest(axes=axes)))
    for axis in axes_in(axes) if check else ():
        yield from raise_command_error(axis)
    response: mc1231a.MultiUpdateResponse = reply.response
    return response


def axes_in(mask: int) -> list[int]:
    """Return the axes of a mask."""
    return [axis for axis in AXES if mask >> (axis - 1) & 1]
