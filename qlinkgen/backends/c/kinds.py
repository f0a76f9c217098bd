"""Several kinds of frame in C: each is wrapped and scanned by functions of its own, which two others call."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from qlinkgen.backends.c.coding import EndedView
from qlinkgen.backends.c.crc import CheckView
from qlinkgen.backends.c.layout import Layouts
from qlinkgen.backends.c.names import unsigned, unsigned_type
from qlinkgen.backends.c.parts import PartWriter
from qlinkgen.backends.c.places import id_bits, in_hex, sender_of
from qlinkgen.backends.c.views import (
    FrameView,
    PartsView,
    PlainView,
    directed,
    ended_view,
    frame_view,
    own_prefix,
    parts_view,
    plain_view,
    seeds_of,
)
from qlinkgen.plan.ends import ByMessage
from qlinkgen.plan.framing import FramePlan
from qlinkgen.plan.transparency import Coded
from qlinkgen.plan.tree import Plan


@dataclass(frozen=True, slots=True, kw_only=True)
class KindView:
    """A kind of frame.

    Attributes:
        name: its name.
        carries: the condition on ``id`` and ``size`` of what it carries.
        goes: the condition for the direction of a receiver, "" if both have the kind.
        parameters: those of the function that wraps, for number, address and values.
        arguments: what is passed to it.
        id: the expression for the message id of a received frame.
        address: the expression for its address.
        sized_by_message: its message gives its size.
        key: what the names of the functions of its only check value begin with.
        check: the algorithm of that, None if there is none or several.
        unused: parameters that the function that wraps does not use.
        get_values: statements that read the values of a received frame.
        own: what the names of its functions begin with.
        turned: only its turn tells it, so it is its payload.
        starts: rows of the message ids that its frames begin with, [] if a constant begins them.
        ended: its terminator, None without one; then ``frame`` and ``whole`` are views for its template.
    """

    name: str
    carries: str
    goes: str
    parameters: str
    arguments: str
    id: str
    address: str
    sized_by_message: bool
    key: str
    check: CheckView | None
    unused: list[str]
    get_values: list[str]
    own: str
    ended: EndedView | None
    frame: FrameView
    whole: PartsView
    most: int
    parts: PartsView
    plain: PlainView
    starts: Sequence[str]
    turned: bool

    @property
    def start_size(self) -> int:
        """Size of each message id that its frames begin with."""
        return self.starts[0].count("0x")


@dataclass(frozen=True, slots=True, kw_only=True)
class KindsView:
    """Several kinds of frame: in their order, and those that wrap in the order of their payloads.

    Receivers do not look for those that only their turn tells.
    """

    kinds: Sequence[KindView]
    wrapped: Sequence[KindView]
    overhead: int

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
        return list(dict.fromkeys(each.ended.last for each in self.kinds if each.ended))


@dataclass(frozen=True, slots=True, kw_only=True)
class KindsViews:
    """All views of the kinds of frame of a protocol."""

    algorithms: Sequence[CheckView]
    f: FrameView
    kinds: KindsView
    parts: PartsView


def kinds_views(plan: Plan, layouts: Layouts) -> KindsViews:
    """The views of a protocol with several kinds of frame."""
    bodies = [_body_size(each) for each in plan.frame.kinds]
    frame = frame_view(plan, body_size=max(bodies), max_wire=plan.frame.max_wire)
    kinds = {each.name: _kind(plan, each, frame, layouts) for each in plan.frame.kinds}
    ordered = sorted(plan.frame.kinds, key=lambda each: each.max_payload)
    first = kinds[plan.frame.sought[0].name].parts
    return KindsViews(
        algorithms=list(_writer(plan, plan.frame.kinds[0], layouts).algorithms.values()),
        f=frame,
        kinds=KindsView(
            kinds=list(kinds.values()),
            wrapped=[kinds[each.name] for each in ordered],
            overhead=min(each.envelope.overhead for each in plan.frame.kinds),
        ),
        parts=replace(
            first,
            judged=_unproven(plan),
            index_type=unsigned_type(max(16, plan.frame.max_wire.bit_length())),
            max_frame=f"{plan.frame.longest}U",
        ),
    )


def _unproven(plan: Plan) -> str:
    """The condition for a received frame of a kind without check value, "" if all have one."""
    terms = []
    for kind in plan.frame.sought:
        if kind.envelope.checks:
            continue
        goes = _goes(plan, kind, "receiver->direction")
        if not kind.envelope.preamble:
            held = "&receiver->wire[receiver->first], (size_t)receiver->filled - receiver->first"
            tests = [f"{plan.protocol.name}_begins_{kind.name}_({held})"]
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


def _body_size(kind: FramePlan) -> int:
    """Size of the buffer for decoding a frame, 0 if its bytes are sent as they are."""
    coded, envelope = kind.transparency, kind.envelope
    return envelope.overhead + envelope.payload.most if isinstance(coded, Coded) and coded.stages else 0


def _goes(plan: Plan, kind: FramePlan, direction: str) -> str:
    """The condition for the direction of a kind, "" if it goes both."""
    return f"{direction} == {plan.protocol.name.upper()}_{kind.only.upper()}" if kind.only else ""


def _writer(plan: Plan, kind: FramePlan, layouts: Layouts) -> PartWriter:
    prefix = plan.protocol.name
    return PartWriter(
        prefix,
        kind,
        sender_of(kind, prefix),
        layouts,
        seeds=seeds_of(plan),
        directed=directed(plan),
        own=own_prefix(prefix, kind.name),
        every=tuple(each.envelope for each in plan.frame.kinds),
        id_bits=id_bits(plan.frame),
    )


def _kind(
    plan: Plan,
    kind: FramePlan,
    frame: FrameView,
    layouts: Layouts,
) -> KindView:
    prefix = plan.protocol.name
    sender = sender_of(kind, prefix)
    writer = _writer(plan, kind, layouts)
    alone = writer.alone
    check = writer.algorithms[alone.check.algorithm] if alone else None
    parts = parts_view(writer, kind.max_wire)
    bits = frame.id_bits
    by_message = isinstance(kind.end, ByMessage)
    number = writer.message_id(writer.number(kind.envelope.id))
    address = parts.address_value if sender.address else "0U"
    values = writer.get_values() if plan.frame.values else []
    return KindView(
        name=kind.name,
        carries=_carries(plan.frame, kind, bits),
        goes=_goes(plan, kind, "direction"),
        parameters=sender.parameters,
        arguments=_arguments(kind, frame, sender.id_type, sender.address),
        id=number,
        address=address,
        sized_by_message=by_message,
        key=check.key if check else "",
        check=check,
        unused=[sender.id] if not kind.envelope.id else [],
        get_values=values,
        own=own_prefix(prefix, kind.name),
        ended=ended_view(writer, frame.pass_decode_direction) if kind.whole else None,
        frame=replace(frame, direction_unused=frame.needs_direction, body_size=_body_size(kind)),
        whole=replace(parts, id_value=number, address_value=address, get_values=values),
        most=kind.max_payload,
        parts=parts,
        plain=plain_view(writer, frame.pass_decode_direction),
        starts=[] if kind.envelope.preamble else [_row(start) for start in kind.envelope.starts],
        turned=kind.turned,
    )


def _row(start: bytes) -> str:
    return f"{{{', '.join(map(in_hex, start))}}}"


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
