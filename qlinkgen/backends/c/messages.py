"""Renders the parts of a header for one message."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.backends import c_text
from qlinkgen.backends.c import separated
from qlinkgen.backends.c.decode import Decoder
from qlinkgen.backends.c.describe import field_rows, member_note, message_head, record_head
from qlinkgen.backends.c.encode import Encoder
from qlinkgen.backends.c.framing import is_trimmed, payload_arguments, payload_parameters
from qlinkgen.backends.c.layout import Layouts
from qlinkgen.backends.c.members import is_counted
from qlinkgen.backends.c.names import Names, count_type, is_wide, scalar_literal, unsigned
from qlinkgen.backends.c.types import Kind, Types
from qlinkgen.backends.c.walked import WalkedDecoder, WalkedEncoder, size_lines
from qlinkgen.model import naming
from qlinkgen.model.fields import Layout, Value
from qlinkgen.model.types import Characters
from qlinkgen.plan.payload import (
    BytesStep,
    Holder,
    ItemsStep,
    Member,
    PayloadPlan,
    Presence,
    RecordsStep,
    RecordStep,
    RunStep,
    ValueStep,
    all_records,
    by_slot,
    first_case,
    value_name,
)
from qlinkgen.plan.planning import record_plan
from qlinkgen.plan.tree import MessagePlan


@dataclass(frozen=True, slots=True)
class StructMember:
    """One line of a struct."""

    declaration: str
    note: str


@dataclass(frozen=True, slots=True, kw_only=True)
class MessageView:
    """A message, `m` in templates; an omitted function is None."""

    function: str
    constant: str
    head: list[str]
    rows: list[str]
    id_text: str
    min_size: int
    max_size: int
    max_frame_size: int
    max_wire_size: int
    has_struct: bool
    has_bytes: bool
    same_struct: str
    members: list[StructMember]
    notes: list[str]
    initialiser: str
    measure: list[str]
    encode: list[str] | None
    decode: list[str] | None
    scales: list[Kind]
    measure_parameters: str
    encode_parameters: str
    decode_parameters: str
    size_text: str
    comment_ends_at_head: bool


@dataclass(frozen=True, slots=True)
class Beside:
    """The struct of the values of every frame."""

    members: list[StructMember]
    initialiser: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordView:
    """A record, `r` in templates; an empty function checks nothing.

    Attributes:
        size: its size; the maximum if it is ``varied``.
        measure: body of the function that returns the size of a struct, if that is varied.
    """

    function: str
    constant: str
    head: list[str]
    rows: list[str]
    size: int
    varied: bool
    measure: list[str]
    size_text: str
    members: list[StructMember]
    initialiser: str
    check: list[str]
    put: list[str]
    get: list[str]
    scales: list[Kind]


class MessageWriter:
    """Converts messages and records to template views.

    Messages with the same payload share the struct and the function bodies of the first of them.
    """

    def __init__(self, names: Names, layouts: Layouts, types: Types) -> None:
        """Use the names, layouts and types of the header."""
        self._names = names
        self._layouts = layouts
        self._types = types
        self._first: dict[object, str] = {}

    def render(self, plan: MessagePlan) -> MessageView:
        """The view of a message; functions that the role does not need are omitted."""
        message, payload = plan.message, plan.payload
        head = message_head(self._names.command_of(message), message)
        values = zip(message.values, payload.settable, strict=True)
        notes = {step.name: member_note(value, step) for value, step in values}
        members = self._struct(payload, notes)
        shape = payload, tuple(member.declaration for member in members)
        return MessageView(
            function=self._names.function(message),
            constant=self._names.constant(message),
            head=head,
            rows=field_rows(payload),
            id_text=f"0x{message.id:02X}",
            min_size=payload.least,
            max_size=payload.most,
            max_frame_size=plan.frame_size,
            max_wire_size=plan.wire_size,
            has_struct=bool(payload.settable),
            has_bytes=bool(payload.steps),
            same_struct=self._same("struct", shape, plan) if members else "",
            members=members,
            notes=[f"{name}: {note}" for name, note in notes.items() if note],
            initialiser=self._initialisers(payload),
            measure=self._measure(plan, self._same("size", shape, plan)) if plan.encoded else [],
            encode=self._encode(plan, self._same("encode", shape, plan)) if plan.encoded else None,
            decode=self._decode(plan, self._same("decode", shape, plan)) if plan.decoded else None,
            scales=self._scales(self._names.function(message), payload),
            measure_parameters=payload_parameters(self._names, message, const=True).removesuffix(", "),
            encode_parameters=payload_parameters(self._names, message, const=True),
            decode_parameters=payload_parameters(self._names, message, const=False),
            size_text=_size_text(payload.least, payload.most),
            comment_ends_at_head=not payload.steps and len(head) == 1,
        )

    def beside(self, held: Sequence[tuple[Member, Value]]) -> Beside:
        """The struct of the values of every frame."""
        members = [m for each, value in held for m in self._members(each, member_note(value, each))]
        return Beside(members, ", ".join(self._initialiser(each) for each, _ in held))

    def _same(self, what: str, shape: object, plan: MessagePlan) -> str:
        """The first message with the same shape, "" if this is the first."""
        own = self._names.function(plan.message)
        first = self._first.setdefault((what, shape), own)
        return "" if first == own else first

    def _struct(self, payload: PayloadPlan, notes: Mapping[str, str]) -> list[StructMember]:
        """The members of a struct; one more tells whether a field that may be absent is present."""
        members: list[StructMember] = []
        last: Presence | None = None
        for slot in by_slot(payload.settable):
            (each, *_), presence = slot, slot[0].presence
            if presence is not None and presence.slot:
                members += self._union(slot, notes)
                continue
            if presence is not None and presence != last:
                note = c_text.comment_line(f"whether {presence.field} is present")
                members.append(StructMember(f"bool has_{presence.field};", note))
            members += self._members(each, notes[each.name])
            last = presence
        return members

    def _initialisers(self, payload: PayloadPlan) -> str:
        found: list[str] = []
        last: Presence | None = None
        for slot in by_slot(payload.settable):
            each = first_case(slot)
            if each.presence is not None and each.presence.slot:
                inside = self._initialiser(each)
                found.append(f"{{{{{inside}}}}}" if is_counted(each) else f"{{{inside}}}")
                continue
            found += [str(each.presence.given).lower()] if each.presence and each.presence != last else []
            found.append(self._initialiser(each))
            last = each.presence
        return ", ".join(found)

    def _measure(self, plan: MessagePlan, same: str) -> list[str]:
        payload = plan.payload
        if not payload.walked or not (payload.settable or payload.decided_by):
            return []
        if same:
            return [f"return {same}_size_({payload_arguments(plan.message).removesuffix(', ')});"]
        if payload.separator:
            return separated.size_lines(payload, self._layouts)
        return _using(plan, size_lines(payload, self._layouts.records))

    def _encode(self, plan: MessagePlan, same: str) -> list[str]:
        own = payload_arguments(plan.message)
        if same:
            return [f"return {same}_encode({own}payload, capacity);"]
        if plan.payload.walked:
            function = self._names.function(plan.message)
            if plan.payload.separator:
                encoder: Encoder = separated.SeparatedEncoder(plan.payload, self._layouts, function=function)
            else:
                encoder = WalkedEncoder(plan.payload, self._layouts, function=function, arguments=own)
            return _using(plan, [*encoder.statements(), "return (int)size;"])
        size = f"{self._names.constant(plan.message)}_MAX_SIZE" if plan.payload.fixed else "size"
        lines = Encoder(plan.payload, self._layouts).statements()
        if is_trimmed(plan.payload):
            lines += trimming(size, plan.payload.least)
            size = "size"
        return [*lines, f"return (int){size};"]

    def _decode(self, plan: MessagePlan, same: str) -> list[str]:
        own, ok = payload_arguments(plan.message), f"return {self._names.upper}_OK;"
        if same:
            return [f"return {same}_decode({own}payload, size);"]
        if plan.payload.walked:
            init = f"{self._names.constant(plan.message)}_INIT"
            make = separated.SeparatedDecoder if plan.payload.separator else WalkedDecoder
            return _using(plan, [*make(plan.payload, self._layouts, init=init).statements(), ok])
        decoder, empty = Decoder(plan.payload, self._layouts), list[str]()
        if plan.payload.empty_is_default and plan.payload.least > 0:
            empty = ["if (size == 0U) {", *(f"    {line}" for line in [*self._defaults(plan), ok]), "}"]
        lines = decoder.statements()
        return [*([] if decoder.reads else ["(void)payload;"]), *empty, *lines, ok]

    def _defaults(self, plan: MessagePlan) -> list[str]:
        """Statements that set a message to its defaults; runs with items are copied from INIT."""
        lines = []
        for each in plan.payload.settable:
            match each:
                case ValueStep() | Member() if is_wide(each.number):
                    return self._copied(plan)
                case ValueStep() | Member():
                    default = scalar_literal(each.number, each.number.default)
                    lines.append(f"message->{naming.member(each.name)} = {default};")
                case RecordStep():
                    return self._copied(plan)
                case BytesStep() | ItemsStep() if each.fixed or each.default:
                    return self._copied(plan)
                case RecordsStep() if each.length.minimum:
                    return self._copied(plan)
                case BytesStep() | ItemsStep() | RecordsStep():
                    lines.append(f"message->{each.name}_{each.quantity} = 0U;")
                case _:
                    assert_never(each)
        return lines

    def _copied(self, plan: MessagePlan) -> list[str]:
        kind = self._names.function(plan.message)
        return [f"const {kind}_t defaults = {kind.upper()}_INIT;", "*message = defaults;"]

    def record(self, layout: Layout, plans: Sequence[MessagePlan]) -> RecordView:
        """The view of a record of some messages."""
        payload = record_plan(layout).payload
        notes = {s.name: member_note(v, s) for v, s in zip(layout.values, payload.settable, strict=True)}
        function = self._layouts.records[layout.name]
        used = [each for each in plans if layout.name in {r.name for r in each.payload.records}]
        encoded, decoded = any(each.encoded for each in used), any(each.decoded for each in used)
        encoder = WalkedEncoder if payload.walked else Encoder
        return RecordView(
            function=function,
            constant=function.upper(),
            head=record_head(layout),
            rows=field_rows(payload),
            size=payload.most,
            varied=payload.walked,
            measure=size_lines(payload, self._layouts.records) if payload.walked and encoded else [],
            size_text=_size_text(payload.least, payload.most),
            members=self._struct(payload, notes),
            initialiser=self._initialisers(payload),
            check=encoder(payload, self._layouts).checks() if encoded else [],
            put=encoder(payload, self._layouts).writes() if encoded else [],
            get=self._get(payload, function) if decoded else [],
            scales=self._scales(function, payload),
        )

    def _get(self, payload: PayloadPlan, function: str) -> list[str]:
        """Statements that decode a record."""
        if payload.walked:
            return WalkedDecoder(payload, self._layouts, init=f"{function.upper()}_INIT").record()
        return Decoder(payload, self._layouts).record()

    def _scales(self, owner: str, payload: PayloadPlan) -> list[Kind]:
        """The conversions of values whose named type does not have them."""
        numbers = (each for each in payload.settable if isinstance(each, ValueStep | Member | ItemsStep))
        kinds = (self._types.conversions(owner, each.name, each.number) for each in numbers)
        return [kind for kind in kinds if kind is not None and not kind.named]

    def _initialiser(self, each: Holder) -> str:
        match each:
            case ValueStep() | Member():
                return scalar_literal(each.number, each.number.default)
            case RecordStep():
                return self._record_init(each)
            case RecordsStep():
                least = each.length.minimum
                items = ", ".join([self._record_init(each)] * max(1, least))
                return f"{{{items}}}" if each.fixed else f"{least}U, {{{items}}}"
            case BytesStep():
                default: Sequence[int] = each.padded(each.default) if each.pad else each.default
                octets = [unsigned(byte, 8, hexadecimal=True) for byte in default]
            case ItemsStep():
                default = each.default
                octets = [scalar_literal(each.number, item) for item in default]
            case _:
                assert_never(each)
        content = f"{{{', '.join(octets)}}}" if any(default) else "{0}"
        return content if each.fixed else f"{len(octets)}U, {content}"

    def _record_init(self, each: RecordStep | RecordsStep) -> str:
        return f"{self._layouts.records[each.record.name].upper()}_INIT"

    def _members(self, each: Holder, note: str) -> list[StructMember]:
        """The lines of a value; a run of variable size has two."""
        value = StructMember(f"{self._declared(each, naming.member(each.name))};", note)
        if not isinstance(each, RunStep) or each.fixed:
            return [value]
        number = f"{count_type(each.length.maximum)} {each.name}_{each.quantity};"
        return [StructMember(number, f"{_items_word(each)} in {each.name}"), value]

    def _case(self, each: Holder, note: str) -> list[StructMember]:
        """The lines of a member of a union."""
        assert each.presence is not None
        name = naming.member(each.presence.case)
        if not isinstance(each, RunStep) or each.fixed:
            return [StructMember(f"{self._declared(each, name)};", note)]
        number = f"{count_type(each.length.maximum)} {each.quantity};"
        inside = [StructMember(number, ""), StructMember(f"{self._declared(each, 'items')};", note)]
        return [StructMember("struct {", ""), *_deeper(inside), StructMember(f"}} {name};", "")]

    def _union(self, cases: Sequence[Holder], notes: Mapping[str, str]) -> list[StructMember]:
        """The lines of a choice: the usual case is the first, which INIT sets."""
        usual = first_case(cases)
        ordered = (usual, *(each for each in cases if each is not usual))
        inside = [member for each in ordered for member in self._case(each, notes[each.name])]
        return [
            StructMember("union {", ""),
            *_deeper(inside),
            StructMember(f"}} {naming.member(value_name(usual))};", ""),
        ]

    def _declared(self, each: Holder, name: str) -> str:
        """The declaration of a value."""
        many = f"[{each.length.maximum}]" if isinstance(each, RunStep) else ""
        match each:
            case Member() if isinstance(text := each.number.meaning, Characters):
                kind, many = "uint8_t", f"[{text.number}]"
            case ValueStep() | Member() | ItemsStep():
                kind = self._types.of(each.number)
            case BytesStep():
                kind = "uint8_t"
            case RecordStep() | RecordsStep():
                kind = f"{self._layouts.records[each.record.name]}_t"
            case _:
                assert_never(each)
        return f"{kind} {name}{many}"


def _using(plan: MessagePlan, lines: list[str]) -> list[str]:
    """The statements; where values of the frame decide about fields, they may not use a parameter."""
    if not plan.payload.decided_by:
        return lines
    text = "\n".join(lines)
    names = payload_arguments(plan.message).split(", ")[:-1]
    unused = [name for name in names if not re.search(rf"\b{name}(->| =|,|\))", text)]
    return [*(f"(void){name};" for name in unused), *lines]


def _items_word(run: RunStep) -> str:
    match run:
        case BytesStep():
            return "bytes"
        case ItemsStep():
            return "items"
        case RecordsStep():
            return "records"
        case _:
            assert_never(run)


def _deeper(members: Iterable[StructMember]) -> list[StructMember]:
    return [StructMember(f"    {each.declaration}", each.note) for each in members]


def trimming(most: str, keep: int) -> list[str]:
    """Statements that leave out the zeros at the end of a payload, but not its first bytes."""
    inside = f"(size > {keep}U) && " if keep else "(size > 0U) && "
    return [
        f"size_t size = {most};",
        f"while ({inside}(payload[size - 1U] == 0U)) {{",
        "    --size;",
        "}",
    ]


def _size_text(least: int, most: int) -> str:
    return f"{most} byte{'s' if most > 1 else ''}" if least == most else f"{least}..{most} bytes"


@dataclass(frozen=True, slots=True)
class Rounding:
    """A C type that physical values are rounded to, with its zero and one."""

    name: str
    type: str
    zero: str
    one: str


def nearest_helpers(types: Types, messages: tuple[MessagePlan, ...]) -> list[Rounding]:
    """The C types that physical values are rounded to."""
    payloads = [message.payload for message in messages]
    payloads += [record.payload for record in all_records(payloads)]
    kinds = (
        types.conversions("", each.name, each.number)
        for payload in payloads
        for each in payload.settable
        if isinstance(each, ValueStep | Member | ItemsStep)
    )
    return [
        Rounding(plain.removesuffix("_t"), plain, *(("0U", "1U") if plain.startswith("u") else ("0", "1")))
        for plain in dict.fromkeys(kind.plain for kind in kinds if kind)
    ]
