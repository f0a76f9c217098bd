"""Views of several kinds of frame: for each kind how it is made, found and verified."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.python import integers, pieces, values
from qlinkgen.backends.python.check_views import CheckView
from qlinkgen.backends.python.conditional import AfterView, after_view
from qlinkgen.backends.python.decode import Decoder
from qlinkgen.backends.python.encode import Encoder
from qlinkgen.backends.python.frame_checks import seed_name
from qlinkgen.backends.python.frame_views import FrameView, PartsView
from qlinkgen.backends.python.frames import parts_of_kind
from qlinkgen.backends.python.layout import bare, in_hex, literal
from qlinkgen.backends.python.names import attribute, natural
from qlinkgen.backends.python.place import Place
from qlinkgen.model.naming import address_argument, address_attribute
from qlinkgen.model.types import Scalar
from qlinkgen.plan.ends import ByMessage
from qlinkgen.plan.envelope import Envelope
from qlinkgen.plan.framing import FramePlan
from qlinkgen.plan.parts import (
    AddressPart,
    AddressSlot,
    BlocksPart,
    CellPart,
    CheckPart,
    ConstantPart,
    ConstantSlot,
    EqualPart,
    IdPart,
    IdSlot,
    LengthPart,
    MarkPart,
    Numeric,
    Part,
    PayloadPart,
    Seed,
    Slot,
)
from qlinkgen.plan.payload import Member, by_slot
from qlinkgen.plan.tree import MessagePlan, Plan


@dataclass(frozen=True)
class KindView:
    """A kind of frame.

    Attributes:
        name: its name.
        parts: the view of its frame, whose names end with that of the kind.
        numbers: statements that compute the numbers of its parts from those of message, address and payload.
        front: expressions for the bytes before the payload.
        back: those after it, with zeros for check values.
        seeded: check values cover attributes of the message.
        checked_values: statements that convert and check the values of the frame of ``message``.
        held_values: statements that set the values of ``message`` from ``frame``.
        holds: it has values.
        turned: only its turn in a dialogue tells it, so decoders of frames do not know it.
    """

    name: str
    parts: PartsView
    numbers: Sequence[str]
    front: str
    back: str
    seeded: bool
    checked_values: Sequence[str]
    held_values: Sequence[str]
    holds: bool
    turned: bool

    @property
    def insert(self) -> str:
        """The inserted byte that may follow a frame, "" if none may."""
        stuffing = self.parts.stuffing
        return stuffing.insert if stuffing and stuffing.whole and not stuffing.coding else ""


@dataclass(frozen=True)
class AddressNames:
    """The address in Python: its attribute, its parameter, and its default."""

    name: str
    parameter: str
    default: int


@dataclass(frozen=True)
class ValueView:
    """A value of frames in Python: its attribute, the type of that, and its default."""

    name: str
    annotation: str
    default: str


@dataclass(frozen=True)
class KindsView:
    """Several kinds of frame.

    Attributes:
        firsts: the bytes with which frames begin.
        found: the kinds that are decoded.
        by_first: the kinds by first byte, by direction; that is "" if both have the same kinds.
        families: the maximum payload size of each kind, by the base of its messages.
        shift: bits of the numbers of messages in frames.
        measured: the message gives the size of some kinds.
        idle: as for other frames.
        check: the algorithm that another can replace, in all kinds that have a check value; None without one.
        values: the values of frames of any kind.
        slots: the names of attributes of all messages.
        seeds: attributes of message classes that check values cover.
        counted: some kinds have a counter.
        settled: some messages have values that are always the same.
        restarts: it begins anew after some commands.
        ended: terminators end some kinds.
        lasts: the bytes that may end a frame before its size is received, or reveal that it is none.
        eager: any byte may.
    """

    title: str
    kinds: Sequence[KindView]
    address: AddressNames | None
    firsts: Sequence[str]
    found: Sequence[KindView]
    by_first: Mapping[str, Sequence[tuple[str, Sequence[KindView]]]]
    families: Sequence[tuple[str, Sequence[tuple[int, KindView, int]]]]
    measured: bool
    makers: frozenset[str]
    values: Sequence[ValueView]
    slots: Sequence[str]
    seeds: Sequence[str]
    counted: bool
    settled: bool
    restarts: bool
    ended: bool
    lasts: Sequence[str]
    eager: bool
    check: CheckView | None

    template = "kinds"
    idle = None

    @property
    def coded(self) -> bool:
        """Whether frames of some kinds are coded."""
        return any(each.parts.coding or each.parts.stuffing for each in self.kinds)

    @property
    def inserts(self) -> bool:
        """Whether an inserted byte may follow some frames."""
        return any(each.insert for each in self.found)

    @property
    def has_turns(self) -> bool:
        """Whether only its turn tells some frames."""
        return any(each.turned for each in self.kinds)

    @property
    def parted(self) -> bool:
        """Whether the directions have different kinds."""
        return "" not in self.by_first


AnyView = FrameView | KindsView


def kinds_view(plan: Plan, title: str, make: Maker) -> KindsView:
    """The view of the kinds of frame of a protocol; ``make`` names its conversions."""
    views = {frame.name: _kind(frame, plan, make) for frame in plan.frame.kinds}
    check = _selectable(list(views.values()))
    if check is None:
        views = {name: replace(view, parts=_unreplaced(view.parts)) for name, view in views.items()}
    families: dict[int, list[tuple[int, KindView, int]]] = {}
    for frame in sorted(plan.frame.kinds, key=lambda each: each.max_payload):
        families.setdefault(frame.base, []).append((frame.max_payload, views[frame.name], frame.base))
    received = {each: plan.frames[each].kinds for each in plan.received_directions}
    searched = received if plan.parted else {"": plan.frame.kinds}
    by_first = {way: _by_first(kinds, views) for way, kinds in searched.items()}
    nodes = plan.protocol.bus.nodes
    name = plan.frame.address
    address = AddressNames(address_attribute(name), address_argument(name), nodes[0] if nodes else 0)
    return KindsView(
        title=title,
        kinds=list(views.values()),
        address=address if name else None,
        firsts=[
            literal(bytes((first,)))
            for first in dict.fromkeys(first for rows in by_first.values() for first, _ in rows)
        ],
        found=[views[each.name] for each in plan.frame.sought if any(each in s for s in searched.values())],
        by_first={way: [(in_hex(first), kinds) for first, kinds in rows] for way, rows in by_first.items()},
        families=[(in_hex(base), kinds) for base, kinds in families.items()],
        measured=any(isinstance(frame.end, ByMessage) for frame in plan.frame.kinds),
        values=[_value(member, make.place) for member in plan.frame.values.values()],
        slots=sorted([*([address.name] if name else []), *map(attribute, plan.frame.values)], key=natural),
        seeds=sorted({seed_name(seed) for each in plan.frame.kinds for seed in _seeds(each)}),
        counted=plan.protocol.counter is not None,
        settled=any(each.message.settled for each in plan.messages),
        restarts=plan.protocol.restarts,
        ended=any(view.parts.ended for view in views.values()),
        lasts=list(dict.fromkeys(last for view in views.values() for last in _lasts(view.parts))),
        eager=any(_is_eager(view.parts) for view in views.values()),
        check=check,
        makers=frozenset(each.maker for view in views.values() for each in _every_check(view.parts)),
    )


def _by_first(
    kinds: Sequence[FramePlan], views: Mapping[str, KindView]
) -> Sequence[tuple[int, Sequence[KindView]]]:
    """Kinds by their first byte."""
    found: dict[int, list[KindView]] = {}
    for kind in kinds:
        for first in dict.fromkeys(start[0] for start in kind.envelope.starts):
            found.setdefault(first, []).append(views[kind.name])
    return list(found.items())


def _selectable(kinds: Sequence[KindView]) -> CheckView | None:
    """The main check value of the first kind that has one, if that of each can be replaced."""
    found = [check.view for kind in kinds for check in kind.parts.checks if check.main]
    return found[0] if found and all(view.selectable for view in found) else None


def _value(member: Member, place: Place) -> ValueView:
    kind = values.annotation(by_slot([member])[0], place)
    return ValueView(attribute(member.name), kind, values.default(member, place))


def _seeds(frame: FramePlan) -> Iterator[Seed]:
    for part in frame.envelope.checks:
        yield from frame.envelope.seeds(part)


def _of_message(after: AfterView) -> AfterView:
    """The view with statements of functions of ``message`` in place of methods."""
    octets, taken = (
        [line.replace("self.", "message.").replace("(self)", "(message)") for line in lines]
        for lines in (after.octets, after.taken)
    )
    return replace(after, octets=octets, taken=taken)


def _unreplaced(view: PartsView) -> PartsView:
    """The view of a frame whose check value no algorithm can replace."""
    assert view.kind is not None
    return replace(view, kind=replace(view.kind, passes=False))


def _every_check(view: PartsView) -> Iterator[CheckView]:
    """The check values of frames, those included that only some have, and of blocks."""
    yield from (each.view for each in (*view.checks, *(view.after.checks if view.after else ())))
    if view.blocks:
        yield view.blocks.view


def _lasts(view: PartsView) -> Iterator[str]:
    if view.ended:
        yield view.ended.last
    elif view.stuffing and view.stuffing.whole:
        yield from filter(None, [view.stuffing.reveals or view.stuffing.last])


def _is_eager(view: PartsView) -> bool:
    stuffing = view.stuffing
    coded = stuffing is not None and stuffing.whole and stuffing.coding is not None
    return coded and stuffing is not None and not (stuffing.reveals or stuffing.steady)


def _kind(frame: FramePlan, plan: Plan, make: Maker) -> KindView:
    envelope = frame.envelope.inner
    carried = next((each for each in plan.messages if frame in each.frames), None)
    members = Members(envelope, carried, make) if carried and frame.envelope.values else None
    after = after_view(frame.envelope, carried, make.place, make.scale) if carried else None
    address = pieces.number(envelope, envelope.address, "frame") if envelope.address else "None"
    result = f"message.from_bytes(payload{f', {address}' if plan.frame.address else ''})"
    if members:
        result = f"_held({result}, frame{', whole' if after and after.values else ''})"
    return KindView(
        name=frame.name,
        parts=replace(parts_of_kind(plan, frame, result), after=after and _of_message(after)),
        numbers=list(_numbers(envelope)),
        checked_values=members.checked if members else [],
        held_values=members.held if members else [],
        holds=members is not None,
        seeded=bool(envelope.seeded),
        front=" + ".join(_bytes(part) for part in envelope.front) or 'b""',
        back=" + ".join(_bytes(part) for part in envelope.back if not isinstance(part, BlocksPart)),
        turned=frame.turned,
    )


@dataclass(frozen=True)
class Maker:
    """What the code of values uses: the place of payloads, and the names of conversions."""

    place: Place
    scale: Callable[[str, Scalar], str]


class Members:
    """The values of a kind of frame.

    Attributes:
        checked: statements that convert and check those of ``message``.
        held: statements that set those of ``message`` from ``frame``.
    """

    checked: Sequence[str]
    held: Sequence[str]

    def __init__(self, envelope: Envelope, message: MessagePlan, make: Maker) -> None:
        """``message`` is one that the frame carries."""
        scaled = [member for _, member in envelope.values if member.number.scaling is not None]
        scales = {each.name: make.scale(each.name, each.number) for each in scaled}
        encoder = Encoder(message, make.place, "", "", scales)
        decoder = Decoder(message, make.place, "", scales)
        for part, member in envelope.values:
            encoder.put_member(member)
            place = -envelope.from_end(part) if part in envelope.back else envelope.offset(part)
            seen = pieces.read(envelope, part, "frame")
            seen = integers.bits_of(part.integer, seen, member.shift, member.bits)
            decoder.get_member(member, seen, str(place), "frame")
        # The statements are those of a method of the message.
        self.checked = [line.replace("self.", "message.") for line in encoder.checks]
        lines = decoder.assignments
        self.held = ["cls = type(message)", *lines] if any("illegal(" in line for line in lines) else lines


# Making a frame


def _numbers(envelope: Envelope) -> Iterator[str]:
    """Statements that assign the numbers of parts that are not just the message number or the address."""
    for part in envelope.parts:
        if isinstance(part, LengthPart | CellPart | EqualPart):
            yield f"{_local(part)} = {_number(part)}"


def _local(part: Numeric) -> str:
    match part:
        case IdPart():
            return "number"
        case AddressPart():
            return "address"
        case LengthPart() | CellPart() | EqualPart():
            return f"{part.name}_part"
        case _:
            assert_never(part)


def _number(part: LengthPart | CellPart | EqualPart) -> str:
    match part:
        case LengthPart():
            counted = (
                f"len(payload) {'+' if part.bias > 0 else '-'} {abs(part.bias)}"
                if part.bias
                else "len(payload)"
            )
            counted = f"({counted}) // {part.scale}" if part.scale > 1 else counted
            if part.otherwise is None:
                return counted
            return f"{counted} if {counted} <= {part.most} else {part.otherwise}"
        case CellPart():
            terms = [_bits(slot) for slot in part.slots]
            return terms[0].removeprefix("(").removesuffix(")") if len(terms) == 1 else " | ".join(terms)
        case EqualPart():
            return bare(pieces.derived_part(part, _local(part.of)))
        case _:
            assert_never(part)


def _bits(slot: Slot) -> str:
    match slot:
        case IdSlot():
            mask = in_hex((1 << slot.bits) - 1)
            taken = f"number >> {slot.at} & {mask}" if slot.at else f"number & {mask}"
            return f"(({taken}) << {slot.shift})" if slot.shift else f"({taken})"
        case AddressSlot():
            return f"address << {slot.shift}" if slot.shift else "address"
        case ConstantSlot():
            return in_hex(slot.values[0] << slot.shift)
        case Member():
            number = f"{slot.name}_raw"
            if slot.number.signed:
                number = f"({number} & {in_hex((1 << slot.bits) - 1)})"
            return f"{number} << {slot.shift}" if slot.shift else number
        case _:
            assert_never(slot)


def _bytes(part: Part) -> str:
    """The bytes of a part; zeros for a check value."""
    match part:
        case ConstantPart():
            return literal(part.data)
        case LengthPart() | IdPart() | AddressPart() | CellPart() | EqualPart():
            if part.integer.byteorder is not None:
                return integers.to_bytes(part.integer, _local(part))
            groups = [integers.group_out(_local(part), chunk) for chunk in part.integer.chunks]
            return f"bytes(({', '.join(groups)}{',' if len(groups) == 1 else ''}))"
        case CheckPart():
            return f"bytes({part.size})"
        case PayloadPart() | MarkPart() | BlocksPart():
            raise AssertionError(f"{part.name} is beside a payload")
        case _:
            assert_never(part)
