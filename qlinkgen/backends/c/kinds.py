"""Several kinds of frame in C: each has the functions of a single frame, to which those for all pass on."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.c.layout import Layouts
from qlinkgen.backends.c.names import unsigned, unsigned_type
from qlinkgen.backends.c.places import in_hex, sender_of
from qlinkgen.backends.c.views import (
    FrameView,
    PartsView,
    PartsViews,
    PlaceView,
    frame_view,
    kind_views,
    own_prefix,
)
from qlinkgen.plan.framing import FramePlan
from qlinkgen.plan.tree import Plan


@dataclass(frozen=True, slots=True, kw_only=True)
class KindView:
    """A kind of frame, to which functions for all kinds pass on.

    Attributes:
        carries: the condition on ``id`` and ``size`` of what it carries.
        goes: the condition for the direction of a receiver, "" if both have the kind.
        arguments: what is passed to the function that wraps.
        own: what the names of its functions begin with.
        body_size: size of its buffer for decoding, 0 without one.
        late_insert: an inserted byte may follow its frames.
        last: the last byte of its terminator, "" without one.
        turned: only its turn tells it.
    """

    carries: str
    goes: str
    arguments: str
    own: str
    body_size: int
    late_insert: bool
    last: str
    turned: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class KindsView:
    """Several kinds of frame: in their order, and those that wrap in the order of their payloads.

    Receivers do not look for those that only their turn tells.
    """

    kinds: Sequence[KindView]
    wrapped: Sequence[KindView]

    @property
    def parted(self) -> bool:
        """Whether some kinds go one direction alone."""
        return any(each.goes for each in self.kinds)

    @property
    def sought(self) -> Sequence[KindView]:
        """The kinds that receivers look for."""
        return [each for each in self.kinds if not each.turned]

    @property
    def lasts(self) -> Sequence[str]:
        """The last bytes of terminators."""
        return list(dict.fromkeys(each.last for each in self.kinds if each.last))


@dataclass(frozen=True, slots=True, kw_only=True)
class KindsViews:
    """All views of the kinds of frame of a protocol; ``each`` has those of a kind by its name."""

    f: FrameView
    kinds: KindsView
    place: PlaceView
    parts: PartsView
    each: Mapping[str, PartsViews]


def kinds_views(plan: Plan, layouts: Layouts) -> KindsViews:
    """The views of a protocol with several kinds of frame."""
    whole = frame_view(plan, max_wire=plan.frame.max_wire)
    each = {kind.name: kind_views(plan, kind, whole, layouts) for kind in plan.frame.kinds}
    kinds = {kind.name: _kind(plan, kind, whole, each[kind.name]) for kind in plan.frame.kinds}
    ordered = sorted(plan.frame.kinds, key=lambda kind: kind.max_payload)
    return KindsViews(
        f=replace(whole, body_size=max(views.f.body_size for views in each.values())),
        kinds=KindsView(
            kinds=list(kinds.values()),
            wrapped=[kinds[kind.name] for kind in ordered],
        ),
        place=PlaceView(
            tailed=True,
            tail=0,
            header=0,
            overhead=min(kind.envelope.least_overhead for kind in plan.frame.kinds),
        ),
        parts=replace(
            each[plan.frame.sought[0].name].parts,
            judged=_unproven(plan),
            late_insert=any(kind.late_insert for kind in kinds.values()),
            index_type=unsigned_type(max(16, plan.frame.max_wire.bit_length())),
            max_frame=f"{plan.frame.longest}U",
        ),
        each=each,
    )


def _unproven(plan: Plan) -> str:
    """The condition for a received frame of a kind without check value, "" if all have one."""
    terms = []
    for kind in plan.frame.sought:
        if kind.envelope.checks or kind.envelope.blocks:
            continue
        goes = _goes(plan, kind, "receiver->direction")
        if not kind.envelope.preamble:
            held = "&receiver->wire[receiver->first], (size_t)receiver->filled - receiver->first"
            tests = [f"{own_prefix(plan.protocol.name, kind.name)}_begins_({held})"]
        else:
            offsets = ["", *(f" + {at}U" for at in range(1, len(kind.envelope.preamble)))]
            tests = [
                f"(receiver->wire[receiver->first{offset}] == {in_hex(byte)})"
                for offset, byte in zip(offsets, kind.envelope.preamble, strict=True)
            ]
        if goes := _goes(plan, kind, "receiver->direction"):
            tests.append(f"({goes})")
        terms.append(" && ".join(tests) if len(tests) == 1 else f"({' && '.join(tests)})")
    return " || ".join(terms)


def _goes(plan: Plan, kind: FramePlan, direction: str) -> str:
    """The condition for the direction of a kind, "" if it goes both."""
    return f"{direction} == {plan.protocol.name.upper()}_{kind.only.upper()}" if kind.only else ""


def _kind(plan: Plan, kind: FramePlan, whole: FrameView, views: PartsViews) -> KindView:
    sender = sender_of(kind, plan.protocol.name)
    return KindView(
        carries=_carries(plan.frame, kind, whole.id_bits),
        goes=_goes(plan, kind, "direction"),
        arguments=_arguments(kind, whole, sender.id_type, sender.address),
        own=own_prefix(plan.protocol.name, kind.name),
        body_size=views.f.body_size,
        late_insert=views.parts.late_insert,
        last=views.ended.last if views.ended else "",
        turned=kind.turned,
    )


def _carries(frame: FramePlan, kind: FramePlan, bits: int) -> str:
    """The condition on the id and the payload size of what a kind carries."""
    fits = f"size <= {kind.max_payload}U" if kind.max_payload else "size == 0U"
    bases = sorted({each.base for each in frame.kinds})
    if len(bases) == 1:
        return fits
    step = math.gcd(*bases)  # a family without messages has no kinds
    shift = step.bit_length() - 1
    family = f"(id >> {shift})" if shift else "id"
    return f"({family} == {unsigned(kind.base // step, bits)}) && ({fits})"


def _arguments(kind: FramePlan, frame: FrameView, id_type: str, address: str) -> str:
    own = sum(each.bits for each in kind.envelope.id) or 8
    number = frame.id
    if id_type != frame.id_type or kind.base:
        number = f"({id_type})({frame.id} & {unsigned((1 << own) - 1, own, hexadecimal=True)})"
    given = [number, *([frame.address] if address else []), *(["parts"] if kind.values else [])]
    return ", ".join(given)
