"""MSP by YAMSPy."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

from yamspy import MSPy

from qlinkgen.model.message import Direction
from tests.library.protocols import Record

_CODES = {
    "api_version": 1, "variant": 2, "version": 3, "read_flash": 71, "motors": 104,
    "channels": 105, "gps": 106,
    "attitude": 108, "altitude": 109, "analog": 110, "set_channels": 200, "set_motors": 214, "save": 250,
}  # fmt: skip
#: Message to its values in the library after its answer was read.
_VALUES: Mapping[str, Callable[[Any], Mapping[str, Any]]] = {
    "api_version": lambda m: {"protocol": m.CONFIG["mspProtocolVersion"], **_version(m.CONFIG["apiVersion"])},
    "variant": lambda m: {"identifier": m.CONFIG["flightControllerIdentifier"]},
    "version": lambda m: _version(m.CONFIG["flightControllerVersion"], "major", "minor", "patch"),
    "motors": lambda m: {"motors": m.MOTOR_DATA},
    "channels": lambda m: {"channels": m.RC["channels"]},
    "gps": lambda m: {
        "fix": m.GPS_DATA["fix"],
        "satellites": m.GPS_DATA["numSat"],
        "latitude": m.GPS_DATA["lat"] / 10**7,
        "longitude": m.GPS_DATA["lon"] / 10**7,
        "altitude": m.GPS_DATA["alt"],
        "speed": m.GPS_DATA["speed"],
        "course": m.GPS_DATA["ground_course"] / 10,
    },
    "attitude": lambda m: dict(zip(("roll", "pitch", "yaw"), m.SENSOR_DATA["kinematics"], strict=True)),
    "altitude": lambda m: {"height": m.SENSOR_DATA["altitude"]},
    "analog": lambda m: {
        "used": m.ANALOG["mAhdrawn"],
        "rssi": m.ANALOG["rssi"],
        "current": m.ANALOG["amperage"],
        "voltage": m.ANALOG["voltage"],
    },
}
UNKNOWN: frozenset[str] = frozenset()


def _version(text: str, *names: str) -> Mapping[str, int]:
    return dict(zip(names or ("major", "minor"), map(int, text.split(".")), strict=False))


def _board() -> Any:
    board = MSPy("", loglevel="CRITICAL", logfilename=None)
    board.INAV = False  # what it asks a connected one for
    return board


def build(record: Record) -> bytes | None:
    name, _, direction = record["message"].partition(".")
    if direction != "request":
        return None
    board, sent = _board(), io.BytesIO()
    board.conn = SimpleNamespace(write=sent.write)
    board.send_RAW_msg(_CODES[name], _payload(record["fields"]))
    return sent.getvalue()


def _payload(fields: Mapping[str, Any]) -> bytes:
    """The data of a request: a list of words, or an address and a size."""
    if "address" in fields:
        return int(fields["address"]).to_bytes(4, "little") + int(fields["size"]).to_bytes(2, "little")
    words: list[int] = next(iter(fields.values()), [])
    return b"".join(word.to_bytes(2, "little") for word in words)


def read(wire: bytes, direction: Direction) -> Record | None:
    board, line = _board(), io.BytesIO(wire)
    board.conn = SimpleNamespace(read=lambda size=1: line.read(size))
    found = board.receive_msg()
    if found["unsupported"]:  # it reads no further
        return {"refused": True}
    assert not found.get("packet_error")
    name = next(name for name, code in _CODES.items() if code == found["code"])
    fields: Mapping[str, Any] = {}
    if direction == "response" and name in _VALUES and found["dataView"]:
        assert board.process_recv_data(found) >= 0  # bytes that it leaves
        fields = _VALUES[name](board)
    if direction == "response" and name == "read_flash":
        data = bytes(found["dataView"])
        fields = {"address": int.from_bytes(data[:4], "little"), "data": data[7:].hex()}
    return {"message": f"{name}.{direction}", "fields": fields}
