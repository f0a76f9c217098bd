"""The counter of requests in C: the function with which a master numbers them."""

from __future__ import annotations

from collections.abc import Sequence

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.c.names import Names, scalar_type, unsigned
from qlinkgen.model import naming
from qlinkgen.plan import Plan


@dataclass(frozen=True, slots=True)
class Counter:
    """The function that gives a request its number.

    Attributes:
        member: the member of the parts.
        type: the type of a number.
        id_type: the type of a message id.
        first: the number of the first request to a node.
        mask: the bits of a number.
        per_frame: a repeat has a number of its own, too.
        counted: ids of the messages that have numbers; () for all.
        restarting: ids of requests that set the next number, and that number.
    """

    member: str
    type: str
    id_type: str
    first: str
    mask: str
    per_frame: bool
    counted: Sequence[str]
    restarting: Sequence[tuple[str, str]]

    @property
    def others(self) -> Sequence[str]:
        """Ids of the messages that have numbers and do not set the next one."""
        restarting = [each for each, _ in self.restarting]
        return [each for each in self.counted if each not in restarting]


def counter(plan: Plan, names: Names, id_type: str) -> Counter | None:
    """The counter of what a master sends, None if its frames have none."""
    found, protocol = plan.protocol.counter, plan.protocol
    sent = [each.message for each in plan.messages if each.encoded and each.direction != "response"]
    counted = [each for each in sent if protocol.counts(each)]
    if found is None or found.type is None or found.counting is None or not counted:
        return None
    kept = {each.name for each in sent}
    restarts = [each for each in plan.commands if each.restart is not None and each.request.name in kept]
    restarting = [
        (f"{names.constant(each.request)}_ID", unsigned(each.restart or 0, found.bits)) for each in restarts
    ]
    return Counter(
        member=naming.member(found.name),
        type=scalar_type(found.type),
        id_type=id_type,
        first=restarting[0][1] if restarting else unsigned(0, found.bits),
        mask=unsigned((1 << found.bits) - 1, found.bits, hexadecimal=True),
        per_frame=found.counting.per_frame,
        counted=[] if counted == sent else [f"{names.constant(each)}_ID" for each in counted],
        restarting=restarting,
    )
