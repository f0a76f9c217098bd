"""Fields that say how many bytes or items others have: the codec fills them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from qlinkgen.importers.document import Value
from qlinkgen.importers.ksy.expressions import Count, count, parsed
from qlinkgen.importers.ksy.flat import Group
from qlinkgen.importers.ksy.lookup import Lookup
from qlinkgen.importers.ksy.scalars import bit_width
from qlinkgen.importers.ksy.sizes import bits_of
from qlinkgen.importers.ksy.tree import Attribute, Refused

#: Bytes of other fields that a count may include.
_MOST_AROUND: Final = 64


class Counts:
    """The counts of a sequence.

    Args:
        lookup: Its fields.
        groups: Records in a number of bytes.
        called: Names of the fields by path.

    Raises:
        Refused: a number of bytes or items cannot be stated.
    """

    def __init__(self, lookup: Lookup, groups: Sequence[Group], called: Mapping[str, str]) -> None:
        self._lookup = lookup
        self._called = called
        self._keys: dict[str, dict[str, Value]] = {}
        self._listed = list(lookup.known.values())
        for each in self._listed:
            if each.text("size"):
                self._size(each, [each])
            if each.text("repeat-expr"):
                self._items(each)
        for group in groups:
            self._group(group)

    def keys(self, attribute: Attribute) -> dict[str, Value]:
        """The keys of a field that counts others; none for other fields."""
        return dict(self._keys.get(attribute.path, {}))

    def has(self, attribute: Attribute) -> bool:
        """Whether a field counts others."""
        return attribute.path in self._keys

    def _counter(self, text: str, attribute: Attribute, first: Attribute) -> Count | int:
        found = count(self._lookup.expression(text, attribute, first))
        if isinstance(found, int):
            return found
        if found is None:
            why = self._lookup.reason(text, attribute, first) or f"'{text[:60]}' is not a field or number"
            raise Refused(attribute, f"{attribute.id[:60]}: {why}")
        if self._lookup.integer(found.name) is None or found.name in self._keys:
            raise Refused(attribute, f"{attribute.id[:60]}: {text[:60]} is not an earlier integer of its own")
        if found.scale != 1:
            raise Refused(attribute, f"{attribute.id[:60]}: '{text[:60]}' is not a number of items")
        return found

    def _size(self, attribute: Attribute, members: Sequence[Attribute]) -> None:
        text = attribute.text("size")
        if self._is_rest(text, members):
            return
        found = self._counter(text, attribute, members[0])
        if isinstance(found, int):
            return
        if attribute.text("repeat"):
            raise Refused(attribute, f"{attribute.id[:60]}: repeated, each of {text[:60]} bytes")
        counter = self._lookup.known[found.name]
        listed = around(self._listed, members, -found.offset, counter)
        if listed is None:
            raise Refused(attribute, f"{attribute.id[:60]}: no fields beside it make up {text[:60]}")
        names = [self._called[each.path] for each in listed]
        if len(names) > 1:
            self._keys[found.name] = {"counts": list(names)}
        elif listed[0].text("repeat"):
            self._keys[found.name] = {"counts": names[0], "counts_in": "bytes"}
        else:
            self._keys[found.name] = {"counts": names[0]}

    def _is_rest(self, text: str, members: Sequence[Attribute]) -> bool:
        """Whether a size is that of what the other fields leave."""
        found = count(parsed(text))
        if found != Count("_io.size", 1, found.offset if isinstance(found, Count) else 0):
            return False
        paths = {each.path for each in members}
        others = [_bytes(each) for each in self._listed if each.path not in paths]
        return None not in others and sum(each or 0 for each in others) == -found.offset

    def _group(self, group: Group) -> None:
        size = parsed(group.holder.text("size"))
        if not group.members:
            raise Refused(group.holder, f"{group.holder.id[:60]}: a type without fields in a number of bytes")
        bits = [bits_of(each) for each in group.members]
        known = sum(each or 0 for each in bits)
        found = count(size)
        if isinstance(found, int):
            if None in bits or known != 8 * found:
                raise Refused(group.holder, f"{group.holder.id[:60]}: its fields do not have {found} bytes")
            return
        if None not in bits:
            what = f"a field counts the bytes of {group.holder.id[:60]}, which are always {known // 8}"
            raise Refused(group.holder, what)
        self._size(group.holder, group.members)

    def _items(self, attribute: Attribute) -> None:
        found = self._counter(attribute.text("repeat-expr"), attribute, attribute)
        if isinstance(found, int):
            return
        if found.offset:
            text = attribute.text("repeat-expr")
            raise Refused(attribute, f"{attribute.id[:60]}: '{text[:60]}' is not a number of items")
        self._keys[found.name] = {"counts": self._called[attribute.path]}


def around(
    listed: Sequence[Attribute], members: Sequence[Attribute], size: int, counter: Attribute
) -> list[Attribute] | None:
    """Fields in a row that are some, and others beside them of a size together; None if there are none.

    Which ones makes no difference if their size is the same; those between the count and what it counts come
    first, and those before the count last.

    Args:
        listed: All fields.
        members: Those that are counted in any case, in a row.
        size: Bytes of the others.
        counter: The field that counts them.
    """
    paths = [each.path for each in listed]
    at, end = paths.index(members[0].path), paths.index(members[-1].path) + 1
    after = paths.index(counter.path) + 1
    if not 0 <= size <= _MOST_AROUND:
        return None
    for begin in (*range(after, at + 1), *reversed(range(after))):
        beside = list(listed[begin:at])
        for last in range(end, len(listed) + 1):
            sizes = [_bytes(each) for each in (*beside, *listed[end:last])]
            if None in sizes:
                break
            if sum(each or 0 for each in sizes) == size:
                return [*beside, *members, *listed[end:last]]
    return None


def _bytes(attribute: Attribute) -> int | None:
    """Whole bytes of a field; None if it has bits, or varies."""
    bits = bits_of(attribute)
    return None if bits is None or attribute.given or bit_width(attribute.type) is not None else bits // 8
