"""Modbus ASCII by pymodbus."""

from __future__ import annotations

from pymodbus.framer import FramerAscii

from qlinkgen.model.message import Direction
from tests.library.peers.modbus_rtu import UNKNOWN, framer, is_read, pdu_of, record_of
from tests.library.protocols import Record

__all__ = ["UNKNOWN", "build", "read"]


def build(record: Record) -> bytes | None:
    pdu = pdu_of(record)
    return None if pdu is None else framer(FramerAscii, "request").buildFrame(pdu)


def read(wire: bytes, direction: Direction) -> Record | None:
    if not is_read(int(wire[3:5], 16), direction):
        return None
    return record_of(framer(FramerAscii, direction).handleFrame(wire, 0, 0)[1])
