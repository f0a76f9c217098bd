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
    "reset_link.request": (0, True), "test_link.request": (2, True), "confirmed_data.request": (3, True),
    "unconfirmed_data.request": (4, True), "request_status.request": (9, True), "ack": (0, False),
    "nack": (1, False), "request_status.response": (11, False), "not_supported": (15, False),
}  # fmt: skip
#: Functions of a primary station whose frame count bit counts.
_COUNTED = (2, 3)
UNKNOWN: frozenset[str] = frozenset()


def build(record: Record) -> bytes | None:
    function, primary = _KINDS[record["message"]]
    count, valid = record.get("count", False), function in _COUNTED if primary else record["full"]
    control = ControlByte(record["from_master"], primary, count, valid, function)
    data = bytes.fromhex(record["fields"].get("data", ""))
    ends = (record["node"], record["master"])
    destination, source = ends if primary else reversed(ends)
    return bytes(DataLinkFrame.build(destination, source, control, data).to_bytes())


def read(wire: bytes, direction: Direction) -> Record | None:
    (frame,) = FrameParser().feed(wire)
    header, control = frame.header, frame.header.control
    kind = (control.function_code, control.prm)
    name = next(name for name, each in _KINDS.items() if each == kind)
    return {
        "message": name,
        "node": header.destination if control.prm else header.source,
        "master": header.source if control.prm else header.destination,
        "from_master": control.dir_from_master,
        **({"count": control.fcb} if control.prm else {"full": control.fcv}),
        "fields": {"data": frame.user_data.hex()} if frame.user_data else {},
    }
