"""Dynamixel protocol 1 by dynamixel-sdk, which sends and receives packets of up to 250 bytes."""

from __future__ import annotations

import io
import struct
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

from dynamixel_sdk import COMM_SUCCESS, Protocol1PacketHandler

from qlinkgen.model.message import Direction
from tests.library.protocols import Record

Fields = Mapping[str, Any]
_LONGEST = 250
_ERRORS = {
    1: "voltage",
    2: "angle",
    4: "overheat",
    8: "range",
    0x10: "checksum",
    0x20: "overload",
    0x40: "instruction",
}


def _data(fields: Fields) -> bytes:
    return bytes.fromhex(fields["data"])


#: Message to its instruction, or its error, and parameters.
_KINDS: Mapping[str, tuple[int, Callable[[Fields], bytes]]] = {
    "ping.request": (1, lambda f: b""),
    "read.request": (2, lambda f: bytes((f["start"], f["size"]))),
    "write.request": (3, lambda f: bytes((f["start"],)) + _data(f)),
    "reg_write.request": (4, lambda f: bytes((f["start"],)) + _data(f)),
    "action.request": (5, lambda f: b""),
    "factory_reset.request": (6, lambda f: b""),
    "sync_write.request": (0x83, lambda f: bytes((f["start"], f["size"])) + _data(f)),
    "bulk_read.request": (
        0x92,
        lambda f: b"\0" + b"".join(struct.pack("3B", p["size"], p["node"], p["start"]) for p in f["places"]),
    ),
    "unasked": (0, _data),
    **{name: (number, _data) for number, name in _ERRORS.items()},
}
UNKNOWN: frozenset[str] = frozenset()


def build(record: Record) -> bytes | None:
    number, parameters = _KINDS[record["message"]]
    data = parameters(record["fields"])
    packet = [0, 0, record["node"], len(data) + 2, number, *data, 0]
    if len(packet) > _LONGEST:
        return None
    sent = bytearray()

    def write(piece: list[int]) -> int:
        sent.extend(piece)
        return len(piece)

    port = SimpleNamespace(is_using=False, clearPort=lambda: None, writePort=write)
    assert Protocol1PacketHandler().txPacket(port, packet) == COMM_SUCCESS
    return bytes(sent)


def read(wire: bytes, direction: Direction) -> Record | None:
    if direction == "request" or len(wire) > _LONGEST:
        return None
    line = io.BytesIO(wire)
    port = SimpleNamespace(is_using=False, readPort=lambda size: list(line.read(size)))
    packet, result = Protocol1PacketHandler().rxPacket(port)
    assert result == COMM_SUCCESS
    name = _ERRORS.get(packet[4], "unasked")
    return {"message": name, "node": packet[2], "fields": {"data": bytes(packet[5:-1]).hex()}}
