"""MAVLink 2 by pymavlink."""

from __future__ import annotations

from pymavlink.dialects.v20 import common

from qlinkgen.model.message import Direction
from tests.library.peers.mavlink_1 import UNKNOWN, made, seen
from tests.library.protocols import Record

__all__ = ["UNKNOWN", "build", "read"]


def build(record: Record) -> bytes | None:
    # It sends no flags but that of a signature.
    return None if record["compatible"] else made(record, common)


def read(wire: bytes, direction: Direction) -> Record | None:
    flags = common.MAVLink(None).decode(bytearray(wire)).get_header().incompat_flags
    return {**seen(wire, common), "signed": bool(flags & common.MAVLINK_IFLAG_SIGNED)}
