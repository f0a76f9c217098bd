"""Trinamic TMCL by pytrinamic."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from typing import Any

from pytrinamic.tmcl import TMCLReply, TMCLRequest

from qlinkgen.model.message import Direction
from tests.library.protocols import Record

_CODES: Mapping[str, int] = {
    "rotate_right": 1, "rotate_left": 2, "stop": 3, "move": 4, "set_axis_parameter": 5, "axis_parameter": 6,
    "store_axis_parameter": 7, "set_global_parameter": 9, "global_parameter": 10, "set_output": 14,
    "input": 15, "version": 136,
}  # fmt: skip
_STATUS: Mapping[str, int] = {
    "wrong_checksum": 1, "invalid_command": 2, "wrong_type": 3, "invalid_value": 4, "locked": 5,
    "not_available": 6, "done": 100, "loaded": 101,
}  # fmt: skip
UNKNOWN: frozenset[str] = frozenset()


def build(record: Record) -> bytes:
    name, _, direction = record["message"].partition(".")
    value = next(iter(record["fields"].values()), 0)
    if direction == "request":
        frame = TMCLRequest(record["module"], _CODES[name], record["option"], record["motor"], value)
        return bytes(frame.to_buffer())
    status = record["status"]
    number = _STATUS[status] if isinstance(status, str) else status
    return bytes(TMCLReply(record["host"], record["module"], number, _CODES[name], value).to_buffer())


def read(wire: bytes, direction: Direction) -> Record:
    names = {number: name for name, number in _CODES.items()}
    if direction == "request":
        asked = TMCLRequest.from_buffer(wire)
        beside: dict[str, Any] = {"option": asked.commandType, "motor": asked.motorBank}
        name = names[asked.command]
        return {"message": f"{name}.request", "module": asked.moduleAddress, **beside}
    answer = TMCLReply.from_buffer(wire)
    assert answer.is_checksum_correct()
    known = {number: name for name, number in _STATUS.items()}
    beside = {"host": answer.reply_address, "status": known.get(answer.status, answer.status)}
    return {
        "message": f"{names[answer.command]}.response",
        "module": answer.module_address,
        **beside,
        "fields": {"value": ctypes.c_int32(answer.value).value},
    }
