"""Names in generated modules, chosen so that no name of a schema can hide one that the code itself uses.

Locals made of a schema's names end in ``_raw``, ``_count``, ``_odd`` or ``_whole``; no others do.
Whatever is private in a class begins with an underscore, which no name of a schema can.
"""

from __future__ import annotations

import builtins
import keyword
import re
from collections.abc import Iterable, Mapping

from qlinkgen.model.naming import pascal
from qlinkgen.model.types import Enum, Flags
from qlinkgen.plan.tree import MessagePlan, Plan

#: Attributes of every message, and what its methods call it.
_METHODS = frozenset({"to_frame", "to_bytes", "from_bytes", "from_checked", "measure_payload", "self", "cls"})
#: Names that a module has for itself.
_TAKEN = frozenset(
    """Message Request Response StreamDecoder Command Counters Fault CodecError EncodeError DecodeError Codec
    Bus OpenEnum BaseMessage Constant Count DecimalScale Items Mask Octets OutOfRange Scale Text Whole Marking
    Struct Decimal Self Any Callable BytesLike ClassVar Final Literal LayoutError Checksum""".split()  # noqa: SIM905
)


def attribute(name: str) -> str:
    """The attribute of a field: its name, with an underscore where that has another meaning."""
    return f"{name}_" if keyword.iskeyword(name) or name in _METHODS else name


def class_name(message: MessagePlan) -> str:
    """Name of a message's class."""
    name = pascal(message.name)
    return f"{name}_" if name in _TAKEN or name in dir(builtins) else name


def constant_classes(plan: Plan) -> Mapping[str, str]:
    """Class of each enum and flags; one whose name a message has is told apart by what it is."""
    messages = {class_name(message) for message in plan.messages}
    groups: list[Enum | Flags] = [*plan.protocol.enums, *plan.protocol.flags]
    return {each.name: _constant_class(each, messages) for each in groups}


def _constant_class(each: Enum | Flags, messages: Iterable[str]) -> str:
    name = pascal(each.name)
    if name in messages or name in _TAKEN or name in dir(builtins):
        return f"{name}{'Enum' if isinstance(each, Enum) else 'Flags'}"
    return name


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
