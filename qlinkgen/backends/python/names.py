"""Names in generated modules, chosen so that names of a schema cannot hide names of generated code.

Only locals derived from names of a schema end in ``_raw``, ``_count``, ``_odd`` or ``_whole``. Private names
of a class begin with an underscore, which names of a schema cannot.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from qlinkgen.model import naming
from qlinkgen.model.fields import Layout
from qlinkgen.model.types import Enum, Flags
from qlinkgen.plan.payload import Holder, Step, value_name
from qlinkgen.plan.tree import MessagePlan, Plan

#: The attribute of a field.
attribute = naming.attribute


def held(each: Holder | Step) -> str:
    """The attribute that holds the value of a field."""
    return attribute(value_name(each))


def source_of(each: Holder | Step) -> str:
    """The expression for a value to encode: a choice is a local, which has no type."""
    return f"{value_name(each)}_whole" if each.presence and each.presence.slot else f"self.{held(each)}"


def class_name(message: MessagePlan) -> str:
    """Name of the class of a message."""
    return naming.message_class(message.name)


def named_classes(plan: Plan) -> Mapping[str, str]:
    """Class of each enum, flags and record; its kind is appended if a message has the same name."""
    messages = frozenset(class_name(message) for message in plan.messages)
    groups: list[Enum | Flags | Layout] = [*plan.protocol.enums, *plan.protocol.flags, *plan.layouts]
    return {each.name: naming.constant_class(each.name, each.kind, messages) for each in groups}


def constant_name(name: str) -> str:
    """The part of names of constants for a message or type."""
    return name.replace(".", "_").upper()


def natural(name: str) -> tuple[tuple[str, int], ...]:
    """Key for natural sorting, digits by value; the order that ``ruff`` requires for slots."""
    parts = re.findall(r"([^0-9]*)([0-9]*)", name)
    return tuple((text, int(digits or -1)) for text, digits in parts)


def imported(name: str) -> tuple[int, tuple[tuple[str, int], ...]]:
    """Key for sorting imports as required by ``ruff``: as `by_kind`, ignoring case inside a name."""
    return by_kind(name)[0], natural(name.lower())


def by_kind(name: str) -> tuple[int, tuple[tuple[str, int], ...]]:
    """Key for sorting ``__all__`` as required by ``ruff``: constants, classes, functions."""
    bare = name.lstrip("_")
    kind = 0 if bare.isupper() and len(bare) > 1 else 1 if bare[:1].isupper() else 2
    return kind, natural(name)
