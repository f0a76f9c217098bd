"""The classes of a module: one for each message, and base classes for common layouts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field, replace
from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.backends import python_text
from qlinkgen.backends.python import docstrings, values
from qlinkgen.backends.python.decode import Decoder
from qlinkgen.backends.python.encode import Encoder
from qlinkgen.backends.python.frame_checks import seed_name
from qlinkgen.backends.python.layout import WIDTH, calls, in_hex, indented, listing, literal, wrapped
from qlinkgen.backends.python.measure import measure_lines
from qlinkgen.backends.python.names import attribute, class_name, constant_name, held, natural
from qlinkgen.backends.python.place import Place
from qlinkgen.backends.python.sections import way_class
from qlinkgen.backends.python.separated import SeparatedDecoder, SeparatedEncoder
from qlinkgen.backends.python.walked import VariedDecoder, WalkedDecoder, WalkedEncoder
from qlinkgen.model.fields import Layout, Value
from qlinkgen.model.frame import ATTRIBUTE
from qlinkgen.model.message import Message
from qlinkgen.model.naming import pascal
from qlinkgen.model.types import Scalar
from qlinkgen.plan.ends import ByKind, ByLength, ByMark, ByMessage, BySilence, ByTerminator, ByTurn
from qlinkgen.plan.envelope import Envelope
from qlinkgen.plan.parts import Seed
from qlinkgen.plan.payload import (
    BitsStep,
    BytesStep,
    ConstantStep,
    CountStep,
    FilledStep,
    Holder,
    ItemsStep,
    Member,
    PayloadPlan,
    RecordsStep,
    RecordStep,
    ReservedStep,
    Step,
    ValueStep,
    by_slot,
)
from qlinkgen.plan.planning import record_plan
from qlinkgen.plan.tree import MessagePlan, Plan

#: A layout of at least this many messages becomes a base class.
SHARED = 4


@dataclass(frozen=True)
class ClassModel:
    """A class as finished text."""

    name: str
    base: str
    doc: Sequence[str]
    facts: Sequence[str]
    slots: Sequence[str] = ("__slots__ = ()",)
    init: Sequence[str] = ()
    encode: Sequence[str] = ()
    decode: Sequence[str] = ()
    measure: Sequence[str] = ()
    constants: Sequence[str] = field(default_factory=tuple)
    body_size: int | None = None
    has_codec: bool = False
    #: Encoding can fail because a field is absent or present.
    walked: bool = False
    #: The direction of its frames, "" if both have the same.
    way: str = ""

    @property
    def refusable(self) -> bool:
        """Whether encoding can fail."""
        return list(self.encode) != ['return b""']


@dataclass(frozen=True)
class Shape:
    """The layout of messages; messages with equal shapes share their code."""

    payload: PayloadPlan
    allowed: object
    default_address: int
    checked: bool
    direction: str
    members: tuple[Member, ...]


class ClassBuilder:
    """Builds the classes of one protocol."""

    def __init__(self, plan: Plan, place: Place) -> None:
        """``place`` describes the frame around payloads."""
        self._plan = plan
        self._place = place
        bus = plan.protocol.bus
        self._default_address = bus.nodes[0] if bus.nodes else 0
        self._all_checked = all(message.checked for message in plan.messages)
        #: Conversions by the name of their constant, in order of first use.
        self._scales: dict[str, str] = {}
        self._shapes = self._shared_shapes()

    def build(self) -> list[ClassModel]:
        """Every class: records and shared ones first."""
        records = [self._record(layout) for layout in self._plan.layouts]
        shapes = [self._shape(name, message) for name, message in self._shapes.values()]
        return [*records, *shapes, *map(self._message, self._plan.messages)]

    def _within(self, message: MessagePlan) -> Place:
        """The place of a message: the frames of its direction or kind, or no frame for a record."""
        if not message.frames:
            return self._place
        several = self._plan.frame.kinds
        whole = message.envelope if several else self._plan.frames[message.direction].envelope
        return self._place.within(whole.fixing(dict(message.message.settled)))

    @property
    def scales(self) -> list[str]:
        """Definitions of the conversions of scaled values; complete once the classes are built."""
        return [f"{name} = {call}" for name, call in self._scales.items()]

    # Records

    def _record(self, layout: Layout) -> ClassModel:
        """The class of a record: that of a message without a frame."""
        builder = ClassBuilder(self._plan, self._place.bare)
        builder._scales = self._scales
        base, name = self._place.use("BaseRecord"), self._place.classes[layout.name]
        if not layout.fixed:
            base = self._place.use("VariedRecord")
        message = _message_of(layout)
        head = ClassModel(name, base, builder._doc(message), [f'NAME = "{layout.name}"'])
        return builder._with_codec(message, head, f"RECORD_{constant_name(layout.name)}", "")

    # Common layouts

    def _shape_of(self, message: MessagePlan) -> Shape:
        return Shape(
            message.payload,
            message.allowed,
            message.message.default_address,
            message.checked,
            message.direction if self._divided else "",
            self._within(message).members,
        )

    @property
    def _divided(self) -> bool:
        """Whether requests and responses have different frames, and their classes different bases."""
        return self._plan.directed or self._plan.frame.needs_request

    def _shared_shapes(self) -> Mapping[Shape, tuple[str, MessagePlan]]:
        groups: dict[Shape, list[MessagePlan]] = {}
        for message in self._plan.messages:
            groups.setdefault(self._shape_of(message), []).append(message)
        names: dict[str, int] = {}
        found = {}
        for shape, group in groups.items():
            if len(group) < SHARED:
                continue
            name = _shape_name(shape.payload) + (self._base(group[0]) if self._divided else "")
            names[name] = names.get(name, 0) + 1
            found[shape] = (f"{name}{names[name]}" if names[name] > 1 else name, group[0])
        return found

    def _shape(self, name: str, message: MessagePlan) -> ClassModel:
        kinds = ", ".join(value.name for value in message.message.values)
        doc = python_text.docstring([f"Base class of messages with {kinds or 'no data'}."])
        head = ClassModel(name, self._base(message), doc, self._checked(message))
        return self._with_codec(message, head, _snake_upper(name), "self.ID")

    def _message(self, message: MessagePlan) -> ClassModel:
        facts = [f'NAME = "{message.name}"', f"ID = {in_hex(message.id)}"]
        facts.append(f"MAX_WIRE_SIZE = {message.wire_size}")
        facts += self._kind(message) if self._plan.frame.kinds else self._uncounted(message)
        facts += self._restart(message)
        facts += [
            f"{seed_name(Seed(name.removeprefix(ATTRIBUTE)))} = {literal(data)}"
            for name, data in message.message.seeds
        ]
        head = ClassModel(class_name(message), self._base(message), self._doc(message), facts)
        if shape := self._shapes.get(self._shape_of(message)):
            return replace(head, base=shape[0])
        head = replace(head, facts=[*facts, *self._checked(message)])
        unknown = self._plan.protocol.to_unknown
        refusing = unknown is not None and unknown.message.name == message.name  # with any number
        number = "self.ID" if refusing else in_hex(message.id)
        return self._with_codec(message, head, constant_name(message.name), number)

    def _with_codec(self, message: MessagePlan, head: ClassModel, title: str, number: str) -> ClassModel:
        """A class with its code; ``title`` is a part of the names of its constants, ``number`` is its id."""
        scales = self._scales_of(message)
        make_encoder, make_decoder = _makers(message.payload)
        if message.payload.walked and not number:
            make_decoder = VariedDecoder
        place = self._within(message)
        encoder = make_encoder(message, place, title, number, scales)
        decoder = make_decoder(message, place, title, scales)
        name = "" if place.envelope is None else "body"
        encode = encoder.statements(name)
        stored = (*place.inside, *message.payload.settable)
        names = sorted({held(each) for each in stored}, key=natural)
        return replace(
            head,
            slots=listing("__slots__ = (", [f'"{name}"' for name in names], ")", 4),
            facts=[*head.facts, *self._facts(message, scales)],
            init=self._init(message),
            encode=encode,
            decode=decoder.statements(),
            measure=measure_lines(message.payload) if number and _measured(message) else [],
            constants=[*encoder.constants, *decoder.constants],
            body_size=self._body_size(message),
            has_codec=True,
            walked=any("misplaced(" in line for line in encode),
            way=message.direction if self._plan.directed and place.envelope else "",
        )

    def _body_size(self, message: MessagePlan) -> int | None:
        """Number of bytes that the encoder packs, None if it varies."""
        place = self._within(message)
        if place.envelope is None or not message.payload.fixed:
            return None
        parts = (*place.front, *place.back)
        return message.payload.most + sum(part.size for part in parts)

    def _base(self, message: MessagePlan) -> str:
        if not self._divided or message.direction == "message":
            return "Message"
        return way_class(message.direction) if self._plan.directed else message.direction.title()

    def _checked(self, message: MessagePlan) -> list[str]:
        """The constant for a message with a check value, if only some have one."""
        marked = isinstance(self._plan.frame.end, ByMark)
        return ["CHECKED = True"] if marked and not self._all_checked and message.checked else []

    def _uncounted(self, message: MessagePlan) -> list[str]:
        """The constant of a message that the counter of frames does not count."""
        counter = self._plan.protocol.counter
        if counter is None or self._plan.protocol.counts(message.message):
            return []
        return ["COUNTER = None"]

    def _restart(self, message: MessagePlan) -> list[str]:
        """The constants of a request after which the counter begins anew, or whose answer is kept."""
        commands = [each for each in self._plan.protocol.commands if each.request is message.message]
        restart = [f"RESTART = {each.restart}" for each in commands if each.restart is not None]
        return restart + (["KEPT = True"] if any(map(self._plan.protocol.keeps, commands)) else [])

    def _kind(self, message: MessagePlan) -> list[str]:
        """What tells the kind of its frame, and whether that has an address, values and a counter."""
        base = message.frames[-1].base
        addressed = message.allowed is not None or not self._place.address
        names = [attribute(member.name) for _, member in message.envelope.values]
        settled = [f'("{attribute(name)}", {number})' for name, number in message.message.settled]
        counter = self._plan.protocol.counter
        counts = attribute(counter.name) in names if counter else False
        counts = counts and self._plan.protocol.counts(message.message)
        counted = [values.counter_fact(counter)] if counter and counts else []
        return [
            *([f"FAMILY = {in_hex(base)}"] if base else []),
            *([] if addressed else ['ADDRESS = ""']),
            *(listing("PARTS = (", [f'"{name}"' for name in names], ")", 4) if names else []),
            *(f"COUNTER = {fact}" for fact in counted),
            *([f"TURN = {self._plan.turn_of(message)}"] if message.turned else []),
            *(listing("SETTLED = (", settled, ")", 4) if settled else []),
        ]

    # Parts of a class

    def _scales_of(self, message: MessagePlan) -> dict[str, str]:
        """The constant that converts each scaled value, named after its type or else its field."""
        found = {}
        for each in (*self._within(message).beside, *message.payload.settable):
            if isinstance(each, ValueStep | Member | ItemsStep) and each.number.scaling is not None:
                found[each.name] = self.scale(each.name, each.number)
        return found

    def scale(self, field_name: str, number: Scalar) -> str:
        """The name of the constant that converts a value."""
        call = values.scale_arguments(number, self._place)
        base = f"_SCALE_{(number.type_name or field_name).upper()}"
        name, count = base, 2
        while self._scales.get(name, call) != call:
            name, count = f"{base}_{count}", count + 1
        self._scales[name] = call
        return name

    def _facts(self, message: MessagePlan, scales: Mapping[str, str]) -> list[str]:
        payload = message.payload
        facts = [f"MIN_SIZE = {payload.least}", f"MAX_SIZE = {payload.most}"]
        facts += ["EMPTY = True"] if payload.empty_is_default else []
        address = message.message.default_address
        if message.allowed is not None and address != self._default_address:
            facts.append(f"DEFAULT_ADDRESS = {address}")
        names = list(dict.fromkeys(f'"{held(each)}"' for each in payload.settable))
        facts += listing("FIELDS = (", names, ")", 4) if names else []
        rules = values.rules(message, self._within(message), scales)
        return [*facts, *calls("RULES = (", rules, ")", 4)] if rules else facts

    def _init(self, message: MessagePlan) -> list[str]:
        place = self._within(message)
        address = place.address if message.allowed is not None else ""
        # The address has a default only if there is just one.
        spans = {end for span in message.message.addresses for end in span}
        default = f" = {message.message.default_address}" if len(spans) == 1 else ""
        arguments = [f"{address}: int{default}"] if address else []
        slots = by_slot((*place.beside, *message.payload.settable))
        arguments += [values.argument(each, place) for each in slots]
        body = [f"self.{address} = {address}"] if address else []
        body += [line for each in slots for line in values.assignment(each, place)]
        taken = ["self", "*", *arguments] if arguments else ["self"]
        return [*wrapped("def __init__(", taken, ") -> None:", 4), *indented(body or ["pass"])]

    def _doc(self, message: MessagePlan) -> list[str]:
        stated = message.message
        title = {"request": "Request", "response": "Response"}.get(message.direction, "Message")
        tail = f": {title.lower()}" if message.direction != "message" else ""
        opening = docstrings.opening(stated.doc or message.name, stated.section, tail)
        lines = docstrings.paragraph(opening, WIDTH - 8)
        if not stated.confirmed:
            lines += ["", docstrings.UNCONFIRMED]
        settable = message.payload.settable
        if settable or message.allowed is not None:
            lines += ["", "Attributes:", *self._attributes(message, stated.values, settable)]
        return python_text.docstring(lines)

    def _attributes(
        self, message: MessagePlan, stated: Iterable[Value], settable: Iterable[Holder]
    ) -> list[str]:
        lines = []
        if self._place.address and message.allowed is not None:
            spans = " or ".join(values.span(each.low, each.high) for each in message.allowed.ranges)
            lines.append(f"    {self._place.address}: Address in the frame, {spans}.")
        pairs: dict[str, list[tuple[Value, Holder]]] = {}
        for value, each in zip(stated, settable, strict=True):
            pairs.setdefault(value.name, []).append((value, each))
        for name, cases in pairs.items():
            text = values.description(cases, self._place)
            lines += docstrings.item(f"{attribute(name)}: {text}", WIDTH - 4)
        return lines


def _makers(payload: PayloadPlan) -> tuple[type[Encoder], type[Decoder]]:
    """What collects the code of a message."""
    if payload.separator:
        return SeparatedEncoder, SeparatedDecoder
    return (WalkedEncoder, WalkedDecoder) if payload.walked else (Encoder, Decoder)


def _measured(message: MessagePlan) -> bool:
    """Whether only its counts determine the end of a message."""
    end = message.frames[-1].end
    match end:
        case ByMessage() | ByTurn():
            return True
        case ByLength() | ByMark() | ByTerminator() | BySilence() | ByKind():
            return False
        case _:
            assert_never(end)


def _message_of(layout: Layout) -> MessagePlan:
    """A record as a message without a frame."""
    stated = Message(
        name=layout.name, command=layout.name, direction="message", id=0, fields=layout.fields,
        doc=layout.doc, section=layout.section, confirmed=layout.confirmed,
    )  # fmt: skip
    payload = record_plan(layout).payload
    return MessagePlan(
        stated,
        payload,
        (),
        Envelope(()),
        None,
        payload.most,
        payload.most,
        encoded=True,
        decoded=True,
        asked=False,
    )


def _shape_name(payload: PayloadPlan) -> str:
    if not payload.steps:
        return "_Empty"
    return "_" + "".join(pascal(step.name) + _kind(step) for step in payload.steps)


def _kind(step: Step) -> str:
    match step:
        case BytesStep():
            return "Text" if step.text else "Bytes"
        case ItemsStep():
            return f"{'I' if step.item.signed else 'U'}{step.item.bits}s"
        case RecordStep():
            return pascal(step.record.name)
        case RecordsStep():
            return f"{pascal(step.record.name)}s"
        case ValueStep() | ConstantStep() | ReservedStep() | CountStep() | FilledStep() | BitsStep():
            return f"{'I' if step.integer.signed else 'U'}{step.integer.bits}"
        case _:
            assert_never(step)


def _snake_upper(name: str) -> str:
    return "".join(f"_{char}" if char.isupper() else char for char in name.lstrip("_")).upper().lstrip("_")
