"""Makes fields of the sequence of a type."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from qlinkgen.importers.document import Field, Notation, Value
from qlinkgen.importers.ksy import expressions
from qlinkgen.importers.ksy.blobs import MOST, blob, constant
from qlinkgen.importers.ksy.choices import Choices
from qlinkgen.importers.ksy.conditions import Tested, condition
from qlinkgen.importers.ksy.counts import Counts
from qlinkgen.importers.ksy.enums import Enums
from qlinkgen.importers.ksy.flat import flat, label, record_of
from qlinkgen.importers.ksy.lookup import Lookup
from qlinkgen.importers.ksy.opened import opened
from qlinkgen.importers.ksy.scalars import Scalar, bit_order, bit_width, scalar
from qlinkgen.importers.ksy.sizes import bits_of_type
from qlinkgen.importers.ksy.tree import Attribute, Refused, Type
from qlinkgen.importers.ksy.valid import valid
from qlinkgen.importers.names import Names, last_name
from qlinkgen.importers.notes import Notes

_SPARE: Final = re.compile(r"(?:reserved|rsvd|unused|spare|padding|pad|unnamed)_?\d*")
#: Whether bytes are left.
_MORE: Final = re.compile(
    r"(?:not\s+_io\.eof|_io\.eof\s*==\s*false|_io\.eof\s*!=\s*true|_io\.pos\s*<\s*_io\.size)"
)


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
            raw = last_name(type_.name, self.names)
            self.wanted[type_.name] = type_, self.names.take(raw, type_.line, type_.notes)
        return self.wanted[type_.name][1]


@dataclass
class _Bits:
    """Bit fields in a row."""

    attributes: list[tuple[Attribute, int]] = field(default_factory=list)

    @property
    def width(self) -> int:
        return sum(width for _, width in self.attributes)


class Layout:
    """Lays out the sequence of a type.

    Args:
        type_: The type.
        shared: What the types have in common.
        record: Whether it is that of a record, which has no choices and one level of records.
    """

    def __init__(self, type_: Type, shared: Shared, *, record: bool = True) -> None:
        self._shared = shared
        self._names = Names(type_.notes, "field")
        found = opened(flat(type_, levels=1 if record else 2), every=record)
        label(found.attributes)
        self._attributes = found.attributes
        self._groups = found.groups
        self._called = {
            each.path: self._names.take(each.label or each.id, each.line) for each in found.attributes
        }
        self._lookup = Lookup({each.path: each for each in found.attributes}, found.records)
        self._runs = {
            (path, first, last): self._names.take(_bits_name(self._called[path], first, last), type_.line)
            for path, runs in self._lookup.bits.items()
            for first, last in runs
        }
        self._choices = Choices(self._lookup, self._tested, shared.record)
        self._fields: list[Field] = []
        self._bits = _Bits()
        self._integers = 0

    def fields(self) -> tuple[Field, ...]:
        """The fields of the sequence. Raises Refused."""
        for each in self._attributes:
            if each.trouble:
                raise Refused(each, f"{each.id[:60]}: {each.trouble}")
        self._counts = Counts(self._lookup, self._groups, self._called)
        for each in self._attributes:
            width = bit_width(each.type)
            if width is not None and not each.text("repeat"):
                self._bit(each, width)
                continue
            self._end_bits()
            self._fields.append(self._field(each, width))
        self._end_bits()
        return tuple(self._fields)

    # Fields ---------------------------------------------------------------------------------------------

    def _field(self, attribute: Attribute, width: int | None) -> Field:
        keys: dict[str, Value] = self._counts.keys(attribute)
        if attribute.switch is not None:
            type_, more = "", self._choices.keys(attribute)
        elif attribute.node.get("contents") is not None:
            type_, more = constant(attribute, little=self._shared.order == "little")
        else:
            type_, more = self._typed(attribute, width)
        keys |= more
        if attribute.text("repeat"):
            type_ = self._repeated(attribute, type_, keys)
        if attribute.switch is not None and attribute.text("if"):
            raise Refused(
                attribute, f"{attribute.id[:60]}: a choice that may be absent, in a number of bytes"
            )
        keys |= self._present(attribute, is_open=type_ in ("bytes", "text") or type_.endswith("[]"))
        if not keys and _SPARE.fullmatch(attribute.id) and re.fullmatch(r"u\d+", type_):
            keys = {"reserved": True}
        return Field(self._called[attribute.path], type_, attribute.line, keys, attribute.doc)

    def _typed(self, attribute: Attribute, width: int | None) -> tuple[str, dict[str, Value]]:
        text = attribute.type
        if text in ("", "str", "strz"):
            return blob(attribute)
        if width is not None:
            raise Refused(attribute, f"{attribute.id[:60]}: bits that are repeated")
        if (found := scalar(text, attribute.scope.endian)) is not None:
            return self._number(attribute, found)
        if scalar(text, "le") is not None:
            raise Refused(attribute, f"{attribute.id[:60]}: the byte order of {text} is not stated")
        inner = record_of(attribute)
        if inner is None:
            raise Refused(attribute, f"{attribute.id[:60]}: the type {text[:60]} is not in this file")
        text = attribute.text("size")
        size = expressions.parsed(text)
        if text and (not isinstance(size, expressions.Number) or bits_of_type(inner) != 8 * size.value):
            raise Refused(attribute, f"{attribute.id[:60]}: its fields do not have {text[:60]} bytes")
        return self._shared.record(inner), {}

    def _number(self, attribute: Attribute, found: Scalar) -> tuple[str, dict[str, Value]]:
        keys: dict[str, Value] = {}
        if found.order and found.order != self._shared.order:
            keys["byteorder"] = found.order
        keys |= valid(attribute, found.limits)
        runs = self._lookup.bits.get(attribute.path)
        if runs and not self._counts.has(attribute):
            at: dict[str, Value] = {
                self._runs[attribute.path, first, last]: first
                if first == last
                else Notation(f"{first}..{last}")
                for first, last in runs
            }
            return found.type, {**keys, "bits": at}
        return self._shared.enums.of(attribute, found.type), keys

    # Keys -----------------------------------------------------------------------------------------------

    def _repeated(self, attribute: Attribute, type_: str, keys: dict[str, Value]) -> str:
        if not type_ or type_ in ("bytes", "text") or "[" in type_ or "const" in keys:
            raise Refused(attribute, f"{attribute.id[:60]}: only numbers and types are repeated")
        match attribute.text("repeat"):
            case "eos":
                return f"{type_}[]"
            case "expr":
                found = self._lookup.expression(attribute.text("repeat-expr"), attribute)
                if isinstance(found, expressions.Number) and 0 < found.value <= MOST:
                    return f"{type_}[{found.value}]"
                return f"{type_}[]"
            case "until":
                keys["last"] = self._last(attribute)
                return f"{type_}[]"
            case other:
                raise Refused(attribute, f"{attribute.id[:60]}: repeat: {other[:20]} is not known")

    def _last(self, attribute: Attribute) -> Value:
        """The condition on a record, which ends a row of them."""
        inner = record_of(attribute)
        text = attribute.text("repeat-until")
        if inner is None or not inner.attributes:
            raise Refused(
                attribute, f"{attribute.id[:60]}: only records are repeated until one of them is the last"
            )
        layout = Layout(inner, self._shared)
        return layout.condition(re.sub(r"(?<![\w.])_\.", "", text), attribute)

    def condition(self, text: str, attribute: Attribute) -> Value:
        """A condition on all fields of the sequence. Raises Refused."""
        after = Attribute("_", attribute.node, self._lookup.records[""])
        self._lookup = Lookup({**self._lookup.known, "_": after}, self._lookup.records)
        return self._stated(text, after, attribute)

    def _stated(self, text: str, attribute: Attribute, where: Attribute) -> dict[str, Value]:
        found = condition(self._lookup.expression(text, attribute), self._tested)
        if found is None:
            why = (
                self._lookup.reason(text, attribute)
                or f"the condition '{text[:60]}' does not compare a field with a number"
            )
            raise Refused(where, f"{where.id[:60]}: {why}")
        return found

    def _present(self, attribute: Attribute, *, is_open: bool) -> dict[str, Value]:
        """The keys that say where a field is present. Raises Refused."""
        found: dict[str, Value] = {}
        text = attribute.text("if")
        for choice, numbers in attribute.given:
            found |= self._choices.condition(choice, numbers)
            if choice.text("if"):
                found |= self._stated(choice.text("if"), choice, attribute)
        if text and _MORE.fullmatch(text.strip().removeprefix("(").removesuffix(")")):
            # A field that takes the rest may be empty.
            return {"if": found} if found else {} if is_open else {"optional": True}
        if text:
            found |= self._stated(text, attribute, attribute)
        (name, value), *others = found.items() if found else [("", None)]
        if value is True and not others:
            return {"if": name}
        return {"if": found} if found else {}

    def _tested(self, path: str) -> Tested | None:
        limits = self._lookup.limits(path)
        if limits is None:
            return None
        called = self._called[path]

        def bit(first: int, last: int) -> str | None:
            return self._runs.get((path, first, last))

        return Tested(called, limits, bit_width(self._lookup.known[path].type) == 1, bit)

    # Bits -----------------------------------------------------------------------------------------------

    def _bit(self, attribute: Attribute, width: int) -> None:
        if self._bits.attributes:
            last, _ = self._bits.attributes[-1]
            if _place(last) != _place(attribute):
                self._end_bits()
        if self._bits.width + width > 64:
            raise Refused(
                attribute, f"{attribute.id[:60]}: bits that end more than 64 bits after whole bytes"
            )
        self._bits.attributes.append((attribute, width))
        if self._bits.width % 8 == 0:
            self._end_bits()

    def _end_bits(self) -> None:
        bits, self._bits = self._bits, _Bits()
        if not bits.attributes:
            return
        size = -(-bits.width // 8)
        first, _ = bits.attributes[0]
        little = bit_order(first.type, first.scope.bit_endian) == "le"
        keys: dict[str, Value] = {}
        if size > 1 and self._shared.order != ("little" if little else "big"):
            keys["byteorder"] = "little" if little else "big"
        present = self._present(first, is_open=False)
        if len(bits.attributes) == 1 and bits.width % 8 == 0:
            keys |= {**valid(first, (0, (1 << bits.width) - 1)), **self._counts.keys(first), **present}
            type_ = self._shared.enums.of(first, f"u{bits.width}")
            if not keys and _SPARE.fullmatch(first.id) and type_ == f"u{bits.width}":
                keys = {"reserved": True}
            self._fields.append(Field(self._called[first.path], type_, first.line, keys, first.doc))
            return
        at, inside = 0, dict[str, Value]()
        for attribute, width in bits.attributes:
            low = at if little else 8 * size - at - width
            at += width
            if not _SPARE.fullmatch(attribute.id):
                inside[self._called[attribute.path]] = self._bit_keys(attribute, low, width)
        self._integers += 1
        name = self._names.take("bits" if self._integers == 1 else f"bits_{self._integers}", first.line)
        keys |= {"bits": inside} if inside else {"reserved": True}
        self._fields.append(Field(name, f"u{8 * size}", first.line, keys | present))

    def _bit_keys(self, attribute: Attribute, low: int, width: int) -> Value:
        at: Value = low if width == 1 else Notation(f"{low}..{low + width - 1}")
        keys: dict[str, Value] = {"at": at}
        type_ = self._shared.enums.of(attribute, f"u{width}")
        if type_ != f"u{width}":
            keys["type"] = type_
        if width > 1:
            stated = valid(attribute, (0, (1 << width) - 1))
            keys |= {key: each for key, each in stated.items() if key == "range"}
        if attribute.doc:
            keys["doc"] = attribute.doc
        return keys if len(keys) > 1 else at


def _place(attribute: Attribute) -> object:
    """What bits of one integer have in common."""
    order = bit_order(attribute.type, attribute.scope.bit_endian)
    return attribute.within, attribute.text("if"), attribute.given, order


def _bits_name(of: str, first: int, last: int) -> str:
    return f"{of}_{first}" if first == last else f"{of}_{first}_{last}"


def is_open(fields: Sequence[Field]) -> bool:
    """Whether the size of fields follows from nothing that they state."""
    counted: set[str] = set()
    for each in fields:
        counts = each.keys.get("counts")
        counted.update(str(name) for name in (counts if isinstance(counts, list) else [counts]))
    return any(
        each.keys.keys() & {"optional", "terminator"}
        or (each.name not in counted and "last" not in each.keys and _takes_rest(each))
        for each in fields
    )


def _takes_rest(each: Field) -> bool:
    return each.type in ("bytes", "text") or each.type.endswith("[]") or each.keys.get("default") == "bytes"
