"""The link layer of DNP3 by dnp3py."""

from __future__ import annotations

from collections.abc import Mapping

from dnp3.datalink.control import ControlByte
from dnp3.datalink.frame import DataLinkFrame
from dnp3.datalink.parser import FrameParser

from qlinkgen.model.message import Direction
from tests.library.protocols import Record

#: Message to its function, and whether a primary station sends it.
_KINDS: Mapping[str, tuple[int, bool]] = {
    "reset_link": (0, True), "test_link": (2, True), "confirmed_data": (3, True),
    "unconfirmed_data": (4, True), "request_status": (9, True), "ack": (0, False), "nack": (1, False),
    "status": (11, False), "not_supported": (15, False),
}  # fmt: skip
UNKNOWN: frozenset[str] = frozenset()


def build(record: Record) -> bytes | None:
    function, primary = _KINDS[record["message"]]
    control = ControlByte(record["master"], primary, record["count"], record["valid"], function)
    data = bytes.fromhex(record["fields"].get("data", ""))
    return bytes(DataLinkFrame.build(record["destination"], record["source_"], control, data).to_bytes())


def read(wire: bytes, direction: Direction) -> Record | None:
    (frame,) = FrameParser().feed(wire)
    header, control = frame.header, frame.header.control
    kind = (control.function_code, control.prm)
    name = next(name for name, each in _KINDS.items() if each == kind)
    return {
        "message": name,
        "destination": header.destination,
        "source_": header.source,
        "master": control.dir_from_master,
        "count": control.fcb,
        "valid": control.fcv,
        "fields": {"data": frame.user_data.hex()} if frame.user_data else {},
    }
