"""M-Bus by pyMeterBus."""

from __future__ import annotations

import math
import platform
from collections.abc import Callable, Mapping
from typing import Any
from unittest import mock

from qlinkgen.model.message import Direction
from tests.library.protocols import Record

# What it imports would start a program to learn how wide pointers are.
with mock.patch.object(platform, "architecture", return_value=("64bit", "")):
    import meterbus
    from meterbus import telegram_body
    from meterbus.core_objects import DataEncoding
    from meterbus.telegram_variable_data_record import TelegramVariableDataRecord

#: It reads the records of answers alone, and builds none.
UNKNOWN: frozenset[str] = frozenset()


class _Line:
    """Takes what is sent to a line."""

    def __init__(self) -> None:
        self.sent = b""

    def write(self, data: bytes) -> None:
        self.sent += bytes(data)


def build(record: Record) -> bytes | None:
    name, line, fields = record["message"], _Line(), record["fields"]
    if name == "initialise.request" and record["node"] <= 250 and not record["fcb"]:
        meterbus.send_ping_frame(line, record["node"])
        return line.sent
    if name == "select.request":
        maker = fields["maker"].to_bytes(2, "little").hex()
        number = f"{fields['identity']:08}{maker}{fields['version']:02X}{fields['medium']:02X}"
        meterbus.send_select_frame(line, number.upper())
        return _moved(line.sent, record["node"], record["fcb"])
    return bytes(meterbus.TelegramACK()) if name == "ack" else None


def _moved(wire: bytes, node: int, count: int) -> bytes:
    """The frame to another node, and with another frame count bit than the one that it sets."""
    body = bytes([wire[4] & ~0x20 | count << 5, node, *wire[6:-2]])
    return wire[:4] + body + bytes([sum(body) & 0xFF]) + wire[-1:]


def read(wire: bytes, direction: Direction) -> Record | None:
    try:
        found: Any = meterbus.load(wire)
    except Exception:  # noqa: BLE001 - of what is not a record
        return None
    if isinstance(found, meterbus.TelegramACK):
        return {"message": "ack"}
    if not isinstance(found, meterbus.TelegramShort | meterbus.TelegramControl | meterbus.TelegramLong):
        return None  # what it cannot read, it takes for a telegram by radio
    node, control = found.header.aField.parts[0], found.header.cField.parts[0]
    if isinstance(found, meterbus.TelegramShort):
        names = {0x40: "initialise.request", 0x5B: "read.request"}
        return {"message": names[control & ~0x20], "node": node, "fcb": control >> 5 & 1}
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
            **_records(found.body.bodyPayload),
        },
    }


def _records(payload: Any) -> Record:
    """The records as it reads them one by one; nothing if it reads some otherwise."""
    data, at, found = bytes(payload.body.parts), 0, list[Record]()
    while at < len(data):
        dif, special = data[at], data[at] & 0x0F == 0x0F
        if special and (dif not in (0x0F, 0x1F, 0x2F) or data[at:-1].startswith(b"\x1f")):
            return {}
        read: list[Any] = []
        with mock.patch.object(telegram_body, "TelegramVariableDataRecord", _Kept(read)):
            # The public method tells neither places nor records without a value.
            at = payload._parse_variable_data_rec(at)
        left = bytes(read[0].dataField.parts).hex() if dif != 0x2F else None
        found.append(_special(dif, left) if special else _record(read[0]))
    return {"records": found}


class _Kept:
    """Makes records, and keeps them."""

    def __init__(self, read: list[Any]) -> None:
        self._read = read

    def __call__(self) -> Any:
        self._read.append(TelegramVariableDataRecord())
        return self._read[-1]


def _record(record: Any) -> Record:
    dib, vib, data = record.dib, record.vib, record.dataField
    readers: Mapping[Any, Callable[[], object]] = {
        DataEncoding.ENCODING_NULL: lambda: None,
        DataEncoding.ENCODING_INTEGER: lambda: data.decodeInt,
        DataEncoding.ENCODING_BCD: lambda: _digits(data),
        DataEncoding.ENCODING_REAL: lambda: _number(data.decodeReal),
        DataEncoding.ENCODING_VARIABLE_LENGTH: lambda: {"text": bytes(data.parts).hex()},
    }
    custom = bytes(vib.customVIF.parts).hex() if vib.without_extension_bit else None
    return {
        **_described(dib.parts[0], len(dib) > 1),
        "dife": _extensions(dib),
        "code": vib.parts[0] & 0x7F,
        "extended": len(vib) > 1,
        "unit": custom,
        "vife": _extensions(vib),
        "value": readers[dib.length_encoding[1]](),
        "manufacturer": None,
    }


def _special(dif: int, data: str | None) -> Record:
    """Data of the manufacturer, or nothing."""
    absent = dict.fromkeys(("dife", "code", "extended", "unit", "vife", "value"))
    return {**_described(dif, False), **absent, "manufacturer": data}


def _described(dif: int, extended: bool) -> Record:
    return {
        "length": dif & 0x0F,
        "function": ("instantaneous", "maximum", "minimum", "error")[dif >> 4 & 3],
        "storage": bool(dif & 0x40),
        "described": extended,
    }


def _digits(data: Any) -> int:
    """The digits of a decimal number, each in four bits."""
    written = bytes(data.parts)[::-1].hex()
    return int(str(data.decodeBCD) if written.isdecimal() else written, 16)


def _number(number: float) -> float | str:
    """As JSON has it."""
    return number if math.isfinite(number) else str(number)


def _extensions(block: Any) -> list[Record] | None:
    found: list[Record] = [{"value": each & 0x7F, "more": each >= 0x80} for each in block.parts[1:]]
    return found or None
