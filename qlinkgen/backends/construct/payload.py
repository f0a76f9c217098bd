"""Builds the constructor calls of the fields of a payload from its steps."""

from __future__ import annotations

import keyword
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from decimal import Decimal
from typing import assert_never

from qlinkgen.backends.construct.algorithms import algorithm
from qlinkgen.backends.construct.tree import Call, Definition, Named, Node, Number, Ref, Sequence, hexadecimal
from qlinkgen.model import naming
from qlinkgen.model.fields import Layout, greatest_size
from qlinkgen.model.integer import Integer
from qlinkgen.model.message import Message
from qlinkgen.model.naming import record_key
from qlinkgen.model.scientific import Scientific
from qlinkgen.model.types import Characters, Enum, Flags, Float, Scalar, byte_chunks
from qlinkgen.model.values import native_from_raw
from qlinkgen.model.words import Words
from qlinkgen.plan.expr import Clear, Condition, Legible, OneOf, Within
from qlinkgen.plan.openings import openings
from qlinkgen.plan.parts import CellPart
from qlinkgen.plan.payload import (
    BitsStep,
    BytesStep,
    ConstantStep,
    CountStep,
    Equal,
    FilledStep,
    ItemsStep,
    Member,
    PayloadPlan,
    RecordsStep,
    RecordStep,
    ReservedStep,
    RunStep,
    Step,
    ValueStep,
    all_records,
    conditions,
)
from qlinkgen.plan.planning import record_plan
from qlinkgen.plan.tree import MessagePlan, Plan

#: Sizes of the integers that construct has names for.
_NAMED_SIZES = (1, 2, 3, 4, 8)
_UNCONFIRMED = "NOT CONFIRMED by a second source."


def integer(kind: Integer, *, signed: bool | None = None) -> Node:
    """The construct of an integer, Groups if construct does not provide one."""
    signed = kind.signed if signed is None else signed
    if isinstance(kind.text, Words):
        return _words(kind.text)
    if isinstance(kind.text, Scientific):
        return Call("TextReal", (kind.bits,))
    if text := kind.text:
        limits = (("low", kind.minimum), ("high", kind.maximum))
        point = (("point", text.point),) if text.point else ()
        spaced = (("spaced", True),) if text.spaced else ()
        plain = (("plain", True),) if text.plain else ()
        return Call("TextNumber", (text.base, text.least, text.most), limits + point + spaced + plain)
    if kind.bcd:
        swapped = (("swapped", True),) if kind.byteorder == "little" and kind.size > 1 else ()
        return Call("BcdInteger", (kind.size,), swapped)
    if kind.byteorder is None:
        pairs = tuple((chunk.shift, chunk.bits) for chunk in kind.chunks)
        return Call("Groups", pairs, (("signed", True),) if signed else ())
    if kind.size in _NAMED_SIZES:
        return Ref(f"Int{kind.bits}{'s' if signed else 'u'}{kind.byteorder[0]}")
    flags = {"signed": signed, "swapped": kind.byteorder == "little"}
    return Call("BytesInteger", (kind.size,), tuple((key, True) for key, value in flags.items() if value))


def _words(words: Words) -> Call:
    return Call("Word", words.words, (("folded", True),) if words.folded else ())


def _raw(number: Scalar, kind: Integer) -> Node:
    """The construct of a number before conditions and conversions."""
    if isinstance(number.meaning, Float) and kind.byteorder is not None:
        return Ref(f"Float{kind.bits}{kind.byteorder[0]}")
    return integer(kind)


def _item(step: ItemsStep) -> Node:
    """The construct of an item; one in a row of bits is like a bit field."""
    if not step.packed:
        return _raw(step.number, step.item)
    signed = (("signed", True),) if step.item.signed else ()
    return Call("Bits", (0, step.item.bits - 1), signed)


class Names:
    """Names of the definitions of a module: schema names in capitals, with a suffix if they are taken."""

    def __init__(self, taken: Iterable[str]) -> None:
        """``taken`` are names used by the module."""
        self._taken = set(taken)

    def of(self, name: str, suffix: str) -> str:
        """A unique name."""
        upper = naming.upper(name)
        while upper in self._taken:
            upper += f"_{suffix}"
        self._taken.add(upper)
        return upper


class Types:
    """The named types: each is defined once, and used by every field with the same integer.

    Enums and flags have the names of their labels; other types have the names of their conversions.
    """

    def __init__(self, plan: Plan, groups: Mapping[str, str], names: Names) -> None:
        """``groups`` are the names of enums and flags, ``names`` creates those of other types."""
        self._plan = plan
        #: The names of the definitions of records.
        self.records = {each.name: names.of(each.name, "TYPE") for each in plan.layouts}
        #: Records that end arrays.
        self.ended = {
            step.record.name
            for payload in self._payloads()
            for step in payload.steps
            if isinstance(step, RecordsStep) and step.last
        }
        found: dict[str, Counter[Node]] = {}
        for number, raw in self._numbers():
            if name := _name(number):
                found.setdefault(name, Counter())[_converted(number, raw)] += 1
        self._usual = {
            name: node
            for name, node in ((name, counts.most_common(1)[0][0]) for name, counts in found.items())
            if name in groups or isinstance(node, Call)  # a plain integer of construct needs no name
        }
        self._names = {name: groups.get(name) or names.of(name, "TYPE") for name in self._usual} | dict(
            groups
        )

    def definitions(self) -> Iterator[Definition]:
        """Definitions of enums, flags and other types in use."""
        for enum in self._plan.enums:
            members = tuple((each.name, each.value) for each in enum.members)
            yield self._labelled("Enum", enum, members)
        for flags in self._plan.flags:
            digits = (flags.bits + 3) // 4
            bits = tuple((each.name, hexadecimal(1 << each.value, digits)) for each in flags.members)
            yield self._labelled("FlagsEnum", flags, bits)
        groups = {each.name for each in self._plan.enums} | {each.name for each in self._plan.flags}
        others = [(name, node) for name, node in self._usual.items() if name not in groups]
        for index, (name, node) in enumerate(others):
            yield Definition(self._names[name], node, "" if index else "Types of fields.", bool(index))

    def _labelled(self, kind: str, group: Enum | Flags, members: tuple[tuple[str, Node], ...]) -> Definition:
        size = (group.bits + 7) // 8
        plain = integer(Integer(8 * size, signed=False, chunks=byte_chunks(size, "big")))
        words = group.words if isinstance(group, Enum) else None
        carrier = self._usual.get(group.name, _words(words) if words else plain)
        if any(keyword.iskeyword(name) or name in ("self", "subcon") for name, _ in members):
            node = Call(kind, (carrier, Sequence(tuple(Call("Member", each) for each in members))))
        else:
            node = Call(kind, (carrier,), members)
        return Definition(self._names[group.name], node, comment(group.doc, group.section))

    def _numbers(self) -> Iterator[tuple[Scalar, Node]]:
        yield from ((member.number, _bits(member)) for member in self._plan.beside.values())
        for step in (step for payload in self._payloads() for step in payload.steps):
            match step:
                case ValueStep():
                    yield step.number, _raw(step.number, step.integer)
                case ItemsStep():
                    yield step.number, _item(step)
                case BitsStep():
                    yield from ((each.number, _bits(each)) for each in step.members)
                case ConstantStep() | ReservedStep() | CountStep() | FilledStep() | BytesStep():
                    pass
                case RecordStep() | RecordsStep():
                    pass
                case _:
                    assert_never(step)

    def _payloads(self) -> list[PayloadPlan]:
        """Those of messages, and of the records in them."""
        payloads = [message.payload for message in self._plan.messages]
        return [*payloads, *(record.payload for record in all_records(payloads))]

    def value(self, number: Scalar, raw: Node) -> Node:
        """The adapter with a default."""
        return Call("Default", (self.of(number, raw), _shown(number, number.default)))

    def of(self, number: Scalar, raw: Node) -> Node:
        """The adapter from an integer to the native value."""
        node, meaning = _converted(number, raw), number.meaning
        same = self._usual.get(name := _name(number)) == node
        match meaning:
            case Characters():
                return node
            case Float() | "bool" | None:
                return Ref(self._names[name]) if same else node
            case Enum():
                return self._labels(name, node, same=same)
            case Flags():
                return Call("OpenFlags", (self._labels(name, node, same=same),))
            case _:
                assert_never(meaning)

    def _labels(self, name: str, node: Node, *, same: bool) -> Node:
        known = Ref(self._names[name])
        return known if same else Call("like", (known, node))


def comment(doc: str, section: str, *, confirmed: bool = True) -> str:
    """Purpose and section, with a remark if not confirmed."""
    words = [doc.strip(), f"({section})" if section else "", "" if confirmed else _UNCONFIRMED]
    return " ".join(filter(None, words))


def fields(message: MessagePlan, types: Types) -> tuple[Node, ...]:
    """The fields of a message, in wire order."""
    return tuple(_Field(message.message, types).of(step) for step in message.payload.steps)


def record(layout: Layout, types: Types) -> Call:
    """The structure of a record."""
    payload = record_plan(layout).payload
    inside: tuple[Node, ...] = (layout.name, *(_Field(layout, types).of(step) for step in payload.steps))
    prefix = "Filled" if payload.filled_in else ""
    if not payload.walked and layout.name not in types.ended:
        return Call(f"{prefix}Record", inside)
    presence, choices = tuple(presence_of(payload)), tuple(choices_of(payload))
    settings: dict[str, Node] = {"presence": Sequence(presence)} if presence else {}
    settings |= {"choices": Sequence(choices)} if choices else {}
    return Call(f"{prefix}VariedRecord", inside, (*settings.items(), ("most", payload.most)))


def presence_of(payload: PayloadPlan) -> Iterator[Node]:
    """The fields that may be absent, and what decides."""
    for segment in payload.segments:
        if presence := segment.presence:
            tests: tuple[Node, ...] = tuple(
                (tested_key(payload, each.value), each.ranges, each.negated) for each in presence.when
            )
            yield presence.field, tests, presence.given


def tested_key(payload: PayloadPlan, name: str) -> str:
    """The name of a tested value: that of one of the frame is the one in a container of the frame."""
    return record_key(name) if any(each.name == name for each in payload.decided_by) else name


def choices_of(payload: PayloadPlan) -> Iterator[Node]:
    """The name of each choice, and the fields that are its cases."""
    for segment, cases in payload.by_choice:
        if presences := [each.presence for each in cases if each.presence]:
            yield segment.slot, tuple(each.field for each in presences)


def is_varied(payload: PayloadPlan) -> bool:
    """Whether it has records that are read one by one, or a choice whose bytes are counted."""
    return any(segment.records or segment.counted for segment in payload.segments)


def beside(part: CellPart, types: Types) -> Call:
    """The structure of the values of every frame in a part."""
    members = (Named(record_key(each.name), types.value(each.number, _bits(each))) for each in part.values)
    return Call("BitFields", (integer(part.integer), *members))


class _Field:
    """Prints the fields of one message or record."""

    def __init__(self, stated: Message | Layout, types: Types) -> None:
        self._types = types
        self._stated = {field.name: field for field in stated.fields}
        self._inner = {value.name: value.doc for value in stated.values if value.bits}

    def of(self, step: Step) -> Named:
        match step:
            case ValueStep():
                return self._named(
                    step, self._value(step.number, _raw(step.number, step.integer)), step.number.unit
                )
            case ConstantStep():
                return self._named(step, _constant(step))
            case FilledStep():
                return self._named(step, _filled(step))
            case ReservedStep():
                return self._named(step, _reserved(step))
            case CountStep():
                return self._named(step, _count(step, self._most(step)))
            case BitsStep():
                members = tuple(map(self._member, step.members))
                return self._named(step, Call("BitFields", (integer(step.integer, signed=False), *members)))
            case BytesStep():
                return self._octets(step)
            case ItemsStep():
                return self._items(step)
            case RecordStep() | RecordsStep():
                return self._record(step)
            case _:
                assert_never(step)

    def _most(self, step: CountStep) -> tuple[tuple[str, Node], ...]:
        """The maximum size of a choice whose bytes are counted."""
        cases = [each for each in self._stated.values() if each.slot == step.run]
        return (("most", greatest_size(cases)),) if cases else ()

    def _octets(self, step: BytesStep) -> Named:
        kind, default = ("TextField", step.default.decode()) if step.text else ("BytesField", step.default)
        if step.terminator:
            kind = "TerminatedText" if step.text else "TerminatedBytes"
            return self._run(step, kind, (step.terminator,), default)
        if step.excluded:
            text = Call("BetweenField", (step.length.minimum, step.length.maximum, step.excluded))
            return self._named(step, Call("Default", (text, default)))
        kind, pad = (f"Padded{kind}", (step.pad,)) if step.pad else (kind, ())
        return self._run(step, kind, pad, default)

    def _items(self, step: ItemsStep) -> Named:
        item = self._types.of(step.number, _item(step))
        items = Sequence(tuple(_shown(step.number, each) for each in step.default))
        if step.between:
            return self._run(step, "TextList", (item, step.between), items)
        kind, more = ("PackedField", _row(step)) if step.packed else ("ArrayField", ())
        return self._run(step, kind, (item, *more), items)

    def _record(self, step: RecordStep | RecordsStep) -> Named:
        known = Ref(self._types.records[step.record.name])
        if isinstance(step, RecordStep):
            node = Call("One", (known,)) if step.walked else known
            return self._named(step, Call("Default", (node, Call("Container"))))
        if step.walked:
            return self._several(step)
        return self._run(step, "ArrayField", (known,), Sequence((Call("Container"),) * step.length.minimum))

    def _several(self, step: RecordsStep) -> Named:
        last = tuple((each.value, each.ranges, each.negated) for each in step.last)
        given = (Ref(self._types.records[step.record.name]), step.length.minimum, step.length.maximum)
        resting: tuple[tuple[str, Node], ...] = (("resting", True),) if openings(step) else ()
        node = Call("Several", (*given, Sequence(last)) if last else given, resting)
        empty = Sequence((Call("Container"),) * step.length.minimum)
        return self._named(step, Call("Default", (node, empty)))

    def _run(self, step: RunStep, kind: str, item: tuple[Node, ...], default: Node) -> Named:
        run = Call(kind, (*item, step.length.minimum, step.length.maximum))
        return self._named(step, Call("Default", (run, default)))

    def _named(self, step: Step, node: Node, unit: str = "") -> Named:
        field = self._stated[step.name]
        doc = ": ".join(filter(None, (unit, field.doc)))
        return Named(step.name, node, doc + ("" if field.confirmed else " (not confirmed)"))

    def _member(self, member: Member) -> Named:
        bits = _bits(member)
        return Named(member.name, self._value(member.number, bits), self._inner[member.name])

    def _value(self, number: Scalar, raw: Node) -> Node:
        return self._types.value(number, raw)


def _constant(step: ConstantStep) -> Call:
    if not step.accepted:
        return Call("Const", (step.value, integer(step.integer)))
    known = Call("OneOf", (integer(step.integer), Sequence((step.value, *step.accepted))))
    return Call("Rebuild", (known, step.value))


def _filled(step: FilledStep) -> Call:
    rule = step.rule
    if isinstance(rule, Equal):
        settings: dict[str, Node] = {"inverted": True} if rule.inverted else {}
        settings |= {"added": rule.added} if rule.added else {}
        given: Node = Call("EqualTo", (integer(rule.source),), tuple(settings.items()))
    else:
        given = algorithm(rule)
    over = Sequence(step.over)
    return Call("Filled", (integer(step.integer), step.integer.bits, over, given))


def _reserved(step: ReservedStep) -> Call:
    if step.integer.text and not step.integer.text.fixed:
        return Call("Rebuild", (integer(step.integer), step.value))
    return Call("Rebuild", (Call("Bytes", (step.integer.size,)), step.integer.pack(step.value)))


def _count(step: CountStep, most: tuple[tuple[str, Node], ...]) -> Call:
    term = step.term
    if step.sized:
        more = (("more", term.more),) if term.more else ()
        return Call("SizeOf", (integer(step.integer), step.run), (*more, *most))
    scale: tuple[Node, ...] = (term.factor,) if term.packed or term.factor > 1 else ()
    packed = (("packed", True),) if term.packed else ()
    more = (("more", term.more),) if term.more else ()
    return Call("Count", (integer(step.integer), step.run, *scale), packed + more)


def _row(step: ItemsStep) -> tuple[Node, ...]:
    """Bits of an item, and whether it begins with the most significant ones."""
    return (step.item.bits, step.packed == "most")


def _shown(number: Scalar, raw: int) -> Node:
    """The native value of a raw number."""
    if isinstance(text := number.meaning, Characters):
        return text.text(raw)
    value = native_from_raw(number, raw)
    if isinstance(value, Decimal):
        return _decimal(value)
    finite = not isinstance(value, float) or math.isfinite(value)
    return value if finite else Call("float", (str(value),))


def _decimal(number: Decimal) -> Call:
    text = str(number)
    return Call("Decimal", (int(text) if text.lstrip("-").isdecimal() else text,))


def _name(number: Scalar) -> str:
    """Name of the type of a number, "" if it has none."""
    meaning = number.meaning
    match meaning:
        case Enum() | Flags():
            return meaning.name
        case Float() | Characters() | "bool" | None:
            return number.type_name
        case _:
            assert_never(meaning)


def _bits(member: Member) -> Node:
    signed = (("signed", True),) if member.number.signed else ()
    return Call("Bits", (member.shift, member.shift + member.bits - 1), signed)


def _converted(number: Scalar, raw: Node) -> Node:
    """An integer with its conditions and its conversion, without labels."""
    node = raw
    if isinstance(number.meaning, Float):
        return Call("Ranged", (raw, *number.meaning.bounds)) if number.meaning.bounds else raw
    for each in conditions(number):
        node = _limited(node, each)
    if number.meaning == "bool":
        node = Call("Boolean", (node,))
    if scaling := number.scaling:
        settings = {"factor": (scaling.factor, 1), "bias": (scaling.bias, 0), "divisor": (scaling.divisor, 1)}
        kwargs = tuple((key, _steps(value)) for key, (value, usual) in settings.items() if value != usual)
        node = Call("Scaled", (node,), kwargs + ((("exact", True),) if number.number == "decimal" else ()))
    return node


def _limited(node: Node, limit: Condition) -> Node:
    match limit:
        case Within():
            return Call("Ranged", (node, limit.low, limit.high))
        case Clear():
            return Call("Clear", (node, hexadecimal(limit.mask)))
        case Legible():
            text = limit.characters
            return Call("Letters", (node, text.number, *((text.excluded,) if text.excluded else ())))
        case OneOf():
            raise AssertionError("only floating-point numbers have several ranges")
        case _:
            assert_never(limit)


def _steps(number: int) -> Node:
    """A number, printed as a power of two for fixed-point fractions."""
    is_power = number >= 1 << 10 and number.bit_count() == 1
    return Number(number, f"2**{number.bit_length() - 1}") if is_power else number
