"""Reads the type of a field as people write it: ``u16``, ``unsigned int``, ``WORD``, ``char[8]``."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

Base = Literal["u", "i", "f", "bool", "text", "bytes"]

_COUNT = re.compile(
    r"^(?P<base>.*?)\s*(?:\[\s*(?P<a>\d{1,6}|n)?\s*\]|\(\s*(?P<b>\d{1,6})\s*\)|\s[x*]\s*(?P<c>\d{1,6}))$"
)
_SIZED = re.compile(
    r"(?P<base>u|i|s|f|uint|int|sint|unsigned|signed|unsignedint|signedint|unsignedinteger|signedinteger|integer"
    r"|float|real|bit|bits|bitfield|bitmap|flags|enum)(?P<bits>8|16|24|32|40|48|56|64)(?:bits?|t)?(?P<order>le|be)?"
)
_BASES: Final[Mapping[str, Base]] = {
    **dict.fromkeys(("u", "uint", "unsigned", "unsignedint", "unsignedinteger"), "u"),
    **dict.fromkeys(("bit", "bits", "bitfield", "bitmap", "flags", "enum"), "u"),
    **dict.fromkeys(("i", "s", "int", "sint", "signed", "signedint", "signedinteger", "integer"), "i"),
    **dict.fromkeys(("f", "float", "real"), "f"),
}
#: Types with a size of their own; those of IEC 61131-3 are among them.
_WORDS: Final[Mapping[str, tuple[Base, int]]] = {
    **dict.fromkeys(("byte", "uchar", "unsignedchar", "octet", "usint"), ("u", 1)),
    **dict.fromkeys(("word", "ushort", "unsignedshort"), ("u", 2)),
    **dict.fromkeys(("dword", "udint"), ("u", 4)),
    **dict.fromkeys(("qword", "ulint"), ("u", 8)),
    "signedchar": ("i", 1),
    "short": ("i", 2),
    "dint": ("i", 4),
    "lint": ("i", 8),
    **dict.fromkeys(("float", "single", "real"), ("f", 4)),
    **dict.fromkeys(("double", "lreal"), ("f", 8)),
    **dict.fromkeys(("bool", "boolean"), ("bool", 1)),
}
_TEXTS: Final = frozenset({"char", "string", "str", "ascii", "text", "characters", "visiblestring"})
_BYTES: Final = frozenset(
    {"bytes", "bytearray", "octets", "octetstring", "raw", "data", "blob", "hex", "array", "buffer"}
)


@dataclass(frozen=True, slots=True)
class Kind:
    """A type.

    Attributes:
        base: What it is.
        size: Bytes of one item, 0 if the type does not state it.
        count: Number of items, None for a single one, 0 for the rest of the message.
        order: Byte order, empty if the type does not state it.
    """

    base: Base
    size: int
    count: int | None = None
    order: str = ""


def kind(text: str) -> Kind | None:
    """The type of a text, None if it is not known. Without text it is an unsigned number."""
    text = text.strip().lower()
    count: int | None = None
    if found := _COUNT.match(text):
        digits = found["a"] or found["b"] or found["c"] or ""
        text, count = found["base"], int(digits) if digits.isdecimal() else 0
    plain = re.sub(r"[\s_-]", "", text)
    if plain in _TEXTS:
        return Kind("text", 1, count)
    if plain in _BYTES or (plain in ("byte", "uint8", "u8") and count is not None):
        return Kind("bytes", 1, count)
    if plain in _WORDS:
        base, size = _WORDS[plain]
        return Kind(base, size, count)
    if found := _SIZED.fullmatch(plain):
        order = {"le": "little", "be": "big"}.get(found["order"] or "", "")
        return Kind(_BASES[found["base"]], int(found["bits"]) // 8, count, order)
    if not plain:
        return Kind("u", 0, count)
    return Kind(_BASES[plain], 0, count) if plain in _BASES else None
