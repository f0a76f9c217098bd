"""Finds the frame in the outermost sequence of a file: a choice by an earlier field is the payload."""

from __future__ import annotations

from dataclasses import dataclass, field

from qlinkgen.importers import cells
from qlinkgen.importers.document import Notation, Value, between, hexadecimal
from qlinkgen.importers.ksy.blobs import contents
from qlinkgen.importers.ksy.counts import around
from qlinkgen.importers.ksy.enums import number_of
from qlinkgen.importers.ksy.expressions import Count, Name, count
from qlinkgen.importers.ksy.flat import flat, label
from qlinkgen.importers.ksy.lookup import Lookup
from qlinkgen.importers.ksy.scalars import Scalar, bit_order, bit_width, scalar
from qlinkgen.importers.ksy.sizes import bits_of
from qlinkgen.importers.ksy.tree import Attribute, Refused, Type
from qlinkgen.importers.ksy.valid import valid
from qlinkgen.importers.names import Names
from qlinkgen.importers.notes import Notes

#: Greatest payload where the file does not limit it.
LARGEST = 1024
_CHECKS = ("crc", "checksum", "chksum", "lrc", "fcs")
_MOST_NESTED = 10
#: Bytes of the largest part without a type.
_MOST_BYTES = 8


@dataclass
class Framed:
    """A frame and its messages.

    Attributes:
        parts: The parts of the frame.
        messages: Id, name and type of each message.
    """

    parts: dict[str, Value] = field(default_factory=dict)
    messages: list[tuple[Value, str, Type]] = field(default_factory=list)


def stream_of(root: Type, notes: Notes) -> Type:
    """The type that a file repeats to its end, else the file itself."""
    inside = root
    for _ in range(_MOST_NESTED):
        only = inside.attributes[0] if len(inside.attributes) == 1 else None
        inner = inside.find_type(only.type) if only and only.type else None
        if only is None or inner is None or only.text("repeat") != "eos" or only.trouble:
            break
        notes.add(only.line, f"the file is a row of {inner.name[:60]}: each one is a frame")
        inside = inner
    return inside


def framed(inside: Type, notes: Notes) -> Framed | None:
    """The frame of a sequence with one choice by an earlier number; None for other sequences.

    Raises:
        Refused: a part of the frame cannot be taken.
    """
    framer = _Framer(inside, notes)
    return framer.framed() if framer.decides else None


class _Framer:
    """Makes the parts of a frame.

    Attributes:
        decides: Whether a number before the choice decides it.
    """

    def __init__(self, inside: Type, notes: Notes) -> None:
        found = flat(inside, levels=0)
        label(found.attributes)
        self._listed = found.attributes
        self._groups = found.groups
        self._notes = notes
        self._little = inside.endian == "le"
        self._lookup = Lookup({each.path: each for each in self._listed}, found.records)
        choices = [each for each in self._listed if each.switch is not None]
        self.decides = False
        if len(choices) != 1 or not choices[0].single:
            return
        self._choice = choices[0]
        assert self._choice.switch is not None
        self._switch = self._choice.switch
        on = self._lookup.expression(self._switch.text("switch-on"), self._choice)
        self._on = on.text if isinstance(on, Name) else ""
        decider = self._lookup.known.get(self._on)
        self.decides = (
            decider is not None and decider.single and (self._lookup.limits(self._on) or (-1, 0))[0] == 0
        )

    def framed(self) -> Framed | None:
        """The frame, None without messages. Raises Refused."""
        names = Names(self._notes, "part")
        self._called = {each.path: names.take(each.label or each.id, each.line) for each in self._listed}
        self._length = self._counted()
        parts: dict[str, Value] = {}
        at = 0
        while at < len(self._listed):
            each = self._listed[at]
            bits = self._row(at) if bit_width(each.type) is not None else []
            if len(bits) > 1 or sum(width for _, width in bits) % 8:
                name = names.take("bits", each.line)
                parts[name] = self._bits(bits)
            else:
                parts[self._called[each.path]] = self._part(each)
            at += len(bits) or 1
        messages = self._messages()
        return Framed(parts, messages) if messages else None

    def _counted(self) -> tuple[Count, list[Attribute]] | None:
        """The length, and what it counts. Raises Refused."""
        holder, members = self._choice, [self._choice]
        for group in self._groups:
            if any(each.path == self._choice.path for each in group.members) and not holder.text("size"):
                holder, members = group.holder, list(group.members)
        text = holder.text("size")
        if not text:
            return None
        found = count(self._lookup.expression(text, holder, members[0]))
        if not isinstance(found, Count):
            why = self._lookup.reason(text, holder, members[0]) or f"the size '{text[:60]}' is not a field"
            raise Refused(holder, f"{holder.id[:60]}: {why}")
        return found, members

    def _largest(self) -> int:
        """The largest payload that the length can state."""
        if self._length is None:
            return LARGEST
        length, members = self._length
        limits = self._lookup.limits(length.name)
        if limits is None:
            return LARGEST
        others = sum(bits_of(each) or 0 for each in members if each is not self._choice) // 8
        return max(0, min(LARGEST, limits[1] * length.scale + length.offset - others))

    def _row(self, at: int) -> list[tuple[Attribute, int]]:
        """Bits in a row, up to whole bytes."""
        first = self._listed[at]
        row: list[tuple[Attribute, int]] = []
        for each in self._listed[at:]:
            width = bit_width(each.type)
            if width is None or not each.single or each.within != first.within:
                break
            row.append((each, width))
            if sum(width for _, width in row) % 8 == 0:
                break
        return row

    def _bits(self, row: list[tuple[Attribute, int]]) -> Value:
        """An integer of bits."""
        size = -(-sum(width for _, width in row) // 8)
        if size > _MOST_BYTES:
            first = row[0][0]
            raise Refused(first, f"{first.id[:60]}: bits that end more than 64 bits after whole bytes")
        little = bit_order(row[0][0].type, row[0][0].scope.bit_endian) == "le"
        keys: dict[str, Value] = {"type": f"u{8 * size}"}
        if size > 1 and little != self._little:
            keys["byteorder"] = "little" if little else "big"
        at, inside = 0, dict[str, Value]()
        for attribute, width in row:
            low = at if little else 8 * size - at - width
            at += width
            place: Value = low if width == 1 else between(low, low + width - 1)
            if attribute.path == self._on:
                place = {"at": place, "role": "message"}
            elif self._length is not None and attribute.path == self._length[0].name:
                raise Refused(attribute, f"{attribute.id[:60]}: a length of {width} bits among others")
            inside[self._called[attribute.path]] = place
        return {**keys, "bits": inside}

    def _part(self, attribute: Attribute) -> Value:
        if attribute is self._choice:
            return {"role": "payload", "size": between(0, self._largest())}
        if attribute.trouble:
            raise Refused(attribute, f"{attribute.id[:60]}: {attribute.trouble}")
        if attribute.node.get("contents") is not None:
            return Notation(contents(attribute).hex(" ").upper())
        found = self._integer(attribute)
        keys: dict[str, Value] = {"type": found.type}
        if found.order and (found.order == "little") != self._little:
            keys["byteorder"] = found.order
        if attribute.path == self._on:
            keys = {"role": "message", **keys}
        elif self._length is not None and attribute.path == self._length[0].name:
            keys |= self._counting(*self._length, attribute)
        else:
            keys |= self._value(attribute, found)
        return {**keys, "doc": attribute.doc} if attribute.doc else keys

    def _integer(self, attribute: Attribute) -> Scalar:
        """The type of a part. Raises Refused."""
        found = scalar(attribute.type, attribute.scope.endian)
        if found is not None and found.limits and attribute.single:
            return found
        bits = bits_of(attribute)
        if attribute.single and bits and bits <= 8 * _MOST_BYTES and attribute.type in ("", "str", "strz"):
            self._notes.add(
                attribute.line,
                f"{attribute.id[:60]} is a number: no part of a frame is a byte string",
            )
            return Scalar(f"u{bits}", "big" if bits > 8 else "")
        width = bit_width(attribute.type)
        if attribute.single and width is not None and width % 8 == 0:
            little = bit_order(attribute.type, attribute.scope.bit_endian) == "le"
            return Scalar(f"u{width}", "" if width == 8 else "little" if little else "big")
        raise Refused(attribute, f"{attribute.id[:60]}: a part of a frame is an integer or constant bytes")

    def _counting(self, length: Count, members: list[Attribute], attribute: Attribute) -> dict[str, Value]:
        listed = members
        keys: dict[str, Value] = {}
        if length.scale != 1:
            keys["scale"] = length.scale
        if length.offset:
            beside = -length.offset if length.scale == 1 else -1
            found = around(self._listed, members, beside, attribute)
            if found is None:
                keys["offset"] = length.offset
            listed = found or members
        return {"counts": [self._called[each.path] for each in listed], **keys}

    def _value(self, attribute: Attribute, found: Scalar) -> dict[str, Value]:
        if any(word in attribute.id for word in _CHECKS):
            attribute.notes.add(
                attribute.line, f"{attribute.id[:60]} seems to be a check value: add its algorithm"
            )
        stated = valid(attribute, found.limits, in_frame=True)
        return stated if "const" in stated else {"default": 0}

    def _messages(self) -> list[tuple[Value, str, Type]]:
        messages: list[tuple[Value, str, Type]] = []
        for key, value in self._switch.mapping("cases"):
            id_ = number_of(self._choice.scope, key) if "::" in key else cells.integer(key)
            found = self._choice.scope.find_type(value.word) if value.word else None
            if id_ is None or id_ < 0 or found is None:
                what = "what other numbers mean" if key == "_" else f"the case '{key[:60]}'"
                value.notes.add(
                    value.line, f"{what} is left out: a message has a number and a type of this file"
                )
                continue
            called = key.rpartition("::")[2] if "::" in key else found.name.rpartition("::")[2]
            messages.append((hexadecimal(id_) if id_ > 9 else id_, called, found))
        return messages
