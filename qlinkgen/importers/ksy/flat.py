"""Divides records that a schema cannot nest: their fields are in their place."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from qlinkgen.importers.ksy.scalars import bit_width, scalar
from qlinkgen.importers.ksy.sizes import bits_of
from qlinkgen.importers.ksy.tree import Attribute, Type

_DEEPEST: Final = 10


@dataclass(frozen=True, slots=True)
class Group:
    """The fields of a record that is in a number of bytes."""

    holder: Attribute
    members: tuple[Attribute, ...]


@dataclass
class Flat:
    """A sequence without the records that a schema cannot nest.

    Attributes:
        records: The records that are divided, by path.
        groups: Those of them with a size.
    """

    attributes: list[Attribute] = field(default_factory=list)
    records: dict[str, Type] = field(default_factory=dict)
    groups: list[Group] = field(default_factory=list)


def flat(type_: Type, within: tuple[str, ...] = (), *, levels: int = 1) -> Flat:
    """The sequence of a type.

    Args:
        type_: The type.
        within: The fields in whose place it is.
        levels: How many levels of records may be inside.
    """
    found = Flat(records={".".join(within): type_})
    _walk(type_, within, found, levels)
    return found


def record_of(attribute: Attribute) -> Type | None:
    """The type of a record or of several; None for other attributes."""
    text = attribute.type
    if not text or attribute.trouble or attribute.node.get("contents") is not None:
        return None
    if scalar(text, "le") is not None or bit_width(text) is not None:
        return None
    return attribute.scope.find_type(text)


def _walk(type_: Type, within: tuple[str, ...], found: Flat, levels: int) -> None:
    for each in type_.attributes:
        attribute = replace(each, within=within)
        inner = record_of(each) if each.single and not each.text("terminator") else None
        if inner is None or len(within) >= _DEEPEST:
            found.attributes.append(attribute)
            continue
        kept = (
            len(type_.attributes) > 1
            and len(inner.attributes) > 1
            and each.id not in type_.referenced
            and not each.text("size")
            and _is_plain(inner, levels)
        )
        if kept:
            found.attributes.append(attribute)
            continue
        found.records[attribute.path] = inner
        start = len(found.attributes)
        _walk(inner, (*within, each.id), found, levels)
        members = found.attributes[start:]
        if len(members) == 1 and len(type_.attributes) > 1:
            members = [replace(members[0], label=each.id)]
            found.attributes[start:] = members
        if each.text("size"):
            found.groups.append(Group(attribute, tuple(members)))


def _is_plain(type_: Type, levels: int) -> bool:
    """Whether a record has a fixed size and few records inside."""
    if not levels:
        return False
    for each in type_.attributes:
        inner = record_of(each)
        if (
            not each.single
            or bits_of(each) is None
            or (inner is not None and not _is_plain(inner, levels - 1))
        ):
            return False
    return True


def label(attributes: list[Attribute]) -> None:
    """Tells fields of different records apart by the names of the records."""
    for _ in range(2):
        times = Counter(each.label or each.id for each in attributes)
        for at, each in enumerate(attributes):
            called = each.label or each.id
            if times[called] > 1 and each.within and not called.startswith(f"{each.within[-1]}_"):
                attributes[at] = replace(each, label=f"{each.within[-1]}_{called}")


def resolved(text: str, within: Sequence[str], known: Mapping[str, object]) -> str | None:
    """The path of a name in an expression of a field; None if it is outside of the sequence."""
    parts = text.split(".")
    place = list(within)
    if parts[0] == "_root":
        parts, place = parts[1:], []
    while parts and parts[0] == "_parent":
        if not place:
            return None
        parts, place = parts[1:], place[:-1]
    path = ".".join((*place, *parts))
    return path if path in known else None
