"""VESC UART by pyvesc."""

from __future__ import annotations

import binascii
import sys
from collections.abc import Mapping
from decimal import Decimal
from types import ModuleType

from qlinkgen.model.message import Direction
from tests.library.protocols import Record

# pyvesc wants a package whose name on PyPI has been taken over by another one.
_CRC = ModuleType("PyCRC.CRCCCITT")
_CRC.CRCCCITT = type(  # type: ignore[attr-defined]
    "CRCCCITT", (), {"calculate": staticmethod(lambda data: binascii.crc_hqx(data, 0))}
)
sys.modules |= {"PyCRC": ModuleType("PyCRC"), "PyCRC.CRCCCITT": _CRC}

from pyvesc.messages import setters  # noqa: E402  # with its import replaced
from pyvesc.messages.base import VESCMessage  # noqa: E402
from pyvesc.packet.codec import frame, unframe  # noqa: E402

#: Message to the class of pyvesc, its field, and the steps of the field in one unit.
_KINDS: Mapping[str, tuple[type, str, int]] = {
    "set_duty.request": (setters.SetDutyCycle, "duty", 100_000),
    "set_current.request": (setters.SetCurrent, "current", 1000),
    "set_brake.request": (setters.SetCurrentBrake, "current", 1000),
    "set_speed.request": (setters.SetRPM, "speed", 1),
    "set_position.request": (setters.SetPosition, "position", 1),
}
_NUMBERS = {"get_values": 4, "alive": 30}
#: It has an older layout of the measurements, but reads their frames.
UNKNOWN: frozenset[str] = frozenset()


def build(record: Record) -> bytes | None:
    name, fields = record["message"], record["fields"]
    if name in _KINDS:
        kind, field, steps = _KINDS[name]
        exact = Decimal(str(fields[field])) * steps
        return bytes(frame(VESCMessage.pack(kind(exact if name == "set_position.request" else int(exact)))))
    return bytes(frame(bytes((_NUMBERS[name.partition(".")[0]],)))) if not fields else None


def read(wire: bytes, direction: Direction) -> Record | None:
    payload, used = unframe(wire)
    assert used == len(wire)
    for name, (kind, field, steps) in _KINDS.items():
        if payload[0] == vars(kind)["id"]:
            message = VESCMessage.unpack(payload)
            (value,) = vars(message).values()
            return {"message": name, "fields": {field: value / steps}}
    return {"message": next(f"{name}.{direction}" for name, id_ in _NUMBERS.items() if id_ == payload[0])}
