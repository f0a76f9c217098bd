"""PPP by yahdlc, which reads its frames and builds those of another control byte."""

from __future__ import annotations

import yahdlc

from qlinkgen.model.message import Direction
from tests.library.protocols import Record

#: Longer frames may not fit its buffer.
_MOST = 516
_NAMES = {b"\x00\x21": "ipv4", b"\x00\x57": "ipv6"}
_LINK_CONTROL = b"\xc0\x21"
UNKNOWN: frozenset[str] = frozenset()


def build(record: Record) -> bytes | None:
    return None


def read(wire: bytes, direction: Direction) -> Record | None:
    if len(wire) > _MOST:
        return None
    data, _, _ = yahdlc.get_data(wire)
    if data[:2] == _LINK_CONTROL:
        return {"message": "lcp", "fields": {"identifier": data[3]}}
    return {"message": _NAMES[data[:2]], "fields": {"datagram": data[2:].hex()}}
