"""MAVLink 1 by pymavlink."""

from __future__ import annotations

from types import ModuleType
from typing import Any

from pymavlink.dialects.v10 import common

from qlinkgen.model.message import Direction
from tests.library.protocols import Record

#: Steps of a field in one unit, where the schema has another one than the message.
_STEPS = {"degE7": 10**7, "cdeg": 100, "cA": 100, "cdegC": 100, "d%": 10, "c%": 100}
UNKNOWN: frozenset[str] = frozenset()


def made(record: Record, dialect: ModuleType) -> bytes:
    """The frame of a message in a dialect."""
    kind = getattr(dialect, f"MAVLink_{record['message']}_message")
    given = dict(record["fields"])
    if record["message"] == "heartbeat":
        given["mavlink_version"] = 3
    message = kind(*(_given(kind, name, given[name]) for name in kind.fieldnames))
    link = dialect.MAVLink(None, record["system"], record["component"])
    link.seq = record["sequence"]
    if not record.get("signed"):
        return bytes(message.pack(link))
    signing = link.signing
    signing.sign_outgoing, signing.secret_key = True, bytes(32)
    signing.link_id, signing.timestamp = record["link"], record["timestamp"]
    # The signature is over a secret.
    return bytes(message.pack(link))[:-6] + int(record["signature"]).to_bytes(6, "little")


def _steps(kind: Any, name: str) -> int:
    listed = kind.array_lengths[kind.ordered_fieldnames.index(name)]
    plain = kind.fieldtypes[kind.fieldnames.index(name)] == "float"
    return 1 if plain or listed else _STEPS.get(kind.fieldunits_by_name.get(name, ""), 1)


def _given(kind: Any, name: str, value: Any) -> Any:
    if isinstance(value, str):
        return float(value) if value in {"inf", "-inf", "nan"} else value.encode()
    steps = _steps(kind, name)
    return value if steps == 1 else round(value * steps)


def seen(wire: bytes, dialect: ModuleType) -> Record:
    """The record of a frame in a dialect."""
    message = dialect.MAVLink(None).decode(bytearray(wire))
    fields = {name: _read(message, name) for name in message.fieldnames if name != "mavlink_version"}
    header = message.get_header()
    return {
        "message": message.msgname.lower(),
        "system": header.srcSystem,
        "component": header.srcComponent,
        "sequence": header.seq,
        "fields": fields,
    }


def _read(message: Any, name: str) -> Any:
    value = getattr(message, name)
    if isinstance(value, str):  # up to its first NUL
        raw: bytes = getattr(message, f"_{name}_raw")
        return raw.rstrip(b"\0").decode()
    steps = _steps(message, name)
    if isinstance(value, float) and value in {float("inf"), -float("inf")}:
        return str(value)
    return value if steps == 1 else value / steps


def build(record: Record) -> bytes | None:
    return made(record, common)


def read(wire: bytes, direction: Direction) -> Record | None:
    return seen(wire, common)
