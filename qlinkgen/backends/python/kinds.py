"""Views of several kinds of frame: for each kind how it is made, found and verified."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import assert_never

from qlinkgen.backends.python import integers, pieces, values
from qlinkgen.backends.python.check_views import CheckView, PlacedCheck
from qlinkgen.backends.python.decode import Decoder
from qlinkgen.backends.python.encode import Encoder
from qlinkgen.backends.python.frame_checks import check_view, placed, seed_name
from qlinkgen.backends.python.frame_views import EndedView, FrameView
from qlinkgen.backends.python.frames import ended_view
from qlinkgen.backends.python.layout import in_hex, literal
from qlinkgen.backends.python.names import attribute, natural
from qlinkgen.backends.python.place import Place
from qlinkgen.model.naming import address_argument, address_attribute
from qlinkgen.model.types import Scalar
from qlinkgen.plan.ends import ByLength
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
        numbers: statements that compute the numbers of its parts from those of message, address and payload.
        front: expressions for the bytes before the payload.
        back: those after it, with zeros for check values.
        addressed: it has an address.
        checks: the check values in wire order.
        filling: the same in the order in which they are computed.
        header: size before the payload.
        overhead: size before and after it.
        head_tests: conditions for a wrong header, and the first elements of the result of ``_split``.
        size: size of the whole frame by its header, "" if the message gives it.
        tail_tests: conditions for wrong bytes after the payload.
        number: the number of the message in ``frame``, or in its header ``head``.
        address: the address in ``frame``, "None" without one.
        verified: contents that are wrong do not deny a frame with a valid check value.
        seeded: that covers attributes of the message.
        checked_values: statements that convert and check the values of the frame of ``message``.
        held_values: statements that set the values of ``message`` from ``frame``.
        ended: its terminator, None without one.
        least: minimum size of its payload.
        most: maximum size of it.
        lead: the constant that it begins with, b"" if that is the message id.
        begun: the message ids that it begins with, and the beginnings of these.
        turned: only its turn in a dialogue tells it, so decoders of frames do not know it.
    """

    name: str
    numbers: Sequence[str]
    front: str
    back: str
    addressed: bool
    checks: Sequence[PlacedCheck]
    filling: Sequence[PlacedCheck]
    header: int
    trailer: int
    overhead: int
    head_tests: Sequence[tuple[str, str]]
    size: str
    tail_tests: Sequence[str]
    number_in_head: str
    number: str
    address: str
    verified: bool
    seeded: bool
    checked_values: Sequence[str]
    held_values: Sequence[str]
    ended: EndedView | None
    least: int
    most: int
    lead: str
    begun: Sequence[str]
    turned: bool


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
        lasts: the last bytes of terminators.
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
    lasts: Sequence[str]
    check: CheckView | None

    template = "kinds"
    idle = None

    @property
    def coded(self) -> bool:
        """Whether frames of some kinds are coded."""
        return any(each.ended and each.ended.coding for each in self.kinds)

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
        measured=any(not view.size and view.ended is None for view in views.values()),
        values=[_value(member, make.place) for member in plan.frame.values.values()],
        slots=sorted([*([address.name] if name else []), *map(attribute, plan.frame.values)], key=natural),
        seeds=sorted({seed_name(seed) for each in plan.frame.kinds for seed in _seeds(each)}),
        counted=plan.protocol.counter is not None,
        settled=any(each.message.settled for each in plan.messages),
        restarts=plan.protocol.restarts,
        lasts=list(dict.fromkeys(view.ended.last for view in views.values() if view.ended)),
        check=_selectable(list(views.values())),
        makers=frozenset(check.view.maker for view in views.values() for check in view.checks),
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
    found = [check.view for kind in kinds for check in kind.checks if check.main]
    return found[0] if found and all(view.selectable for view in found) else None


def _value(member: Member, place: Place) -> ValueView:
    kind = values.annotation(by_slot([member])[0], place)
    return ValueView(attribute(member.name), kind, values.default(member, place))


def _seeds(frame: FramePlan) -> Iterator[Seed]:
    for part in frame.envelope.checks:
        yield from frame.envelope.seeds(part)


def _kind(frame: FramePlan, plan: Plan, make: Maker) -> KindView:
    envelope = frame.envelope
    carried = next((each for each in plan.messages if frame in each.frames), None)
    members = Members(envelope, carried, make) if carried and envelope.values else None
    checks = {part.name: _check(frame, part) for part in envelope.checks}
    base = f"{frame.base} + " if frame.base else ""
    addressed = bool(envelope.address)
    return KindView(
        name=frame.name,
        numbers=list(_numbers(envelope)),
        checked_values=members.checked if members else [],
        held_values=members.held if members else [],
        seeded=bool(envelope.seeded),
        front=" + ".join(_bytes(part) for part in envelope.front) or 'b""',
        back=" + ".join(_bytes(part) for part in envelope.back),
        addressed=addressed,
        checks=list(checks.values()),
        filling=[checks[part.name] for part in envelope.filling],
        header=envelope.header_size,
        trailer=envelope.trailer_size,
        overhead=envelope.overhead,
        head_tests=list(_head_tests(envelope, frame.name)),
        begun=list(_begun(envelope)),
        turned=frame.turned,
        size=_size(frame, envelope),
        tail_tests=[test for part in envelope.back for test in pieces.tail_tests(envelope, part)],
        number_in_head=base + _grouped(pieces.number(envelope, envelope.id, "head"), base),
        number=base + _grouped(pieces.number(envelope, envelope.id, "frame"), base),
        address=pieces.number(envelope, envelope.address, "frame") if addressed else "None",
        verified=bool(envelope.checks),
        ended=ended_view(frame, bare=False, mark=f"_{frame.name.upper()}") if frame.whole else None,
        least=envelope.payload.least,
        most=envelope.payload.most,
        lead=literal(envelope.preamble),
    )


def _grouped(number: str, base: str) -> str:
    return f"({number})" if base and " " in number else number


def _check(frame: FramePlan, part: CheckPart) -> PlacedCheck:
    envelope = frame.envelope
    mark = _mark(envelope, part, frame.name)
    found = placed(envelope, part, mark, early=not frame.whole)
    return replace(found, view=check_view(part.check, mark.upper()))


def _mark(envelope: Envelope, part: CheckPart, name: str) -> str:
    number = envelope.checks.index(part) + 1
    return f"_{name}" if number == 1 else f"_{number}_{name}"


def _size(frame: FramePlan, envelope: Envelope) -> str:
    if not isinstance(frame.end, ByLength):
        return ""
    part = frame.end.part
    seen = pieces.read(envelope, part, "head")
    seen = f"{seen} * {part.scale}" if part.scale > 1 else seen
    more = envelope.overhead - part.bias
    return f"{seen} {'+' if more > 0 else '-'} {abs(more)}" if more else seen


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
            return f"({counted}) // {part.scale}" if part.scale > 1 else counted
        case CellPart():
            terms = [_bits(slot) for slot in part.slots]
            return terms[0].removeprefix("(").removesuffix(")") if len(terms) == 1 else " | ".join(terms)
        case EqualPart():
            return pieces.derived_part(part, _local(part.of))
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


# Reading a frame


def _head_tests(envelope: Envelope, name: str) -> Iterator[tuple[str, str]]:
    """The checks of a header, part by part, as far as received."""
    for part in envelope.front:
        start, end = envelope.offset(part), envelope.offset(part) + part.size
        match part:
            case ConstantPart():
                yield f"not {literal(part.data)}.startswith(head[{start}:{end}])", '"no_frame", start'
            case IdPart() if part.numbers:
                yield f"head[:{end}] not in _BEGUN_{name.upper()}", '"no_frame", start'
            case LengthPart():
                seen = pieces.read(envelope, part, "head")
                yield (
                    f"len(head) >= {end} and not {part.least} <= {seen} <= {part.most}",
                    f'"length", start + {end}',
                )
            case IdPart() | AddressPart() | CellPart() | EqualPart():
                for test in pieces.wrong(envelope, part, "head"):
                    yield f"len(head) >= {end} and {test}", '"no_frame", start'
            case CheckPart():
                pass
            case MarkPart() | PayloadPart() | BlocksPart():
                raise AssertionError(f"{part.name} is not a part of a header")
            case _:
                assert_never(part)


def _begun(envelope: Envelope) -> Iterator[str]:
    """The message ids that frames begin with, as far as received; none if a constant begins them."""
    if not envelope.preamble and envelope.starts:
        sizes = range(1, len(envelope.starts[0]) + 1)
        yield from map(literal, sorted({start[:size] for start in envelope.starts for size in sizes}))
