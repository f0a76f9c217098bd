"""Makes the keys of a field of the cells about its values: scale, unit, range, default, names."""

from __future__ import annotations

import re
from fractions import Fraction

from qlinkgen.importers import cells
from qlinkgen.importers.document import Notation, Value
from qlinkgen.importers.notes import Notes
from qlinkgen.importers.table.columns import Record
from qlinkgen.importers.table.enums import Enums
from qlinkgen.importers.table.kinds import Kind

_INTEGER = re.compile(r"(?P<sign>[ui])(?P<bits>\d+)")
_ORDERS = {
    "big": "big", "be": "big", "msb": "big", "motorola": "big", "bigendian": "big", "network": "big",
    "little": "little", "le": "little", "lsb": "little", "intel": "little", "littleendian": "little",
}  # fmt: skip


def limits(type_: str) -> tuple[int, int] | None:
    """Least and greatest value of an integer type, None for other types."""
    found = _INTEGER.fullmatch(type_)
    if found is None:
        return None
    bits = int(found["bits"])
    return (0, (1 << bits) - 1) if found["sign"] == "u" else (-(1 << (bits - 1)), (1 << (bits - 1)) - 1)


def byteorder(text: str) -> str:
    """``big`` or ``little`` as people write it, empty for anything else."""
    return _ORDERS.get(re.sub(r"[^a-z]", "", text.lower().removesuffix(" first")), "")


class Values:
    """The values of the fields of a message.

    Args:
        order: Byte order of the schema.
    """

    def __init__(self, message: str, notes: Notes, enums: Enums, order: str) -> None:
        self._message = message
        self._notes = notes
        self._enums = enums
        self._order = order

    def keys(self, record: Record, found: Kind, type_: str, name: str) -> tuple[str, dict[str, Value]]:
        """The type of a field, which is an enum if its values have names, and its keys."""
        keys: dict[str, Value] = {}
        whole = limits(type_)
        order = found.order or byteorder(record.get("byteorder"))
        if order and order != self._order and found.size > 1:
            keys["byteorder"] = order
        named = self._named(record) if whole is not None else []
        scaled = {} if named else self._scaled(record, whole, type_)
        keys |= scaled
        if named and whole is not None:
            type_ = self._enum(named, type_, whole, name, record)
        if record.get("unit") and not cells.is_nothing(record.get("unit")) and not named:
            keys["unit"] = record.get("unit")
        if found.count is None and not named:
            keys |= self._float(record) if found.base == "f" else self._range(record, whole, scaled)
        if found.count is None and found.base != "f":
            keys |= self._fixed(record, whole, scaled, named)
        if found.base == "text" and found.count:
            keys["pad"] = Notation("00")
        if record.get("section"):
            keys["section"] = record.get("section")
        return type_, keys

    def bit(self, record: Record, first: int, last: int, name: str) -> Value:
        """The value of a bit field."""
        width = last - first + 1
        at: Value = first if width == 1 else Notation(f"{first}..{last}")
        keys: dict[str, Value] = {}
        named = self._named(record)
        whole = (0, (1 << width) - 1)
        if named:
            # One bit with the usual two names is a truth value.
            if width > 1:
                keys["type"] = self._enum(named, f"u{width}", whole, name, record)
        elif width > 1:
            scaled = self._scaled(record, whole, "u")
            keys |= scaled
            if record.get("unit") and not cells.is_nothing(record.get("unit")):
                keys["unit"] = record.get("unit")
            keys |= self._range(record, whole, scaled)
        doc = record.get("doc")
        if named and width == 1:
            doc = f"{doc} ({record.get('values')})".strip()
        if doc:
            keys["doc"] = doc
        return {"at": at, **keys} if keys else at

    # Names ----------------------------------------------------------------------------------------------

    def _named(self, record: Record) -> list[tuple[int, str]]:
        text = record.get("values")
        if not text or cells.is_nothing(text):
            return []
        found = cells.named_values(text)
        if len(found) == 0:
            self._notes.add(record.line, f"values '{text[:40]}' are not understood; write 0=off, 1=on")
        return found

    def _enum(
        self, named: list[tuple[int, str]], type_: str, whole: tuple[int, int], name: str, record: Record
    ) -> str:
        fitting = [each for each in named if whole[0] <= each[0] <= whole[1]]
        for number, label in named:
            if (number, label) not in fitting:
                self._notes.add(
                    record.line, f"value {number} '{label[:40]}' is left out: it does not fit {type_}"
                )
        if not fitting:
            return type_
        return self._enums.take(fitting, type_, (name, f"{self._message}_{name}"), record.line)

    # Numbers --------------------------------------------------------------------------------------------

    def _scaled(self, record: Record, whole: tuple[int, int] | None, type_: str) -> dict[str, Value]:
        keys: dict[str, Value] = {}
        for key, called in (("scale", "scale"), ("bias", "offset")):
            text = record.get(key)
            if not text or cells.is_nothing(text):
                continue
            value = cells.number(text)
            if value is None or (key == "scale" and value == 0):
                self._notes.add(record.line, f"{key} '{text[:40]}' is not a number and left out")
            elif value == (1 if key == "scale" else 0):
                continue
            elif whole is None:
                self._notes.add(record.line, f"{key} {text[:40]} is left out: {type_} has none")
            else:
                keys[called] = Notation(cells.spelt(value))
        return keys

    def _raw(self, value: Fraction, scaled: dict[str, Value]) -> Fraction:
        scale, bias = (_fraction(scaled.get(key), other) for key, other in (("scale", 1), ("offset", 0)))
        return (value - bias) / scale

    def _float(self, record: Record) -> dict[str, Value]:
        """Range and default of a floating-point number."""
        keys: dict[str, Value] = {}
        ends = cells.bounds(record.get("range") or f"{record.get('min')} .. {record.get('max')}")
        if ends is not None and all(map(cells.has_decimals, ends)):
            keys["range"] = Notation(f"{cells.decimal(ends[0])}..{cells.decimal(ends[1])}")
        default = cells.number(record.get("default"))
        if default is not None and cells.has_decimals(default):
            keys["default"] = Notation(cells.decimal(default))
        return keys

    def _range(
        self, record: Record, whole: tuple[int, int] | None, scaled: dict[str, Value]
    ) -> dict[str, Value]:
        if whole is None:
            return {}
        found = self._bounds(record, whole, scaled)
        if found is None:
            return {}
        raw = sorted(self._raw(each, scaled) for each in found)
        if any(each.denominator != 1 for each in raw) or raw[0] < whole[0] or raw[1] > whole[1]:
            text = f"range {cells.spelt(found[0])}..{cells.spelt(found[1])}"
            self._notes.add(record.line, f"{text} is left out: the field cannot have these values exactly")
            return {}
        if raw[0] == whole[0] and raw[1] == whole[1]:
            return {}
        return {"range": Notation(f"{cells.spelt(found[0])}..{cells.spelt(found[1])}")}

    def _bounds(
        self, record: Record, whole: tuple[int, int], scaled: dict[str, Value]
    ) -> tuple[Fraction, Fraction] | None:
        """Least and greatest value of a field, as the table states them."""
        text = record.get("range")
        if text and not cells.is_nothing(text):
            if (found := cells.bounds(text)) is not None:
                return found
            self._notes.add(record.line, f"range '{text[:40]}' is not understood; write 0..100")
        scale, bias = (_fraction(scaled.get(key), other) for key, other in (("scale", 1), ("offset", 0)))
        ends = sorted(each * scale + bias for each in whole)
        stated = 0
        for at, key in enumerate(("min", "max")):
            text = record.get(key)
            if text and not cells.is_nothing(text):
                value = cells.number(text)
                if value is None:
                    self._notes.add(record.line, f"{key} '{text[:40]}' is not a number and left out")
                else:
                    ends[at] = value
                    stated += 1
        if ends[0] > ends[1]:
            self._notes.add(record.line, "min is greater than max; both are left out")
            return None
        return (ends[0], ends[1]) if stated else None

    def _fixed(
        self,
        record: Record,
        whole: tuple[int, int] | None,
        scaled: dict[str, Value],
        named: list[tuple[int, str]],
    ) -> dict[str, Value]:
        """Constant and default."""
        for key in ("const", "default"):
            text = record.get(key)
            if not text or cells.is_nothing(text):
                continue
            value = self._value(text, whole, scaled, named)
            if value is None:
                self._notes.add(record.line, f"{key} '{text[:40]}' is left out: not a value of this field")
            else:
                return {key: value}
        return {}

    def _value(
        self,
        text: str,
        whole: tuple[int, int] | None,
        scaled: dict[str, Value],
        named: list[tuple[int, str]],
    ) -> Value | None:
        if whole is None:
            return None
        by_label = {label.strip().lower(): each for each, label in named}
        number = Fraction(by_label[text.lower()]) if text.lower() in by_label else cells.number(text)
        if number is None:
            return None
        raw = self._raw(number, scaled)
        if raw.denominator != 1 or not whole[0] <= raw <= whole[1]:
            return None
        if text.lower().startswith("0x") and number.denominator == 1:
            return Notation(f"0x{int(number):0{len(text) - 2}X}")
        if number.denominator == 1:
            return int(number)
        return Notation(cells.decimal(number)) if cells.has_decimals(number) else None


def _fraction(value: Value | None, otherwise: int) -> Fraction:
    return Fraction(value.text) if isinstance(value, Notation) else Fraction(otherwise)
