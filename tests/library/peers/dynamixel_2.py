"""Dynamixel protocol 2 by dynamixel-sdk: its stuffing and its checksum.

Its `txPacket` drops what `addStuffing` returns, and its `rxPacket` loses a byte of stuffed packets.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

from dynamixel_sdk import COMM_SUCCESS, Protocol2PacketHandler

from qlinkgen.model.message import Direction
from tests.library.protocols import Record

Fields = Mapping[str, Any]
_ERRORS = ("none", "result_fail", "instruction", "crc", "data_range", "data_length", "data_limit", "access")
_SCOPES = {"all_but_id": 1, "all_but_id_and_baud": 2, "all": 0xFF}


def _data(fields: Fields) -> bytes:
    return bytes.fromhex(fields["data"])


def _number(value: int | str, names: Mapping[str, int]) -> int:
    return names[value] if isinstance(value, str) else value


def _error(record: Record) -> bytes:
    """The error of a status packet."""
    if record["message"] != "unasked":
        return b""
    names = {name: number for number, name in enumerate(_ERRORS)}
    return bytes((_number(record["error_"], names) | record["alert"] << 7,))


#: Message to its instruction and parameters.
_KINDS: Mapping[str, tuple[int, Callable[[Fields], bytes]]] = {
    "ping.request": (1, lambda f: b""),
    "read.request": (2, lambda f: struct.pack("<HH", f["start"], f["size"])),
    "write.request": (3, lambda f: struct.pack("<H", f["start"]) + _data(f)),
    "reg_write.request": (4, lambda f: struct.pack("<H", f["start"]) + _data(f)),
    "action.request": (5, lambda f: b""),
    "factory_reset.request": (
        6,
        lambda f: bytes((_SCOPES[f["scope"]] if isinstance(f["scope"], str) else f["scope"],)),
    ),
    "reboot.request": (8, lambda f: b""),
    "clear.request": (0x10, lambda f: bytes((1, 0x44, 0x58, 0x4C, 0x22))),
    "sync_read.request": (
        0x82,
        lambda f: struct.pack("<HH", f["start"], f["size"]) + bytes.fromhex(f["nodes"]),
    ),
    "sync_write.request": (0x83, lambda f: struct.pack("<HH", f["start"], f["size"]) + _data(f)),
    "bulk_read.request": (
        0x92,
        lambda f: b"".join(struct.pack("<BHH", p["node"], p["start"], p["size"]) for p in f["places"]),
    ),
    "unasked": (0x55, _data),
}
UNKNOWN: frozenset[str] = frozenset()


def build(record: Record) -> bytes | None:
    instruction, parameters = _KINDS[record["message"]]
    data = _error(record) + parameters(record["fields"])
    head = (0xFF, 0xFF, 0xFD, 0, record["node"], *(len(data) + 3).to_bytes(2, "little"))
    handler = Protocol2PacketHandler()
    packet = handler.addStuffing([*head, instruction, *data, 0, 0])
    check = handler.updateCRC(0, packet, len(packet) - 2)
    return bytes(packet[:-2]) + struct.pack("<H", check)


def read(wire: bytes, direction: Direction) -> Record | None:
    if direction == "request" or b"\xff\xff\xfd\xfd" in wire:
        return None
    line = io.BytesIO(wire)
    port = SimpleNamespace(is_using=False, readPort=lambda size: list(line.read(size)))
    packet, result = Protocol2PacketHandler().rxPacket(port, fast_option=False)
    assert result == COMM_SUCCESS
    node, error, data = packet[4], packet[8], bytes(packet[9:-2])
    named = dict(enumerate(_ERRORS)).get(error & 0x7F, error & 0x7F)
    beside = {"error_": named, "alert": bool(error & 0x80)}
    return {"message": "unasked", "node": node, **beside, "fields": {"data": data.hex()}}
