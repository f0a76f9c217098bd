"""CRSF by crsf-parser."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from crsf_parser.frames import crsf_frame
from crsf_parser.handling import crsf_build_frame, crsf_frame_crc
from crsf_parser.payloads import PacketsTypes

from qlinkgen.model.message import Direction
from tests.library.protocols import Record, pairs

#: Message to its number, and each field to its name in the library.
_KINDS: Mapping[str, tuple[Any, Mapping[str, str]]] = {
    "battery": (
        PacketsTypes.BATTERY_SENSOR,
        pairs("voltage=voltage current=current used=capacity remaining=remaining"),
    ),
    "rc_channels": (PacketsTypes.RC_CHANNELS_PACKED, pairs("channels=channels")),
    "link_statistics": (
        PacketsTypes.LINK_STATISTICS,
        pairs("""
            up_rssi_1=uplink_rssi_ant_1 up_rssi_2=uplink_rssi_ant_2 up_quality=uplink_link_quality
            up_snr=uplink_snr antenna=diversity_active_antenna mode=rf_mode up_power=uplink_tx_power
            down_rssi=downlink_rssi down_quality=downlink_link_quality down_snr=downlink_snr
        """),
    ),
}
#: The library has integers.
_STEPS = {"voltage": 10, "current": 10}
#: It has no layout of these, and reads one byte of the two of a heartbeat.
UNKNOWN = frozenset({"attitude", "flight_mode", "gps", "heartbeat", "vario"})


def _steps(field: str, value: Any) -> Any:
    return round(value * _STEPS[field]) if field in _STEPS else value


def build(record: Record) -> bytes | None:
    if record["message"] in UNKNOWN:
        return None
    number, named = _KINDS[record["message"]]
    given = {named[each]: _steps(each, value) for each, value in record["fields"].items()}
    # Its list begins with the last channel.
    given |= {"channels": given["channels"][::-1]} if "channels" in given else {}
    return bytes(crsf_build_frame(number, given))


def read(wire: bytes, direction: Direction) -> Record | None:
    name = next((each for each, (number, _) in _KINDS.items() if number == wire[2]), None)
    if name is None:
        return None
    found = crsf_frame.parse(wire)
    assert crsf_frame_crc(wire) == found.CRC
    fields = {}
    for each, attribute in _KINDS[name][1].items():
        value = found.payload[attribute]
        fields[each] = list(value)[::-1] if isinstance(value, list) else int(value) / _STEPS.get(each, 1)
    return {"message": name, "fields": fields}
