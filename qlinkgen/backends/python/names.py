"""Names in generated modules, chosen so that no name of a schema can hide one that the code itself uses.

Locals made of a schema's names end in ``_raw``, ``_count``, ``_odd`` or ``_whole``; no others do.
Whatever is private in a class begins with an underscore, which no name of a schema can.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from qlinkgen.model import naming
from qlinkgen.model.types import Enum, Flags
from qlinkgen.plan.tree import MessagePlan, Plan

#: The attribute of a field.
attribute = naming.attribute


def class_name(message: MessagePlan) -> str:
    """Name of a message's class."""
    return naming.message_class(message.name)


def constant_classes(plan: Plan) -> Mapping[str, str]:
    """Class of each enum and flags; one whose name a message has is told apart by what it is."""
    messages = frozenset(class_name(message) for message in plan.messages)
    groups: list[Enum | Flags] = [*plan.protocol.enums, *plan.protocol.flags]
    return {each.name: naming.constant_class(each.name, each.kind, messages) for each in groups}


def constant_name(name: str) -> str:
    """A message or type in the names of constants."""
    return name.replace(".", "_").upper()


def natural(name: str) -> tuple[tuple[str, int], ...]:
    """Sorts names as people do, digits by their number; the order that ``ruff`` asks of slots."""
    parts = re.findall(r"([^0-9]*)([0-9]*)", name)
    return tuple((text, int(digits or -1)) for text, digits in parts)


def imported(name: str) -> tuple[int, tuple[tuple[str, int], ...]]:
    """Sorts names as ``ruff`` wants imports: as `by_kind`, but capitals do not matter inside a name."""
    return by_kind(name)[0], natural(name.lower())


def by_kind(name: str) -> tuple[int, tuple[tuple[str, int], ...]]:
    """Sorts names as ``ruff`` wants ``__all__``: constants, classes, functions."""
    bare = name.lstrip("_")
    kind = 0 if bare.isupper() and len(bare) > 1 else 1 if bare[:1].isupper() else 2
    return kind, natural(name)
