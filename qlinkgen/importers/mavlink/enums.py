"""Makes enums and flags of the enums of a dialect, one for each integer type that fields give them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

from qlinkgen.importers.document import Constant, Constants
from qlinkgen.importers.names import Names, without_prefix
from qlinkgen.importers.notes import Notes
from qlinkgen.importers.xml_tree import Element

_NUMBER = re.compile(r"0[xX][0-9a-fA-F]{1,16}|0[bB][01]{1,64}|[0-9]{1,20}|2\*\*(?P<power>[0-9]{1,2})")


class Enums:
    """The enums that fields have.

    Args:
        listed: The elements of each enum of the dialect.
    """

    def __init__(self, listed: Mapping[str, Sequence[tuple[Element, Notes]]], notes: Notes) -> None:
        self._listed = listed
        self._notes = notes
        self._names = Names(notes, "enum", types=True)
        self._made: dict[tuple[str, str], Constants] = {}

    @property
    def enums(self) -> tuple[Constants, ...]:
        """Those whose values are numbers."""
        return tuple(each for each in self._made.values() if each.key == "value")

    @property
    def flags(self) -> tuple[Constants, ...]:
        """Those whose values are bits."""
        return tuple(each for each in self._made.values() if each.key == "bit")

    def unused(self) -> list[str]:
        """The enums that no field has."""
        used = {name for name, _ in self._made}
        return [each for each in self._listed if each not in used]

    def of(self, name: str, type_: str, line: int, notes: Notes) -> str:
        """The type of a field with an enum; its integer type if the enum is not one of the dialect."""
        if name not in self._listed:
            notes.add(line, f"the enum {name[:60]} is not in the dialect; the field is a number")
            return type_
        if (name, type_) not in self._made:
            made = self._make(name, type_)
            if made is None:
                notes.add(line, f"the enum {name[:60]} has no values for {type_}; the field is a number")
                return type_
            self._made[name, type_] = made
        return self._made[name, type_].name

    def _make(self, name: str, type_: str) -> Constants | None:
        elements = self._listed[name]
        first, own = elements[0]
        bits = first.get("bitmask") == "true" and type_.startswith("u")
        width = int(type_[1:])
        values = tuple(self._constants(elements, width - type_.startswith("i"), bits=bits))
        if not values:
            return None
        called = self._names.take(name if not self._is_made(name) else f"{name}_{type_}", first.line, own)
        doc = next((each.text_of("description") for each, _ in elements if each.has("description")), "")
        return Constants(called, type_, values, first.line, doc, "bit" if bits else "value", own)

    def _is_made(self, name: str) -> bool:
        return any(each == name for each, _ in self._made)

    def _constants(
        self, elements: Sequence[tuple[Element, Notes]], width: int, *, bits: bool
    ) -> Iterator[Constant]:
        entries = list(_numbered(elements))
        short = without_prefix([each.get("name") for _, each, _ in entries])
        names = Names(self._notes, "constant")
        seen: set[int] = set()
        for (number, entry, notes), called in zip(entries, short, strict=True):
            why = ""
            if bits:
                why = "" if number > 0 and number & (number - 1) == 0 else "it is not one bit"
                number = number.bit_length() - 1  # noqa: PLW2901
            if not why and number in seen:
                why = "its number has a name already"
            if not why and (number >= width if bits else number >= 1 << width):
                why = f"it does not fit {width} bits"
            if why:
                notes.add(entry.line, f"{entry.get('name')[:60]} is left out: {why}")
                continue
            seen.add(number)
            yield Constant(names.take(called, entry.line, notes), number, described(entry))


def _numbered(elements: Sequence[tuple[Element, Notes]]) -> Iterator[tuple[int, Element, Notes]]:
    """Entries with their numbers; an entry without one follows the greatest before it."""
    greatest = 0
    for enum, notes in elements:
        for entry in enum.all("entry"):
            text = entry.get("value")
            found = _NUMBER.fullmatch(text.strip())
            if not entry.get("name") or (text and found is None):
                notes.add(
                    entry.line, f"an entry of {enum.get('name')[:60]} is left out: its value is '{text[:40]}'"
                )
                continue
            if found and found["power"]:
                number = 1 << int(found["power"])
            else:
                number = int(text, 10 if text.strip().isdecimal() else 0) if text else greatest + 1
            greatest = max(greatest, number)
            yield number, entry, notes


def described(element: Element) -> str:
    """The description of an element, and whether it is deprecated or not finished."""
    parts = [element.text_of("description") or (element.text if element.name == "field" else "")]
    for each in element.all("deprecated"):
        replaced = f", replaced by {each.get('replaced_by')}" if each.get("replaced_by") else ""
        parts.append(
            f"Deprecated since {each.get('since') or 'an unknown date'}{replaced}. {each.text}".strip()
        )
    if element.has("wip"):
        parts.append("Work in progress.")
    return " ".join(filter(None, parts))
