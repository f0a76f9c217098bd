"""The constants that tell which schema and which generator a header is from."""

from __future__ import annotations

import qlinkgen
from qlinkgen.model.protocol import Protocol


def stamps(protocol: Protocol) -> list[tuple[str, str]]:
    """Names, without the prefix of the protocol, and values; the number is the start of the hash."""
    found = [("SCHEMA_REVISION", _literal(protocol.revision))]
    found += [("PROTOCOL_VERSION", _literal(str(protocol.version)))] if protocol.version else []
    return [
        *found,
        ("SCHEMA_HASH", f"0x{protocol.schema_hash[:8].upper()}UL"),
        ("GENERATOR_VERSION", _literal(qlinkgen.__version__)),
    ]


def _literal(text: str) -> str:
    """A string literal; what is not plain ASCII, or could change the literal, is escaped by its number."""
    plain = (chr(each) if _is_plain(each) else f"\\{each:03o}" for each in text.encode())
    return f'"{"".join(plain)}"'


def _is_plain(byte: int) -> bool:
    return 0x20 <= byte < 0x7F and chr(byte) not in '"\\?/*'
