"""MAVLink 2 by pymavlink."""

from __future__ import annotations

from pymavlink.dialects.v20 import common

from qlinkgen.model.message import Direction
from tests.library.peers.mavlink_1 import UNKNOWN, made, seen
from tests.library.protocols import Record

__all__ = ["UNKNOWN", "build", "read"]


def build(record: Record) -> bytes | None:
    # It sends no flags.
    return None if record["compatible"] else made(record, common)


def read(wire: bytes, direction: Direction) -> Record | None:
    return seen(wire, common)
