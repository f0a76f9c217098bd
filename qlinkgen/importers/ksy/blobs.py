"""Byte strings, texts and constant bytes."""

from __future__ import annotations

from qlinkgen.importers import cells
from qlinkgen.importers.document import Notation, Value, hexadecimal
from qlinkgen.importers.ksy import expressions
from qlinkgen.importers.ksy.tree import Attribute, Refused
from qlinkgen.importers.ksy.valid import number

MOST = 65535
_MOST_CONSTANT = 8
_ASCII = frozenset({"ascii", "us-ascii", "ansi_x3.4-1968"})
_LIKE_ASCII = frozenset({"utf-8", "utf8", "iso-8859-1", "iso8859-1", "windows-1252"})


def contents(attribute: Attribute) -> bytes:
    """The constant bytes of an attribute. Raises Refused."""
    node = attribute.node.get("contents")
    assert node is not None
    data = b""
    for each in list(node.listed) if isinstance(node.value, list) else [node]:
        one = number(each)
        if isinstance(each.value, str):
            data += each.value.encode()
        elif one is not None and 0 <= one <= 0xFF:
            data += bytes([one])
        else:
            raise Refused(each, f"{attribute.id[:60]}: '{each.word[:20]}' is not a byte or text")
    if not data:
        raise Refused(attribute, f"{attribute.id[:60]}: constant bytes are missing")
    return data


def constant(attribute: Attribute, *, little: bool) -> tuple[str, dict[str, Value]]:
    """Constant bytes as an integer; `little` is the byte order of the schema. Raises Refused."""
    data = contents(attribute)
    if len(data) > _MOST_CONSTANT:
        raise Refused(attribute, f"{attribute.id[:60]}: more than {_MOST_CONSTANT} constant bytes in fields")
    order: dict[str, Value] = {"byteorder": "big"} if little and len(data) > 1 else {}
    return f"u{8 * len(data)}", {**order, "const": hexadecimal(int.from_bytes(data, "big"), 2 * len(data))}


def blob(attribute: Attribute) -> tuple[str, dict[str, Value]]:
    """The type of a byte string or text, and its keys. Raises Refused.

    A text that is not ASCII becomes a byte string, with a note.
    """
    text = attribute.text("size")
    size = expressions.count(expressions.parsed(text)) if text else None
    end = "0" if attribute.type == "strz" else attribute.text("terminator")
    ended = bool(end) and not text and attribute.text("size-eos") != "true"
    base = _base(attribute, ended=ended)
    if isinstance(size, int):
        return _fixed(attribute, base, size, attribute.text("pad-right") or end)
    if ended:
        return base, {"terminator": _byte(attribute, end)}
    if not text and attribute.text("size-eos") != "true":
        raise Refused(attribute, f"{attribute.id[:60]}: its size is not stated")
    return base, {}


def _base(attribute: Attribute, *, ended: bool) -> str:
    if not attribute.type:
        return "bytes"
    encoding = attribute.text("encoding") or attribute.scope.encoding
    if encoding.lower() in _ASCII:
        return "text"
    if ended and encoding.lower() in _LIKE_ASCII:
        attribute.notes.add(
            attribute.line,
            f"{attribute.id[:60]}: texts of a schema are ASCII; others in {encoding} are refused",
        )
        return "text"
    reason = f"texts of a schema are ASCII, not {encoding[:20] or 'of an unknown encoding'}"
    attribute.notes.add(attribute.line, f"{attribute.id[:60]} is a byte string: {reason}")
    return "bytes"


def _fixed(attribute: Attribute, base: str, size: int, padding: str) -> tuple[str, dict[str, Value]]:
    if not 0 < size <= MOST:
        raise Refused(attribute, f"{attribute.id[:60]}: {size} bytes are not between 1 and {MOST}")
    return f"{base}[{size}]", {"pad": _byte(attribute, padding)} if padding else {}


def _byte(attribute: Attribute, text: str) -> Value:
    found = cells.integer(text)
    if found is None or not 0 <= found <= 0xFF:
        raise Refused(attribute, f"{attribute.id[:60]}: '{text[:20]}' is not a byte")
    return Notation(f"{found:02X}")
