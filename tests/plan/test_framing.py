"""What follows from the parts of a frame: the receiver above all."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from qlinkgen.model.integer import Chunk
from qlinkgen.plan import plan_of
from qlinkgen.plan.ends import ByMessage, Hunt, Rescan
from qlinkgen.plan.framing import FramePlan
from qlinkgen.plan.parts import MarkPart
from qlinkgen.plan.transparency import FrameStuffing
from qlinkgen.schema import loads
from qlinkgen.schema.loader import load

_ROOT = Path(__file__).resolve().parents[2]
_SCHEMA = """
qlinkgen: 1
protocol: {name: shape, title: Shape, revision: "1", source: Tests, doc: A shape}
byteorder: big
frame: {parts: {PARTS}, stuffing: {STUFFING}}
bus: {kind: master_slave, nodes: 1..16, response_within: 5 ms}
defaults: {addressing: node, repeat: safe}
commands:
  own: {id: 1, request: {a: "bytes[SIZE]"}, response: {b: "bytes[SIZE]"}}
"""
#: A frame that is hunted for: its preamble is the stuffed byte twice and cannot appear elsewhere.
_PARTS = {
    "start": "{role: constant, value: A5 A5}",
    "size": "{role: length, type: u8, counts: [data]}",
    "id": "{role: message, type: u8}",
    "node": "{role: address, type: u8}",
    "data": "{role: payload, size: 0..40}",
    "check": "{role: checksum, type: u16, algorithm: crc-16/xmodem, over: [size, id, node, data]}",
}
_STUFFING = "after: 0xA5, insert: 0x00, exempt: [start]"


def _frame(parts: Mapping[str, str], stuffing: str = _STUFFING, size: str = "0..9") -> FramePlan:
    listed = ", ".join(f"{name}: {part}" for name, part in parts.items() if part)
    text = _SCHEMA.replace("PARTS", listed).replace("STUFFING", stuffing).replace("SIZE", size)
    if "address" not in listed:
        text = text.replace(", nodes: 1..16", "").replace("addressing: node, ", "")
    protocol, faults = loads(text, "shape.yaml")
    assert protocol is not None, [str(fault) for fault in faults]
    return plan_of(protocol).frame


def test_a_preamble_that_cannot_be_data_is_hunted_for() -> None:
    frame = _frame(_PARTS)
    assert frame.receiver == Hunt(0xA5, 0x00)
    assert isinstance(frame.transparency, FrameStuffing)
    assert (frame.transparency.front, frame.transparency.back) == (2, 0)


@pytest.mark.parametrize("sizes", ["0..164", "166..200", "166..166"])
def test_a_length_that_cannot_be_the_byte_is_hunted_for(sizes: str) -> None:
    frame = _frame({**_PARTS, "data": f"{{role: payload, size: {sizes}}}"}, size=sizes)
    assert isinstance(frame.receiver, Hunt)


@pytest.mark.parametrize("sizes", ["0..165", "165..165", "165..200", "160..170"])
def test_a_length_that_can_be_the_byte_is_searched_for(sizes: str) -> None:
    frame = _frame({**_PARTS, "data": f"{{role: payload, size: {sizes}}}"}, size=sizes)
    assert isinstance(frame.receiver, Rescan)


def test_the_order_of_check_bytes_does_not_matter() -> None:
    little = _PARTS["check"].replace("algorithm", "byteorder: little, algorithm")
    assert isinstance(_frame({**_PARTS, "check": little}).receiver, Hunt)


_OTHERS = {
    "three": ({"start": "{role: constant, value: A5 A5 A5}"}, _STUFFING),
    "two_stuffed": (
        {"start": "{role: constant, value: A5 A5 A5 A5}"},
        "after: A5 A5, insert: 0x00, exempt: [start]",
    ),
    "inserts_itself": ({}, "after: 0xA5, insert: 0xA5, exempt: [start]"),
    "check_is_exempt": ({}, "after: 0xA5, insert: 0x00, exempt: [start, check]"),
    "length_is_exempt": ({}, "after: 0xA5, insert: 0x00, exempt: [start, size]"),
    "wide_length": ({"size": "{role: length, type: u16, counts: [data]}"}, _STUFFING),
    "wide_id": ({"id": "{role: message, type: u16}"}, _STUFFING),
    "length_not_covered": ({"check": _PARTS["check"].replace("size, ", "")}, _STUFFING),
    "preamble_covered": ({"check": _PARTS["check"].replace("[size", "[start, size")}, _STUFFING),
    "constant_end": ({"end": "{role: constant, value: 0D}"}, _STUFFING),
    "constant_inside": ({"node": "{role: constant, value: 0D}"}, _STUFFING),
    "no_check": ({"check": ""}, _STUFFING),
    "no_length": ({"size": "", "check": _PARTS["check"].replace("size, ", "")}, _STUFFING),
}


@pytest.mark.parametrize("name", _OTHERS)
def test_every_other_frame_is_searched_for(name: str) -> None:
    changes, stuffing = _OTHERS[name]
    assert isinstance(_frame({**_PARTS, **changes}, stuffing, size="9..9").receiver, Rescan)


def test_a_length_later_in_the_frame_is_searched_for() -> None:
    parts = {name: _PARTS[name] for name in ("start", "id", "size", "node", "data", "check")}
    parts["check"] = parts["check"].replace("size, id", "id, size")
    assert isinstance(_frame(parts).receiver, Rescan)


def test_the_only_kind_of_frame_is_looked_for_though_it_is_its_payload() -> None:
    text = (
        'qlinkgen: 1\nprotocol: {name: plain, revision: "1", source: test}\nbyteorder: big\n'
        "frame: {parts: {data: {role: payload, size: 0..9}}}\nbus: {kind: master_slave}\n"
        "messages: {state: {fields: {a: u8, b: u16}}}\n"
    )
    protocol, faults = loads(text, "plain.yaml")
    assert protocol, faults
    plan = plan_of(protocol)
    assert plan.frame.end == ByMessage()
    assert not any(each.turned for each in plan.messages)


@pytest.mark.parametrize(
    ("address", "number"),
    [(Chunk(0, 4), Chunk(4, 3)), (Chunk(3, 4), Chunk(0, 3)), (Chunk(1, 2), Chunk(4, 2))],
)
def test_a_mark_holds_an_address_and_a_number(address: Chunk, number: Chunk) -> None:
    header = MarkPart("header", 0x80, "node", address, "kind", number, end_id=None)
    end = MarkPart("end", 0x80, "node", address, "kind", number, end_id=3)
    for node in range(1 << address.bits):
        for kind in range(1 << number.bits):
            byte = header.byte(kind, node)
            assert byte == 0x80 + (node << address.shift) + (kind << number.shift)
            assert (header.id_of(byte), header.address_of(byte)) == (kind, node)
            assert end.byte(kind, node) == header.byte(3, node)


@pytest.mark.parametrize(
    ("path", "bounds"),
    [
        ("schemas/qlink.yaml", (0, 26, 26)),
        ("schemas/trio.yaml", (0, 256, 256)),
        ("schemas/mc1231a.yaml", (0, 4, 4)),
        ("tests/schemas/dynamixel.yaml", (0, 256, 341)),
    ],
)
def test_the_bounds_of_a_payload(path: str, bounds: tuple[int, int, int]) -> None:
    payload = plan_of(load(_ROOT / path)).frame.envelope.payload
    assert (payload.least, payload.most, payload.most_sent) == bounds
