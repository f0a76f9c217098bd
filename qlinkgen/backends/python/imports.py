"""What a module has to import: exactly the names that its text uses."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

#: Names of the support module that every module passes on.
PUBLIC = ("Bus", "CodecError", "Command", "Counters", "DecodeError", "EncodeError", "Fault")

_SUPPORT = (
    "BaseMessage", "MISFITS", "Misfit", "OutOfRange", "REFUSALS", "UNREADABLE", "as_bytes", "illegal",
    "settled", "wrong_size",
)  # fmt: skip
#: Names that are plain words as well: used only where they are called.
_CALLED = (
    "Constant", "Count", "DecimalSteps", "Items", "Marking", "Mask", "Octets", "Steps", "Text", "Whole",
    "crc", "find_crc", "refused", "sum_of",
)  # fmt: skip


def imports(text: str, *, enums: bool, flags: bool) -> dict[str, Any]:
    """Names for the head of a module whose other parts are given; enums and flags are not in the text."""
    words = set(re.findall(r"(?<![.\w])[A-Za-z_]\w*\(?", text))

    def used(names: Iterable[str]) -> list[str]:
        return [name for name in names if name in words or f"{name}(" in words]

    def called(names: Iterable[str]) -> list[str]:
        return [name for name in names if f"{name}(" in words]

    typing = set(used(("Any", "ClassVar", "Literal", "Self")))
    typing |= ({"ClassVar"} if enums else set()) | ({"Final"} if flags else set())
    support = {*used(_SUPPORT), *called(_CALLED), *PUBLIC, *(["OpenEnum", "named"] if enums else [])}
    return {
        "structs": ", ".join(called(("Struct", "pack", "unpack", "unpack_from"))),
        "indexes": bool(called(("index",))),
        "decimals": bool(used(("Decimal",))),
        "used": used(("struct_error", "Callable")),
        "typing": ", ".join(sorted(typing)),
        "support": sorted(support, key=str.lower),
    }
