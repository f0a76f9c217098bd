"""M-Bus by pyMeterBus."""

from __future__ import annotations

import platform
from typing import Any
from unittest import mock

from qlinkgen.model.message import Direction
from tests.library.protocols import Record

# What it imports would start a program to learn how wide pointers are.
with mock.patch.object(platform, "architecture", return_value=("64bit", "")):
    import meterbus

#: It neither builds nor reads what is written to a meter.
UNKNOWN: frozenset[str] = frozenset()


class _Line:
    """Takes what is sent to a line."""

    def __init__(self) -> None:
        self.sent = b""

    def write(self, data: bytes) -> None:
        self.sent += bytes(data)


def build(record: Record) -> bytes | None:
    name, line, fields = record["message"], _Line(), record["fields"]
    if name == "initialise.request" and record["node"] <= 250:
        meterbus.send_ping_frame(line, record["node"])
        return line.sent
    if name == "select.request":
        maker = fields["maker"].to_bytes(2, "little").hex()
        number = f"{fields['identity']:08}{maker}{fields['version']:02X}{fields['medium']:02X}"
        meterbus.send_select_frame(line, number.upper())
        return _moved(line.sent, record["node"])
    return bytes(meterbus.TelegramACK()) if name == "ack" else None


def _moved(wire: bytes, node: int) -> bytes:
    """The frame to another node, and without the counter bit, which it sets."""
    body = bytes([wire[4] & ~0x20, node, *wire[6:-2]])
    return wire[:4] + body + bytes([sum(body) & 0xFF]) + wire[-1:]


def read(wire: bytes, direction: Direction) -> Record | None:
    try:
        found: Any = meterbus.load(wire)
    except Exception:  # noqa: BLE001 - of what is not a record
        return None
    if isinstance(found, meterbus.TelegramACK):
        return {"message": "ack"}
    node, control = found.header.aField.parts[0], found.header.cField.parts[0]
    if isinstance(found, meterbus.TelegramShort):
        names = {0x40: "initialise.request", 0x5B: "read.request"}
        return {"message": names[control], "node": node}
    kind = found.body.bodyHeader
    code = kind.ci_field.parts[0]
    name = {0x50: "reset.request", 0x51: "write.request", 0x52: "select.request", 0x72: "read.response"}[code]
    if name != "read.response":
        return {"message": name, "node": node}
    return {
        "message": name,
        "node": node,
        "fields": {
            "identity": int(bytes(kind.id_nr).hex()),
            "maker": int.from_bytes(bytes(kind.manufacturer_field.parts), "little"),
            "version": kind.version_field.parts[0],
            "medium": kind.measure_medium_field.parts[0],
            "access": kind.acc_nr_field.parts[0],
            "status": kind.status_field.parts[0],
        },
    }
