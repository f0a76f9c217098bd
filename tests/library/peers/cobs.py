"""COBS by the package cobs, with the CRC-32 of the standard library."""

from __future__ import annotations

import struct
import zlib
from typing import Any

from cobs.cobs import decode, encode

from qlinkgen.model.message import Direction
from tests.library.protocols import Record

UNKNOWN: frozenset[str] = frozenset()
NUMBERS = {"ping": 0, "read": 1, "write": 2, "log": 3}


def body(record: Record) -> bytes:
    """Number and data of a message, as the schemas for frames to build on have them."""
    fields = record["fields"]
    data = bytes((NUMBERS[record["message"].partition(".")[0]],))
    data += struct.pack("<I", fields["start"]) if "start" in fields else b""
    data += bytes((fields["size"],)) if "size" in fields else b""
    data += bytes.fromhex(fields.get("data", ""))
    return data + str(fields.get("text", "")).encode()


def seen(data: bytes, direction: Direction) -> Record:
    """The record of number and data."""
    name = next(name for name, number in NUMBERS.items() if number == data[0])
    fields: dict[str, Any] = {}
    match name, direction:
        case "log", _:
            fields = {"text": data[1:].decode()}
        case "read", "request":
            fields = dict(zip(("start", "size"), struct.unpack("<IB", data[1:]), strict=True))
        case "write", "request":
            fields = {"start": struct.unpack_from("<I", data, 1)[0], "data": data[5:].hex()}
        case "write", "response":
            pass
        case _:
            fields = {"data": data[1:].hex()}
    return {"message": name if name == "log" else f"{name}.{direction}", "fields": fields}


def build(record: Record) -> bytes | None:
    data = body(record)
    return bytes(encode(data + struct.pack("<I", zlib.crc32(data)))) + b"\0"


def read(wire: bytes, direction: Direction) -> Record | None:
    data = decode(wire[:-1])
    assert zlib.crc32(data[:-4]) == struct.unpack("<I", data[-4:])[0]
    return seen(data[:-4], direction)
