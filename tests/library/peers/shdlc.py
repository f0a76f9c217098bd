"""Sensirion SHDLC by sensirion-shdlc-driver, which builds requests and reads answers."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from typing import Any

from sensirion_shdlc_driver.serial_frame_builder import (
    ShdlcSerialMisoFrameBuilder,
    ShdlcSerialMosiFrameBuilder,
)

from qlinkgen.model.message import Direction
from tests.library.protocols import Record

Fields = Mapping[str, Any]
#: Command to its number, the data of its request, and the fields of its answer.
_KINDS: Mapping[str, tuple[int, Callable[[Fields], bytes], Callable[[bytes], Fields]]] = {
    "slave_address": (0x90, lambda f: bytes(f["address"]), lambda data: {"address": [*data]}),
    "baud_rate": (0x91, lambda f: _words(f["speed"]), lambda data: {"speed": _numbers(data)}),
    "factory_reset": (0x92, lambda f: b"", lambda data: {}),
    "up_time": (0x93, lambda f: b"", lambda data: {"seconds": _numbers(data)}),
    "information": (0xD0, lambda f: bytes((f["kind"],)), lambda data: {"text": data.decode()}),
    "version": (0xD1, lambda f: b"", lambda data: {"versions": [*data]}),
    "error_state": (0xD2, lambda f: bytes((f["clear"],)), lambda data: {"errors": data.hex()}),
    "reset": (0xD3, lambda f: b"", lambda data: {}),
}
UNKNOWN: frozenset[str] = frozenset()


def _words(values: list[int]) -> bytes:
    return struct.pack(f">{len(values)}I", *values)


def _numbers(data: bytes) -> list[int]:
    return [*struct.unpack(f">{len(data) // 4}I", data)]


def build(record: Record) -> bytes | None:
    name, _, direction = record["message"].partition(".")
    if direction == "response":
        return None
    number, data, _ = _KINDS[name]
    return bytes(ShdlcSerialMosiFrameBuilder(record["node"], number, data(record["fields"])).to_bytes())


def read(wire: bytes, direction: Direction) -> Record | None:
    if direction == "request":
        return None
    builder = ShdlcSerialMisoFrameBuilder()
    assert builder.add_data(wire)
    node, command, state, data = builder.interpret_data()
    name = next(name for name, (number, *_) in _KINDS.items() if number == command)
    beside = {"error_": state & 0x7F, "device": bool(state & 0x80)}
    return {"message": f"{name}.response", "node": node, **beside, "fields": _KINDS[name][2](data)}
