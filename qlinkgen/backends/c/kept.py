"""The last answer of a slave, which it sends once more if the counter tells that a request is repeated."""

from __future__ import annotations

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.c.names import Names, scalar_type
from qlinkgen.model import naming
from qlinkgen.plan.tree import Plan


@dataclass(frozen=True, slots=True)
class Kept:
    """What a slave keeps.

    Attributes:
        member: the member of the parts with the number.
        type: its type.
        master: the member with the number of the master, "" without one; ``master_type`` is its type.
        ids: ids of the requests whose answers are kept.
        restarting: ids of those after which the counter begins anew.
        size: of the longest answer.
    """

    member: str
    type: str
    master: str
    master_type: str
    ids: list[str]
    restarting: list[str]
    size: int


def kept(plan: Plan, names: Names) -> Kept | None:
    """What a slave keeps, None if it handles repeats."""
    protocol, counter, master = plan.protocol, plan.protocol.counter, plan.protocol.master
    handled = [each for each in plan.commands if each.request.name in plan.by_name]
    commands = [each for each in handled if protocol.keeps(each)]
    if not commands or counter is None or counter.type is None:
        return None
    answers = [plan.by_name.get(answer.name) for each in commands for answer in each.answers]
    beside = {each.name for each in plan.beside.values()}
    told = master is not None and master.type is not None and master.name in beside
    return Kept(
        naming.member(counter.name),
        scalar_type(counter.type),
        naming.member(master.name) if told and master else "",
        scalar_type(master.type) if told and master and master.type else "",
        [f"{names.constant(each.request)}_ID" for each in commands],
        [f"{names.constant(each.request)}_ID" for each in handled if each.restart is not None],
        max((each.wire_size for each in answers if each is not None), default=1),
    )
