"""Makes fields of the sequence of a type."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from qlinkgen.importers import cells
from qlinkgen.importers.document import Field, Notation, Value
from qlinkgen.importers.ksy import expressions
from qlinkgen.importers.ksy.blobs import MOST, blob, constant
from qlinkgen.importers.ksy.enums import Enums, number_of
from qlinkgen.importers.ksy.scalars import Scalar, bit_width, scalar
from qlinkgen.importers.ksy.tree import Attribute, Node, Refused, Type
from qlinkgen.importers.ksy.valid import valid
from qlinkgen.importers.names import Names
from qlinkgen.importers.notes import Notes

_SPARE = re.compile(r"(?:reserved|rsvd|unused|spare|padding|pad|unnamed)_?\d*")


@dataclass
class Shared:
    """What the types of a file have in common.

    Attributes:
        order: Byte order of the schema.
        names: Names of records and enums.
        wanted: Types that fields have, with the names of their records.
    """

    notes: Notes
    order: str
    names: Names
    enums: Enums
    wanted: dict[str, tuple[Type, str]] = field(default_factory=dict)

    def record(self, type_: Type) -> str:
        """The name of the record of a type."""
        if type_.name not in self.wanted:
            self.wanted[type_.name] = type_, self.names.take(type_.name, type_.line)
        return self.wanted[type_.name][1]


@dataclass
class _Bits:
    """Bit fields in a row."""

    attributes: list[tuple[Attribute, int]] = field(default_factory=list)

    @property
    def width(self) -> int:
        return sum(width for _, width in self.attributes)


class Layout:
    """Lays out one sequence.

    Args:
        type_: The type that it is of, in which names are looked up.
        shared: What the types have in common.
        outside: Attributes before the sequence that it may refer to.
    """

    def __init__(self, type_: Type, shared: Shared) -> None:
        self._type = type_
        self._shared = shared
        self._names = Names(shared.notes, "field")
        self._called: dict[str, str] = {}
        self._known: dict[str, Attribute] = {}
        self._counts: dict[str, tuple[str, expressions.Count]] = {}
        self._fields: list[Field] = []
        self._bits = _Bits()
        self._integers = 0

    def fields(self, attributes: Sequence[Attribute]) -> tuple[Field, ...]:
        """The fields of a sequence. Raises Refused."""
        for each in attributes:
            self._called[each.id] = self._names.take(each.id, each.line)
        for each in attributes:
            if each.trouble:
                raise Refused(each.line, f"{each.id[:60]}: {each.trouble}")
            self._collect_counts(each)
            self._known[each.id] = each
        for each in attributes:
            width = bit_width(each.type)
            if width is not None and not each.text("if") and not each.text("repeat"):
                self._bit(each, width)
                continue
            self._end_bits()
            self._fields.append(self._field(each, width))
        self._end_bits()
        return tuple(self._fields)

    def _collect_counts(self, attribute: Attribute) -> None:
        """Note which field counts another one; it is filled by the codec."""
        for key in ("size", "repeat-expr"):
            text = attribute.text(key)
            found = expressions.count(text) if text else None
            if not isinstance(found, expressions.Count):
                continue
            counter = self._known.get(found.name)
            if counter is None or self._scalar(counter) is None or found.name in self._counts:
                raise Refused(
                    attribute.line, f"{attribute.id[:60]}: {text[:60]} is not an earlier integer of its own"
                )
            self._counts[found.name] = attribute.id, found

    def _scalar(self, attribute: Attribute) -> Scalar | None:
        found = scalar(attribute.type, self._type.endian)
        return found if found and found.limits and not attribute.text("repeat") else None

    # Fields ---------------------------------------------------------------------------------------------

    def _field(self, attribute: Attribute, width: int | None) -> Field:
        keys: dict[str, Value] = {}
        if attribute.id in self._counts:
            keys |= self._counting(attribute.id)
        if attribute.switch is not None:
            type_, more = "", self._choice(attribute.switch)
        elif attribute.node.get("contents") is not None:
            type_, more = constant(attribute, little=self._shared.order == "little")
        else:
            type_, more = self._typed(attribute, width)
        keys |= more
        if attribute.text("repeat"):
            type_ = self._repeated(attribute, type_, keys)
        if attribute.text("if"):
            keys["if"] = self._condition(attribute, attribute.text("if"))
        if not keys and _SPARE.fullmatch(attribute.id) and re.fullmatch(r"u\d+", type_):
            keys = {"reserved": True}
        return Field(self._called[attribute.id], type_, attribute.line, keys, attribute.doc)

    def _counting(self, name: str) -> dict[str, Value]:
        counted, found = self._counts[name]
        keys: dict[str, Value] = {"counts": self._called[counted]}
        if self._known[counted].text("size") and self._known[counted].type not in ("", "str", "strz"):
            keys["counts_in"] = "bytes"
        if found.scale != 1:
            keys["scale"] = found.scale
        if found.offset:
            keys["offset"] = found.offset
        return keys

    def _typed(self, attribute: Attribute, width: int | None) -> tuple[str, dict[str, Value]]:
        text = attribute.type
        if text in ("", "str", "strz"):
            return blob(attribute, self._type.encoding, self._shared.notes)
        if width is not None:
            raise Refused(attribute.line, f"{attribute.id[:60]}: bits that are repeated or may be absent")
        if (found := scalar(text, self._type.endian)) is not None:
            return self._number(attribute, found)
        if scalar(text, "le") is not None:
            raise Refused(attribute.line, f"{attribute.id[:60]}: the byte order of {text} is not stated")
        inner = self._type.find_type(text)
        if inner is None:
            raise Refused(attribute.line, f"{attribute.id[:60]}: the type {text[:60]} is not in this file")
        if attribute.text("size") and not isinstance(
            expressions.count(attribute.text("size")), expressions.Count
        ):
            raise Refused(
                attribute.line, f"{attribute.id[:60]}: a type in a fixed or computed number of bytes"
            )
        return self._shared.record(inner), {}

    def _number(self, attribute: Attribute, found: Scalar) -> tuple[str, dict[str, Value]]:
        keys: dict[str, Value] = {}
        if found.order and found.order != self._shared.order:
            keys["byteorder"] = found.order
        keys |= valid(attribute, found.limits, self._shared.notes)
        type_ = found.type
        if attribute.text("enum"):
            type_ = self._shared.enums.of(attribute.text("enum"), type_, self._type, attribute.line)
        return type_, keys

    # Keys -----------------------------------------------------------------------------------------------

    def _repeated(self, attribute: Attribute, type_: str, keys: dict[str, Value]) -> str:
        if not type_ or type_ in ("bytes", "text") or "[" in type_ or "const" in keys:
            raise Refused(attribute.line, f"{attribute.id[:60]}: only numbers and types are repeated")
        match attribute.text("repeat"):
            case "eos":
                return f"{type_}[]"
            case "expr":
                found = expressions.count(attribute.text("repeat-expr"))
                if isinstance(found, int) and 0 < found <= MOST:
                    return f"{type_}[{found}]"
                if isinstance(found, expressions.Count):
                    return f"{type_}[]"
                text = attribute.text("repeat-expr")
                raise Refused(attribute.line, f"{attribute.id[:60]}: '{text[:60]}' is not a field or number")
            case "until":
                keys["until"] = self._condition(
                    attribute, attribute.text("repeat-until"), self._type.find_type(attribute.type)
                )
                return f"{type_}[]"
            case other:
                raise Refused(attribute.line, f"{attribute.id[:60]}: repeat: {other[:20]} is not known")

    def _condition(self, attribute: Attribute, text: str, inside: Type | None = None) -> Value:
        known = {each.id: each for each in inside.attributes} if inside else self._known

        def limits(name: str) -> tuple[int, int] | None:
            found = known.get(name)
            number = scalar(found.type, (inside or self._type).endian) if found else None
            width = bit_width(found.type) if found else None
            return number.limits if number else (0, (1 << width) - 1) if width else None

        found = expressions.condition(text, lambda _, value: number_of(self._type, value), limits)
        if found is None or (
            isinstance(found, str) and limits(found.rpartition(".")[2]) is None and "." not in found
        ):
            raise Refused(
                attribute.line,
                f"{attribute.id[:60]}: the condition '{text[:60]}' does not compare a field with a number",
            )
        names = [found] if isinstance(found, str) else list(found) if isinstance(found, dict) else []
        for name in names:
            first = name.partition(".")[0]
            if first not in known:
                raise Refused(attribute.line, f"{attribute.id[:60]}: '{name[:60]}' is not a field before it")
        return found

    def _choice(self, node: Node) -> dict[str, Value]:
        on = node.text("switch-on")
        if expressions.count(on) != expressions.Count(on) or on.partition(".")[0] not in self._known:
            raise Refused(node.line, f"the choice by '{on[:60]}' is not one by a field before it")
        cases: dict[str, Value] = {}
        default: dict[str, Value] = {}
        for key, value in (node.get("cases") or Node(None, (), node.source)).items:
            type_ = self._case(value)
            if key == "_":
                default = {"default": type_}
                continue
            number = cells.integer(key) if cells.integer(key) is not None else number_of(self._type, key)
            if number is None:
                raise Refused(value.line, f"the case '{key[:60]}' is not a number or a value of an enum")
            cases[str(number)] = type_
        return {"switch": on, "cases": cases, **default}

    def _case(self, node: Node) -> str:
        text = node.word
        if (found := scalar(text, self._type.endian)) is not None:
            return found.type
        inner = self._type.find_type(text)
        if inner is None:
            raise Refused(node.line, f"the type '{text[:60]}' of a case is not in this file")
        return self._shared.record(inner)

    # Bits -----------------------------------------------------------------------------------------------

    def _bit(self, attribute: Attribute, width: int) -> None:
        if self._bits.width + width > 64:
            raise Refused(
                attribute.line, f"{attribute.id[:60]}: bits that end more than 64 bits after whole bytes"
            )
        self._bits.attributes.append((attribute, width))
        if self._bits.width % 8 == 0:
            self._end_bits()

    def _end_bits(self) -> None:
        bits, self._bits = self._bits, _Bits()
        if not bits.attributes:
            return
        size = -(-bits.width // 8)
        little = self._type.bit_endian == "le"
        keys: dict[str, Value] = {}
        if size > 1 and self._shared.order != ("little" if little else "big"):
            keys["byteorder"] = "little" if little else "big"
        first, _ = bits.attributes[0]
        if len(bits.attributes) == 1 and bits.width % 8 == 0:
            type_ = f"u{bits.width}"
            keys |= valid(first, (0, (1 << bits.width) - 1), self._shared.notes)
            if first.text("enum"):
                type_ = self._shared.enums.of(first.text("enum"), type_, self._type, first.line)
            self._fields.append(Field(self._called[first.id], type_, first.line, keys, first.doc))
            return
        at, inside = 0, dict[str, Value]()
        for attribute, width in bits.attributes:
            low = at if little else 8 * size - at - width
            at += width
            if not _SPARE.fullmatch(attribute.id):
                inside[self._called[attribute.id]] = self._bit_keys(attribute, low, width)
        self._integers += 1
        name = self._names.take("bits" if self._integers == 1 else f"bits_{self._integers}", first.line)
        keys |= {"bits": inside} if inside else {"reserved": True}
        self._fields.append(Field(name, f"u{8 * size}", first.line, keys))

    def _bit_keys(self, attribute: Attribute, low: int, width: int) -> Value:
        at: Value = low if width == 1 else Notation(f"{low}..{low + width - 1}")
        keys: dict[str, Value] = {"at": at}
        if attribute.text("enum"):
            type_ = self._shared.enums.of(attribute.text("enum"), f"u{width}", self._type, attribute.line)
            if type_ != f"u{width}":
                keys["type"] = type_
        if width > 1:
            stated = valid(attribute, (0, (1 << width) - 1), self._shared.notes)
            keys |= {key: each for key, each in stated.items() if key == "range"}
        if attribute.doc:
            keys["doc"] = attribute.doc
        return keys if len(keys) > 1 else at


def is_open(fields: Sequence[Field]) -> bool:
    """Whether the size of fields follows from nothing that they state."""
    counted = {each.keys["counts"] for each in fields if "counts" in each.keys}
    return any(
        (each.type in ("bytes", "text") or each.type.endswith("[]"))
        and each.name not in counted
        and not each.keys.keys() & {"until", "terminator"}
        for each in fields
    )
