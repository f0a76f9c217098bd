"""u-blox UBX by pyubx2."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

from pyubx2 import GET, POLL, SET, SETPOLL, UBXMessage, UBXReader

from qlinkgen.model.message import Direction
from tests.library.protocols import Record, pairs

_ENUMS = {
    "fix": ("none", "dead_reckoning", "two_dimensional", "three_dimensional", "combined", "time"),
    "reference": ("utc", "gps", "glonass", "beidou", "galileo"),
}
#: Message to its name in the library, and each field to its attribute.
_KINDS: Mapping[str, tuple[str, Mapping[str, str]]] = {
    "set_message_rate.request": (
        "CFG-MSG",
        pairs(
            "message_class=msgClass message_number=msgID i2c=rateDDC uart1=rateUART1 uart2=rateUART2 "
            "usb=rateUSB spi=rateSPI"
        ),
    ),
    "set_rate.request": ("CFG-RATE", pairs("period=measRate ratio=navRate reference=timeRef")),
    "poll_status.request": ("NAV-STATUS", {}),
    "poll_status.response": (
        "NAV-STATUS",
        pairs("itow=iTOW fix=gpsFix flags=flags differential=fixStat flags2=flags2 ttff=ttff uptime=msss"),
    ),
    "poll_version.request": ("MON-VER", {}),
    "poll_version.response": ("MON-VER", pairs("software=swVersion hardware=hwVersion extensions=text")),
    "nav_sat": ("NAV-SAT", pairs("itow=iTOW satellites=gnssId")),
    "ack": ("ACK-ACK", pairs("class=clsID number=msgID")),
    "nak": ("ACK-NAK", pairs("class=clsID number=msgID")),
    "nav_pvt": (
        "NAV-PVT",
        pairs("""
            itow=iTOW year=year month=month day=day hour=hour minute=min second=second valid=valid
            time_accuracy=tAcc nano=nano fix=fixType flags=flags flags2=flags2 satellites=numSV longitude=lon
            latitude=lat height=height altitude=hMSL horizontal_accuracy=hAcc vertical_accuracy=vAcc
            north=velN east=velE down=velD ground_speed=gSpeed motion_heading=headMot speed_accuracy=sAcc
            heading_accuracy=headAcc dilution=pDOP flags3=flags3 vehicle_heading=headVeh declination=magDec
            declination_accuracy=magAcc
        """),
    ),
}
#: List to its records: each field to its attribute, which has the number of the record at its end.
_RECORDS: Mapping[str, Mapping[str, str]] = {
    "extensions": pairs("text=extension"),
    "satellites": pairs(
        "system=gnssId number=svId strength=cno elevation=elev azimuth=azim residual=prRes flags=flags"
    ),
}
_TEXTS = {"software": 30, "hardware": 10, "text": 30}
#: Messages that have them.
_LISTS = frozenset({"nav_sat", "poll_version.response"})
_BITS = {"flags": 1, "flags2": 1, "flags3": 2, "valid": 1, "fixStat": 1}
UNKNOWN: frozenset[str] = frozenset()


def build(record: Record) -> bytes | None:
    identity, named = _KINDS[record["message"]]
    if record["fields"].get("extensions"):
        return None  # it only reads lists without a count
    given: dict[str, Any] = {}
    for each, value in record["fields"].items():
        if isinstance(value, list):
            given |= _listed(each, value)
        else:
            given[named[each]] = _given(each, named[each], value)
    if record["message"] == "nav_sat":
        given |= {"version": 1, "numSvs": len(record["fields"]["satellites"])}
    sets = record["message"].startswith("set_")
    mode = SET if sets else POLL if record["message"].endswith(".request") else GET
    return bytes(UBXMessage(identity[:3], identity, mode, parsebitfield=0, **given).serialize())


def _listed(name: str, records: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    named = _RECORDS[name]
    return {
        f"{named[each]}_{number:02}": _given(each, named[each], value, size=4)
        for number, record in enumerate(records, 1)
        for each, value in record.items()
    }


def _given(field: str, attribute: str, value: Any, *, size: int = 0) -> Any:
    if attribute in _BITS:
        return int(value).to_bytes(size or _BITS[attribute], "little")
    if isinstance(value, str):
        return _ENUMS[field].index(value) if field in _ENUMS else value.encode().ljust(_TEXTS[field], b"\0")
    # It cuts off what is less than a step.
    return value * (1 + 1e-12) if isinstance(value, float) else value


def read(wire: bytes, direction: Direction) -> Record | None:
    mode = SETPOLL if direction == "request" else GET
    found = UBXReader.parse(wire, msgmode=mode, parsebitfield=0)
    names = [each for each, (identity, _) in _KINDS.items() if identity == found.identity]
    name = next(each for each in names if each.endswith(".request") == (direction == "request"))
    fields = {
        each: _records(each, found)
        if each in _RECORDS and name in _LISTS
        else _read(each, getattr(found, attribute))
        for each, attribute in _KINDS[name][1].items()
    }
    return {"message": name, "fields": fields}


def _records(name: str, found: Any) -> list[Mapping[str, Any]]:
    named = _RECORDS[name]
    numbers = itertools.count(1)
    first = next(iter(named.values()))
    present = itertools.takewhile(lambda number: hasattr(found, f"{first}_{number:02}"), numbers)
    return [
        {each: _read(each, getattr(found, f"{attribute}_{number:02}")) for each, attribute in named.items()}
        for number in present
    ]


def _read(field: str, value: Any) -> Any:
    if isinstance(value, bytes) and field in _TEXTS:
        return value.rstrip(b"\0").decode()
    if isinstance(value, bytes):
        return int.from_bytes(value, "little")
    if isinstance(value, float):
        return round(value, 7)
    return dict(enumerate(_ENUMS.get(field, ()))).get(value, value)
