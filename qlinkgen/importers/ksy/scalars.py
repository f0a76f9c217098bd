"""The built-in types of Kaitai Struct."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

_NUMBER = re.compile(r"(?P<kind>[usf])(?P<size>[1248])(?P<order>le|be)?")
_BITS = re.compile(r"b(?P<width>[0-9]{1,2})(?P<order>le|be)?")


@dataclass(frozen=True, slots=True)
class Scalar:
    """A number of whole bytes.

    Attributes:
        type: The type in the schema.
        order: Byte order, empty for that of the file; one byte has none.
    """

    type: str
    order: Literal["big", "little", ""]

    @property
    def size(self) -> int:
        """Bytes."""
        return int(self.type[1:]) // 8

    @property
    def limits(self) -> tuple[int, int] | None:
        """Least and greatest value of an integer."""
        bits = 8 * self.size
        match self.type[0]:
            case "u":
                return 0, (1 << bits) - 1
            case "i":
                return -(1 << (bits - 1)), (1 << (bits - 1)) - 1
            case _:
                return None


def scalar(text: str, endian: str) -> Scalar | None:
    """A type such as ``u2le``; None if it is not one, or its byte order is not known."""
    found = _NUMBER.fullmatch(text)
    if found is None or (found["kind"] == "f" and found["size"] not in "48"):
        return None
    order = found["order"] or endian
    if found["size"] == "1":
        return None if found["order"] else Scalar(f"{_letter(found['kind'])}8", "")
    if order not in ("le", "be"):
        return None
    return Scalar(f"{_letter(found['kind'])}{8 * int(found['size'])}", "little" if order == "le" else "big")


def _letter(kind: str) -> str:
    return "i" if kind == "s" else kind


def bit_width(text: str) -> int | None:
    """The number of bits of a type such as ``b3``; None if it is not one."""
    found = _BITS.fullmatch(text)
    return int(found["width"]) if found and 0 < int(found["width"]) <= 64 else None


def bit_order(text: str, endian: str) -> str:
    """The order of the bits of a type such as ``b3le``: ``le`` or ``be``."""
    return text[-2:] if text.endswith(("le", "be")) else endian
