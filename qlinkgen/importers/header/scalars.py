"""The scalar types of C with a size that is the same on every usual machine."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from qlinkgen.importers.header.nodes import Basic, Named


@dataclass(frozen=True, slots=True)
class Scalar:
    """A scalar type.

    Attributes:
        type: The type in the schema.
        size: Size in bytes.
        kind: `character` and `byte` make texts and byte strings where they are arrays.
    """

    type: str
    size: int
    kind: Literal["number", "character", "byte", "bool", "float"] = "number"

    @property
    def signed(self) -> bool:
        """Whether it is a signed integer."""
        return self.type.startswith("i")


_BYTE = Scalar("u8", 1, "byte")
_NAMED: Mapping[str, Scalar] = {
    "bool": Scalar("bool", 1, "bool"),
    "float32_t": Scalar("f32", 4, "float"),
    "float64_t": Scalar("f64", 8, "float"),
    "BOOL": Scalar("bool", 1, "bool"),
    "BYTE": _BYTE,
    "byte": _BYTE,
    "uchar": _BYTE,
    "WORD": Scalar("u16", 2),
    "DWORD": Scalar("u32", 4),
    "QWORD": Scalar("u64", 8),
}
_SIZED = re.compile(
    r"(?:__)?(?:(?P<unsigned>u|U|uint|UINT|Uint)|s|S|i|int|INT|Int|sint|SINT)(?:_least)?(?P<bits>8|16|32|64)(?:_t|_T)?"
)
#: Words of a basic type without those that change nothing.
_WORDS: Mapping[frozenset[str], Scalar] = {
    frozenset({"char"}): Scalar("u8", 1, "character"),
    frozenset({"char", "unsigned"}): _BYTE,
    frozenset({"char", "signed"}): Scalar("i8", 1),
    frozenset({"short"}): Scalar("i16", 2),
    frozenset({"short", "unsigned"}): Scalar("u16", 2),
    frozenset({"int"}): Scalar("i32", 4),
    frozenset({"int", "unsigned"}): Scalar("u32", 4),
    frozenset({"long long"}): Scalar("i64", 8),
    frozenset({"long long", "unsigned"}): Scalar("u64", 8),
    frozenset({"float"}): Scalar("f32", 4, "float"),
    frozenset({"double"}): Scalar("f64", 8, "float"),
    frozenset({"_Bool"}): Scalar("bool", 1, "bool"),
}


def named(type_: Named) -> Scalar | None:
    """A type of stdint.h and its like, or one of the names that most programs use for them."""
    if type_.name in _NAMED:
        return _NAMED[type_.name]
    found = _SIZED.fullmatch(type_.name)
    if found is None:
        return None
    bits = int(found["bits"])
    if bits == 8 and found["unsigned"]:
        return _BYTE
    return Scalar(f"{'u' if found['unsigned'] else 'i'}{bits}", bits // 8)


def basic(type_: Basic) -> Scalar | None:
    """A type of C itself, None for one whose size is not the same everywhere."""
    words = [*type_.words]
    if words.count("long") == 2:
        words = [each for each in words if each != "long"] + ["long long"]
    found = frozenset(words)
    if found & {"short", "long long"} or "unsigned" in found or "signed" in found:
        found -= {"int"} if found & {"short", "long long"} else set()
    if "signed" in found and "char" not in found:
        found -= {"signed"}
    if found in (frozenset({"unsigned"}), frozenset()):
        found |= {"int"}
    return _WORDS.get(found)
