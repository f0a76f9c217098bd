"""Finds the frame in the outermost sequence of a file: a choice by an earlier field is the payload."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from qlinkgen.importers import cells
from qlinkgen.importers.document import Notation, Value, between, hexadecimal
from qlinkgen.importers.ksy import expressions
from qlinkgen.importers.ksy.blobs import contents
from qlinkgen.importers.ksy.enums import number_of
from qlinkgen.importers.ksy.scalars import Scalar, scalar
from qlinkgen.importers.ksy.tree import Attribute, Node, Refused, Type
from qlinkgen.importers.ksy.valid import valid
from qlinkgen.importers.names import Names
from qlinkgen.importers.notes import Notes

#: Greatest payload where the file does not limit it.
LARGEST = 1024
_CHECKS = ("crc", "checksum", "chksum", "lrc", "fcs")
_MOST_NESTED = 10
#: Bytes of other parts that a length may count.
_MOST_AROUND = 32


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
    """The frame of a sequence with one choice by an earlier integer; None for other sequences.

    Raises:
        Refused: a part of the frame cannot be taken.
    """
    attributes = _flat(inside)
    choices = [each for each in attributes if each.switch is not None]
    if len(choices) != 1 or choices[0].text("if") or choices[0].text("repeat"):
        return None
    framer = _Framer(inside, attributes, choices[0], notes)
    return framer.framed() if framer.decides else None


def _flat(inside: Type) -> list[Attribute]:
    """The sequence, with the sequence of a header in place of the header."""
    flat: list[Attribute] = []
    on = next((each.switch.text("switch-on") for each in inside.attributes if each.switch is not None), "")
    for each in inside.attributes:
        inner = inside.find_type(each.type) if each.type else None
        if (
            inner is not None
            and on.startswith(f"{each.id}.")
            and not each.text("repeat")
            and not each.text("if")
        ):
            flat += inner.attributes
        else:
            flat.append(each)
    return flat


class _Framer:
    """Makes the parts of a frame.

    Attributes:
        decides: Whether an integer before the choice decides it.
    """

    def __init__(
        self, inside: Type, attributes: Sequence[Attribute], choice: Attribute, notes: Notes
    ) -> None:
        assert choice.switch is not None
        self._inside = inside
        self._attributes = attributes
        self._choice = choice
        self._switch = choice.switch
        self._notes = notes
        self._before = {each.id: each for each in attributes[: attributes.index(choice)]}
        self._on = self._switch.text("switch-on").rpartition(".")[2]
        self.decides = self._on in self._before and self._integer(self._before[self._on]) is not None

    def framed(self) -> Framed | None:
        """The frame, None without messages. Raises Refused."""
        names = Names(self._notes, "part")
        called = {each.id: names.take(each.id, each.line) for each in self._attributes}
        length = self._length()
        parts = {called[each.id]: self._part(each, called, length) for each in self._attributes}
        messages = self._messages()
        return Framed(parts, messages) if messages else None

    def _integer(self, attribute: Attribute) -> Scalar | None:
        found = scalar(attribute.type, self._inside.endian)
        single = not attribute.text("repeat") and not attribute.text("if")
        return found if found and found.limits and single else None

    def _length(self) -> expressions.Count | None:
        text = self._choice.text("size")
        if not text:
            return None
        found = expressions.count(text)
        if not isinstance(found, expressions.Count):
            raise Refused(self._choice.line, f"{self._choice.id[:60]}: the size '{text[:60]}' is not a field")
        name = found.name.rpartition(".")[2]
        if name not in self._before:
            raise Refused(
                self._choice.line, f"{self._choice.id[:60]}: '{name[:60]}' is not a field before it"
            )
        return expressions.Count(name, found.scale, found.offset)

    def _largest(self, length: expressions.Count | None) -> int:
        """The largest payload that the length can state."""
        counter = self._integer(self._before[length.name]) if length else None
        if length is None or counter is None or counter.limits is None:
            return LARGEST
        return max(0, min(LARGEST, counter.limits[1] * length.scale + length.offset))

    def _part(
        self, attribute: Attribute, called: Mapping[str, str], length: expressions.Count | None
    ) -> Value:
        if attribute is self._choice:
            return {"role": "payload", "size": between(0, self._largest(length))}
        if attribute.trouble:
            raise Refused(attribute.line, f"{attribute.id[:60]}: {attribute.trouble}")
        if attribute.node.get("contents") is not None:
            return Notation(contents(attribute).hex(" ").upper())
        found = self._integer(attribute)
        if found is None:
            what = f"{attribute.id[:60]}: a part of a frame is an integer or constant bytes"
            raise Refused(attribute.line, what)
        keys: dict[str, Value] = {"type": found.type}
        if found.order and found.order != ("little" if self._inside.endian == "le" else "big"):
            keys["byteorder"] = found.order
        if attribute.id == self._on:
            keys = {"role": "message", **keys}
        elif length is not None and attribute.id == length.name:
            around = self._around(-length.offset, attribute) if length.scale == 1 else None
            counted = [each.id for each in around or [self._choice]]
            keys |= {"counts": [called[each] for each in counted]}
            keys |= {"scale": length.scale} if length.scale != 1 else {}
            keys |= {"offset": length.offset} if length.offset and around is None else {}
        else:
            keys |= self._value(attribute, found)
        return {**keys, "doc": attribute.doc} if attribute.doc else keys

    def _around(self, size: int, length: Attribute) -> list[Attribute] | None:
        """The payload with parts beside it of a size together, None if there are none.

        A length that is greater than that of the payload counts other parts too, and which ones makes no
        difference if their size is the same.
        """
        at = self._attributes.index(self._choice)
        first = self._attributes.index(length) + 1
        if not 0 < size <= _MOST_AROUND:
            return None
        for begin in range(at, max(first, at - size) - 1, -1):
            for end in range(at + 1, min(len(self._attributes), at + 1 + size) + 1):
                found = self._attributes[begin:end]
                if sum(self._size(each) for each in found) == size:
                    return list(found)
        return None

    def _size(self, attribute: Attribute) -> int:
        """Bytes of a part; the payload has none here."""
        if attribute is self._choice:
            return 0
        if attribute.node.get("contents") is not None:
            return len(contents(attribute))
        found = self._integer(attribute)
        return found.size if found else 0

    def _value(self, attribute: Attribute, found: Scalar) -> dict[str, Value]:
        if any(word in attribute.id for word in _CHECKS):
            self._notes.add(
                attribute.line, f"{attribute.id[:60]} seems to be a check value: add its algorithm"
            )
        stated = valid(attribute, found.limits, self._notes)
        return stated if "const" in stated else {"default": 0}

    def _messages(self) -> list[tuple[Value, str, Type]]:
        messages: list[tuple[Value, str, Type]] = []
        for key, value in (self._switch.get("cases") or Node(None, (), self._switch.source)).items:
            id_ = cells.integer(key)
            id_ = number_of(self._inside, key) if id_ is None else id_
            found = self._inside.find_type(value.word) if value.word else None
            if id_ is None or id_ < 0 or found is None:
                what = "what other numbers mean" if key == "_" else f"the case '{key[:60]}'"
                self._notes.add(
                    value.line, f"{what} is left out: a message has a number and a type of this file"
                )
                continue
            called = key.rpartition("::")[2] if "::" in key else found.name.rpartition("::")[2]
            messages.append((hexadecimal(id_) if id_ > 9 else id_, called, found))
        return messages
