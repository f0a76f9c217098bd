"""The host of one device: how it comes back in step, and what its commands act on."""

from __future__ import annotations

from collections.abc import Mapping

from qlinkgen._dataclass import dataclass
from qlinkgen.model.transaction import Selection
from qlinkgen.plan.check import Check
from qlinkgen.plan.tree import Plan


@dataclass(frozen=True)
class HostPlan:
    """What a host sends of itself, and how it recognises the answers.

    Attributes:
        command: command whose answer shows that host and device are in step.
        fill: byte that ends a packet which the device has begun.
        fills: other bytes that end the packets of some commands.
        rejected: bytes of the check value that rejects a command, empty if there is none.
        selected: what others act on, such as an axis; "" if nothing is selected.
        selects: commands that select it, by its number.
        lost_by: commands after which it is unknown what is selected.
    """

    command: str
    fill: int
    fills: Mapping[str, int]
    rejected: bytes
    selected: str
    selects: Mapping[int, str]
    lost_by: tuple[str, ...]


def selection_of(plan: Plan) -> Selection | None:
    """What commands of a host act on; None without one, or if a command that selects is left out."""
    selection = plan.protocol.bus.selection
    return (
        selection if selection is not None and _kept(plan).issuperset(selection.commands.values()) else None
    )


def host_of(plan: Plan) -> HostPlan | None:
    """The host of a protocol; None for others, if the schema does not state it, or without its commands."""
    stated, selection = plan.protocol.bus.resync, selection_of(plan)
    if stated is None or (selection is None and plan.protocol.bus.selection is not None):
        return None
    kept = _kept(plan)
    if stated.command not in kept:
        return None
    return HostPlan(
        command=stated.command,
        fill=stated.fill,
        fills={name: fill for name, fill in stated.fills.items() if name in kept},
        rejected=_rejected(plan.frames["response"].check),
        selected=selection.attribute if selection else "",
        selects=selection.commands if selection else {},
        lost_by=tuple(name for name in (selection.lost_by if selection else ()) if name in kept),
    )


def _kept(plan: Plan) -> set[str]:
    """The commands of which no message is left out."""
    known = plan.by_name
    return {each.name for each in plan.commands if each.response is None or each.response.name in known}


def _rejected(check: Check | None) -> bytes:
    return b"" if check is None or check.rejected is None else check.pack(check.rejected)
