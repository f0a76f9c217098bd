"""XBee frames by digi-xbee, which builds all of them, and reads those with numbers that it knows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from digi.xbee.exception import XBeeException
from digi.xbee.models.address import XBee16BitAddress, XBee64BitAddress
from digi.xbee.models.status import DiscoveryStatus, ModemStatus, TransmitStatus
from digi.xbee.packets import common
from digi.xbee.packets.base import XBeePacket
from digi.xbee.packets.factory import build_frame

from qlinkgen.model.message import Direction
from tests.library.protocols import Record, described

Fields = Mapping[str, Any]
UNKNOWN: frozenset[str] = frozenset()
_OPTIONS = {"no_retry": 0, "apply": 1, "indirect": 2, "multicast": 3, "encrypt": 5, "long_timeout": 6}
_RECEIVED = {"acknowledged": 0, "broadcast": 1, "encrypted": 5, "end_device": 6}


def _long(number: int) -> Any:
    return XBee64BitAddress(bytearray(number.to_bytes(8, "big")))


def _short(number: int) -> Any:
    return XBee16BitAddress(bytearray(number.to_bytes(2, "big")))


def _bits(fields: Fields, places: Mapping[str, int]) -> int:
    return sum(fields[name] << bit for name, bit in places.items() if name in fields)


def _raw(enum: str, value: str | int) -> int:
    """The number of a name of our enum."""
    members = next(each.members for each in described("xbee").model.enums if each.name == enum)
    return value if isinstance(value, int) else next(each.value for each in members if each.name == value)


def _name(enum: str, number: int) -> str | int:
    members = next(each.members for each in described("xbee").model.enums if each.name == enum)
    return next((each.name for each in members if each.value == number), number)


def _status(fields: Fields) -> int:
    return _raw("command_status", fields["status"])


def _known(kind: Any, number: int) -> Any:
    """The status of a number. Raises ValueError for one that it does not know."""
    found = kind.get(number)
    if found is None or found.code != number:
        raise ValueError(number)
    return found


def _command(fields: Fields) -> bytearray:
    return bytearray(fields["command"].encode())


def _data(fields: Fields, name: str = "value") -> bytearray:
    return bytearray.fromhex(fields[name])


_BUILT: Mapping[str, Callable[[Fields], Any]] = {
    "at_command.request": lambda f: common.ATCommPacket(f["frame"], _command(f), _data(f)),
    "at_command.response": lambda f: common.ATCommResponsePacket(
        f["frame"], _command(f), _status(f), _data(f)
    ),
    "remote_at_command.request": lambda f: common.RemoteATCommandPacket(
        f["frame"], _long(f["destination"]), _short(f["network"]), _bits(f, _OPTIONS), _command(f), _data(f)
    ),
    "remote_at_command.response": lambda f: common.RemoteATCommandResponsePacket(
        f["frame"], _long(f["source"]), _short(f["network"]), _command(f), _status(f), _data(f)
    ),
    "transmit.request": lambda f: common.TransmitPacket(
        f["frame"], _long(f["destination"]), _short(f["network"]), f["radius"], _bits(f, _OPTIONS),
        _data(f, "data"),
    ),
    "transmit.response": lambda f: common.TransmitStatusPacket(
        f["frame"], _short(f["network"]), f["retries"],
        _known(TransmitStatus, _raw("delivery_status", f["delivery"])),
        _known(DiscoveryStatus, _raw("discovery_status", f["discovery"])),
    ),
    "received": lambda f: common.ReceivePacket(
        _long(f["source"]), _short(f["network"]), _bits(f, _RECEIVED), _data(f, "data")
    ),
    "modem_status": lambda f: common.ModemStatusPacket(
        _known(ModemStatus, _raw("modem_status", f["status"]))
    ),
}  # fmt: skip


def build(record: Record) -> bytes | None:
    try:
        return bytes(_BUILT[record["message"]](record["fields"]).output(escaped=True))
    except (AttributeError, ValueError):  # a number that it does not know
        return None


def read(wire: bytes, direction: Direction) -> Record | None:
    del direction
    try:
        found = build_frame(XBeePacket.unescape_data(bytearray(wire)))
    except XBeeException:  # a number that it does not know
        return None
    if isinstance(found, common.ReceivePacket):
        return {"message": "received", "fields": {"data": (found.rf_data or b"").hex()}}
    if isinstance(found, common.ATCommResponsePacket):
        fields = {"frame": found.frame_id, "status": _name("command_status", found.real_status)}
        return {"message": "at_command.response", "fields": fields}
    if isinstance(found, common.TransmitStatusPacket):
        fields = {"frame": found.frame_id, "retries": found.transmit_retry_count}
        return {"message": "transmit.response", "fields": fields}
    return None
