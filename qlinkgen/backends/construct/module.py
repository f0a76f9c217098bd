"""Builds the definitions of a module from a plan: types, messages, then frames."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import assert_never

from qlinkgen.backends.construct.algorithms import algorithm
from qlinkgen.backends.construct.payload import (
    Names,
    Types,
    beside,
    choices_of,
    comment,
    fields,
    integer,
    is_varied,
    presence_of,
    record,
)
from qlinkgen.backends.construct.tree import Call, Definition, Node, Ref, Sequence, hexadecimal
from qlinkgen.model import checksum as catalogue
from qlinkgen.model.integer import Integer
from qlinkgen.model.message import Direction, Message
from qlinkgen.model.naming import record_key
from qlinkgen.plan.coding import Add, Cobs, Digits, Escaping, Insertion, Pair, Stage
from qlinkgen.plan.conditional import Conditional
from qlinkgen.plan.ends import ByTerminator, Gaps, Hunt, InStep, Marks, Rescan
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
    Part,
    PayloadPart,
)
from qlinkgen.plan.payload import Member, PayloadPlan, Presence, full_size
from qlinkgen.plan.transparency import Coded, FrameStuffing, PayloadStuffing, Plain, SevenBit
from qlinkgen.plan.tree import MessagePlan, Plan

#: The name of the definition of each algorithm.
Algorithms = Mapping[catalogue.Checksum, str]
#: Names of definitions other than messages and types.
_OWN_NAMES = (
    *(
        "ALGORITHM",
        "LAYOUT",
        "REQUEST_LAYOUT",
        "RESPONSE_LAYOUT",
        "MESSAGES",
        "REQUEST_FRAME",
        "RESPONSE_FRAME",
        "FRAME",
        "CRC",
    ),
    *(f"ALGORITHM_{number}" for number in range(2, 10)),
)


def definitions(plan: Plan) -> tuple[Definition, ...]:
    """The definitions of the module of a protocol."""
    return tuple(_definitions(plan))


def _definitions(plan: Plan) -> Iterator[Definition]:
    layouts = [_kind_layout(each) for each in plan.frame.kinds if not each.turned]
    names = Names((*_OWN_NAMES, *layouts))
    stated = plan.protocol
    labelled = [each.name for each in stated.enums] + [each.name for each in stated.flags]
    groups = {name: names.of(name, "TYPE") for name in labelled}
    messages = {each.name: names.of(each.name, "MESSAGE") for each in stated.messages}
    types = Types(plan, groups, names)
    yield from types.definitions()
    for layout in plan.layouts:
        said = comment(layout.doc, layout.section, confirmed=layout.confirmed)
        yield Definition(types.records[layout.name], record(layout, types), said)
    command = ""
    for each in plan.messages:
        message = each.message
        said = comment(message.doc, message.section, confirmed=message.confirmed)
        again = message.command == command
        yield Definition(messages[each.name], _message(each, types), "" if again else said, again)
        command = message.command
    yield from _frames(plan, messages, types)


def _message(message: MessagePlan, types: Types) -> Call:
    settings: dict[str, Node] = {}
    if message.allowed is not None:
        settings["addresses"] = Sequence(tuple((each.low, each.high) for each in message.allowed.ranges))
    if not message.message.checksum:
        settings["checksum"] = False
    if message.payload.empty_is_default:
        settings["empty_is_default"] = True
    if message.payload.trim is not None:
        settings["keep"] = message.payload.trim
    settings |= _stated(message.message)
    if message.payload.separator:
        settings |= _dividing(message.payload)
    elif message.payload.walked:
        settings |= _walking(message.payload)
    name = _class_of(message.payload)
    if is_varied(message.payload):
        settings["most"] = message.payload.most
    return Call(
        name, (message.name, hexadecimal(message.id), *fields(message, types)), tuple(settings.items())
    )


def _stated(message: Message) -> dict[str, Node]:
    """The settings of a message that are as the document states them."""
    settings: dict[str, Node] = {}
    if message.seeds:
        settings["seeds"] = message.seeds
    if message.settled:
        settings["settled"] = message.settled
    if message.text is not None:
        settings["text"] = message.text
    if message.folded:
        settings["folded"] = True
    return settings


def _dividing(payload: PayloadPlan) -> dict[str, Node]:
    """The settings of a payload of texts with a separator."""
    settings: dict[str, Node] = {"separator": payload.separator}
    if payload.leading:
        settings["leading"] = True
    if optional := tuple((each.field, each.given) for each in _absent(payload)):
        settings["optional"] = Sequence(optional)
    return settings


def _walking(payload: PayloadPlan) -> dict[str, Node]:
    """The settings of a payload in which fields may be absent."""
    settings: dict[str, Node] = {"presence": Sequence(tuple(presence_of(payload)))}
    if payload.most < sum(map(full_size, payload.steps)):
        settings["most"] = payload.most
    if payload.decided_by:
        settings["decided_by"] = Sequence(
            tuple((record_key(each.name), each.number.default) for each in payload.decided_by)
        )
    if choices := tuple(choices_of(payload)):
        settings["choices"] = Sequence(choices)
    return settings


def _class_of(payload: PayloadPlan) -> str:
    if payload.separator:
        return "Separated"
    prefix = "Filled" if payload.filled_in else ""
    if is_varied(payload):
        return f"{prefix}Varied"
    if payload.walked:
        return f"{prefix}Walked"
    return f"{prefix}Message" if payload.trim is None else f"{prefix}Trimmed"


def _absent(payload: PayloadPlan) -> Iterator[Presence]:
    """What decides about each text that may be absent."""
    return (step.presence for step in payload.steps if step.presence)


# Frames


def _frames(plan: Plan, messages: Mapping[str, str], types: Types) -> Iterator[Definition]:
    algorithms = _algorithms(plan)
    for each, name in algorithms.items():
        yield Definition(name, algorithm(each), each.name)
    yield from _layouts(plan, types, algorithms)
    frames = []
    for direction in plan.protocol.directions:
        name = "FRAME" if direction == "message" else f"{direction.upper()}_FRAME"
        frame = plan.frames[direction]
        frames.append(Ref(name))
        if frame.kinds:
            yield Definition(name, _kinds(plan, direction, messages))
            continue
        layout: Node = Ref(_layout_name(direction if plan.directed else ""))
        if frame.needs_request:
            layout = _layout(frame.envelope, types, algorithms)
        chosen = Sequence(tuple(Ref(messages[each.name]) for each in plan.received(direction)))
        made = _frame(frame, layout, chosen)
        if direction == "response" and plan.carrier is not None:
            made = Call("Told", (made, *frames[:-1], *_asked(plan, messages)))
        yield Definition(name, made)
    told = Call("Turned", tuple(Ref(messages[each.name]) for each in plan.turned))
    every: list[Node] = [*frames, *([told] if plan.turned else [])]
    yield Definition("MESSAGES", Call("messages_of", tuple(every)), "Payloads by full name.")


def _asked(plan: Plan, messages: Mapping[str, str]) -> Iterator[Node]:
    """Each request whose answers only it tells apart, and these."""
    for request, answers in plan.asked.items():
        yield Call("Asked", (request, *(Ref(messages[each.name]) for each in answers)))


def _layouts(plan: Plan, types: Types, algorithms: Algorithms) -> Iterator[Definition]:
    """The parts of frames, of each kind or direction that has its own."""
    named = {_kind_layout(kind): kind for kind in plan.frame.kinds if not kind.turned}
    if not named and not plan.frame.needs_request:
        named = {_layout_name(way): each.frame for way, each in plan.ways.items()}
    for name, frame in named.items():
        said = comment(frame.doc, frame.section)
        yield Definition(name, _layout(frame.envelope, types, algorithms), said)


def _layout_name(direction: str) -> str:
    return f"{direction.upper()}_LAYOUT" if direction else "LAYOUT"


def _kind_layout(kind: FramePlan) -> str:
    return f"LAYOUT_{kind.name.upper()}"


def _kinds(plan: Plan, direction: Direction, messages: Mapping[str, str]) -> Call:
    """The kinds of frame of a direction, the shortest first."""
    calls: list[Node] = []
    for kind in sorted(plan.frames[direction].sought, key=lambda each: each.max_payload):
        carried = [each for each in plan.received(direction) if kind in each.frames]
        chosen = Sequence(tuple(Ref(messages[each.name]) for each in carried))
        settings: dict[str, Node] = {"base": hexadecimal(kind.base)} if kind.base else {}
        settings |= {"least": kind.envelope.payload.least} if kind.envelope.payload.least else {}
        settings |= {"address": record_key(kind.address)} if kind.address else {}
        settings |= {} if kind.envelope.preamble else {"starts": kind.envelope.starts}
        name = "CodedKind" if isinstance(kind.transparency, Coded) else "Kind"
        settings |= dict(_stuffing(kind))
        if present := tuple(map(_present, kind.envelope.conditional)):
            name, settings = "ConditionalKind", {"present": Sequence(present), **settings}
        if kind.whole:
            name = "EndedKind"
            settings |= dict(_ended_at(kind))
            settings |= dict(_codings(kind))
            settings |= dict(_paired(kind))
        calls.append(Call(name, (Ref(_kind_layout(kind)), chosen), tuple(settings.items())))
    return Call("Kinds", tuple(calls))


def _algorithms(plan: Plan) -> Algorithms:
    """The name of each algorithm of frames, the main one first."""
    found = dict[catalogue.Checksum, None]()
    envelopes = [each.envelope for each in (*plan.frame.every, *plan.frames["request"].every)]
    for envelope in dict.fromkeys(envelopes):
        found |= dict.fromkeys(each.algorithm for each in envelope.algorithms)
    return {
        each: "ALGORITHM" if number == 1 else f"ALGORITHM_{number}" for number, each in enumerate(found, 1)
    }


def _layout(envelope: Envelope, types: Types, algorithms: Algorithms) -> Sequence:
    return Sequence(tuple(_part(part, envelope, types, algorithms) for part in envelope.parts))


def _part(part: Part, envelope: Envelope, types: Types, algorithms: Algorithms) -> Call:  # noqa: C901  # a case a part
    match part:
        case ConstantPart():
            return Call("Constant", (part.name, part.data))
        case LengthPart():
            bounds = (("bias", part.bias), ("least", part.least), ("most", part.most))
            scale = (("scale", part.scale),) if part.scale > 1 else ()
            more = (("otherwise", part.otherwise),) if part.otherwise is not None else ()
            return Call("Length", (part.name, integer(part.integer)), (*bounds, *scale, *more))
        case IdPart():
            return Call("Id", (part.name, integer(part.integer)))
        case AddressPart():
            return Call("Address", (part.name, integer(part.integer)))
        case CellPart():
            slots = tuple(_slot(slot) for slot in part.slots if not isinstance(slot, Member))
            values = (("values", beside(part, types)),) if part.values else ()
            return Call("Cell", (part.name, integer(part.integer), Sequence(slots)), values)
        case EqualPart():
            settings: dict[str, Node] = {"inverted": True} if part.inverted else {}
            settings |= {"added": part.added} if part.added else {}
            bits = part.integer.bits
            return Call(
                "Equal", (part.name, integer(part.integer), part.of.name, bits), tuple(settings.items())
            )
        case MarkPart():
            return _mark(part)
        case PayloadPart():
            return Call("Payload", (part.name, part.most))
        case CheckPart():
            return _check(part, envelope, algorithms)
        case BlocksPart():
            kind = Integer(8 * part.check.size, signed=False, chunks=part.check.value.chunks)
            mask = hexadecimal(part.check.mask, (part.check.algorithm.width + 3) // 4)
            algorithm = Ref(algorithms[part.check.algorithm])
            return Call("Blocks", (part.name, algorithm, integer(kind), mask, part.every))
        case _:
            assert_never(part)


def _slot(slot: IdSlot | AddressSlot | ConstantSlot) -> Call:
    match slot:
        case IdSlot():
            return Call("IdBits", (slot.shift, slot.bits, slot.at))
        case AddressSlot():
            return Call("AddressBits", (slot.shift, slot.bits))
        case ConstantSlot():
            return Call("ConstantBits", (slot.shift, slot.bits, slot.values))
        case _:
            assert_never(slot)


def _mark(part: MarkPart) -> Call:
    bits = tuple((key, (bits.shift, bits.bits)) for key, bits in (("address", part.address), ("id", part.id)))
    end = (("end", part.end_id),) if part.end_id is not None else ()
    return Call("Mark", (part.name,), (("marker", hexadecimal(part.marker)), *bits, *end))


def _check(part: CheckPart, envelope: Envelope, algorithms: Algorithms) -> Call:
    check = part.check
    kind = integer(Integer(8 * check.size, signed=False, chunks=check.value.chunks))
    digits: tuple[tuple[str, Node], ...] = ()
    if base := check.value.base:
        modulus = check.value.modulus
        limits = (("low", 0), ("high", modulus - 1 if modulus else check.mask))
        kind = Call("TextNumber", (base, check.size, check.size), limits)
        digits = (("modulus", modulus),) if modulus else (("digits", True),)
    over = Sequence((envelope.payload.name,) if check.chained else check.over)
    word = (("word", check.word),) if check.chained else ()
    rejected = (("rejected", check.rejected),) if check.rejected is not None else ()
    otherwise = (("otherwise", check.otherwise),) if check.otherwise is not None else ()
    mask = hexadecimal(check.mask, (check.algorithm.width + 3) // 4)
    return Call(
        "Check",
        (part.name, Ref(algorithms[check.algorithm]), kind, mask, over),
        (*word, *rejected, *otherwise, *digits),
    )


def _frame(frame: FramePlan, layout: Node, messages: Sequence) -> Call:
    address = (("address", record_key(frame.address)),) if frame.address else ()
    settings = (*address, *_stuffing(frame))
    match frame.receiver:
        case Hunt():
            return Call("DelimitedFrame", (layout, messages), (*settings, ("hunt", True)))
        case Rescan() | Gaps() if frame.whole:
            return _ended(frame, layout, messages, address)
        case Rescan():
            bare = (("bare", True),) if frame.receiver.bare else ()
            if present := tuple(map(_present, frame.envelope.conditional)):
                given = (("present", Sequence(present)), *address, *bare)
                return Call("ConditionalFrame", (layout, messages), given)
            coded = isinstance(frame.transparency, Coded)
            return Call("CodedFrame" if coded else "DelimitedFrame", (layout, messages), (*settings, *bare))
        case Marks():
            return Call("MarkedFrame", (layout, messages), settings)
        case InStep():
            return Call("Packet", (layout, messages), settings)
        case Gaps():
            raise AssertionError("a silence is found first")
        case _:
            assert_never(frame.receiver)


def _present(conditional: Conditional) -> Call:
    """Parts that only some frames have."""
    tests = tuple(
        (each.part.name, each.shift, each.mask, each.test.ranges, each.test.negated)
        for each in conditional.selectors
    )
    names = tuple(part.name for part in conditional.parts)
    return Call("Present", (Sequence(names), Sequence(conditional.packed), Sequence(tests)))


def _ended(
    frame: FramePlan,
    layout: Node,
    messages: Sequence,
    address: tuple[tuple[str, Node], ...],
) -> Call:
    bare = (("bare", True),) if isinstance(frame.receiver, Rescan) and frame.receiver.bare else ()
    least = (("least", frame.envelope.payload.least),) if frame.envelope.payload.least else ()
    places = (*_ended_at(frame), *least, *_paired(frame))
    return Call("EndedFrame", (layout, messages), (*address, *bare, *_codings(frame), *places))


def _paired(frame: FramePlan) -> Iterator[tuple[str, Node]]:
    """Whether a terminator and pairs of coded bytes begin alike."""
    if isinstance(frame.end, ByTerminator) and frame.end.paired is not None:
        yield "paired", True


def _codings(frame: FramePlan) -> Iterator[tuple[str, Node]]:
    """The codings of a frame that a terminator or a silence ends."""
    coded = frame.transparency
    if isinstance(coded, Coded) and coded.stages:
        yield "coding", Sequence(tuple(map(_stage, coded.stages)))


def _ended_at(frame: FramePlan) -> Iterator[tuple[str, Node]]:
    """What tells the end of a frame that a terminator or a silence ends."""
    coded, end = frame.transparency, frame.end
    assert isinstance(coded, Coded)
    if isinstance(end, ByTerminator):
        yield "end", end.part.name
    yield "most", frame.max_wire
    yield "over", Sequence(tuple(part.name for part in frame.envelope.between(coded.front, coded.back)))


def _stage(coding: Stage) -> Call:
    match coding:
        case Escaping():
            codes = Sequence(coding.codes)
            mask = (("mask", hexadecimal(coding.mask)),) if coding.mask else ()
            return Call("Escape", (hexadecimal(coding.escape), codes), mask)
        case Insertion():
            return Call("Stuffing", (coding.after, bytes((coding.insert,))))
        case Cobs():
            return Call("Cobs")
        case Digits():
            return Call("Digits")
        case Pair():
            return Call("Pair")
        case Add():
            return Call("Add", (hexadecimal(coding.number),))
        case _:
            assert_never(coding)


def _stuffing(frame: FramePlan) -> tuple[tuple[str, Node], ...]:
    how = frame.transparency
    match how:
        case Plain() | SevenBit():
            return ()
        case Coded():
            if frame.whole:
                return ()
            names = tuple(part.name for part in frame.envelope.between(how.front, how.back))
            return ("coding", _stage(how.bytewise)), ("over", Sequence(names))
        case PayloadStuffing(Add() as rule):
            return (("stuffing", _stage(rule)),)
        case PayloadStuffing():
            over: tuple[str, ...] = ()
        case FrameStuffing():
            over = tuple(part.name for part in frame.envelope.between(how.front, how.back))
        case _:
            assert_never(how)
    assert isinstance(how.rule, Insertion)
    given = (how.rule.after, bytes((how.rule.insert,)), *((Sequence(over),) if over else ()))
    return (("stuffing", Call("Stuffing", given)),)
