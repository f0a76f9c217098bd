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
    from meterbus.core_objects import DataEncoding

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
            **_records(found.body.bodyPayload),
        },
    }


def _records(payload: Any) -> Record:
    """The records that it reads; nothing if it leaves some out, which are those without a value."""
    if b"" in (values := [bytes(each.dataField.parts) for each in payload.records]):
        return {}
    described = sum(len(each.dib) + len(each.vib) + _text_size(each) for each in payload.records)
    if described + sum(map(len, values)) != len(payload.body):
        return {}
    return {"records": [_record(each) for each in payload.records]}


def _text_size(record: Any) -> int:
    """Bytes of the unit as text, and of the sizes of texts."""
    custom = record.vib.customVIF
    return int(record.vib.without_extension_bit) * (1 + len(custom)) + int(record.dib.is_variable_length)


def _record(record: Any) -> Record:
    dib, vib, data = record.dib, record.vib, record.dataField
    readers: Mapping[Any, Callable[[], object]] = {
        DataEncoding.ENCODING_INTEGER: lambda: data.decodeInt,
        DataEncoding.ENCODING_BCD: lambda: data.decodeBCD,
        DataEncoding.ENCODING_REAL: lambda: _number(data.decodeReal),
        DataEncoding.ENCODING_VARIABLE_LENGTH: lambda: {"text": data.decodeASCII[::-1]},
    }
    return {
        "length": dib.parts[0] & dib.DATA_FIELD_MASK,
        "function": ("instantaneous", "maximum", "minimum", "error")[dib.function_type.value],
        "storage": bool(dib.parts[0] & dib.STORAGE_NUMBER_MASK),
        "described": len(dib) > 1,
        "dife": _extensions(dib),
        "code": vib.parts[0] & 0x7F,
        "extended": len(vib) > 1,
        "unit": vib.customVIF.decodeASCII[::-1] if vib.without_extension_bit else None,
        "vife": _extensions(vib),
        "value": readers[dib.length_encoding[1]](),
    }


def _number(number: float) -> float | str:
    """As JSON has it."""
    return number if math.isfinite(number) else str(number)


def _extensions(block: Any) -> list[Record] | None:
    found: list[Record] = [{"value": each & 0x7F, "more": each >= 0x80} for each in block.parts[1:]]
    return found or None
