"""Frames that a terminator ends: known frames, order of faults, and intact frames in damaged streams."""

from __future__ import annotations

import random

import pytest

from qlinkgen.plan import Plan, plan_of
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.ends import ByTerminator, Rescan
from qlinkgen.plan.reading import BadFrame
from qlinkgen.plan.receive import receiver
from qlinkgen.schema import loads

_SCHEMA = """
qlinkgen: 1
protocol: {{name: sample, revision: "1", source: Made up}}
frame:
  parts:
{parts}
{coding}
bus: {{kind: master_slave, nodes: 1..247, response_within: 1 s}}
defaults: {{addressing: node, repeat: safe}}
commands:
  read: {{id: 3, request: {{start: u16, count: u16}}, response: {{data: bytes}}}}
"""
_MIDDLE = """
    node: {role: address, type: u8}
    function: {role: message, type: u8}
    data: {role: payload, size: 0..20}
"""
_CRC = "    crc: {type: u16, byteorder: little, algorithm: crc-16/ibm-sdlc, over: [node, function, data]}\n"
ASCII = _SCHEMA.format(
    parts='    start: {text: ":"}'
    + _MIDDLE
    + "    lrc: {type: u8, algorithm: sum8-zero, over: [node, function, data]}\n"
    + "    end: {role: terminator, value: 0D 0A}",
    coding="  coding: {digits: hex}",
)
HDLC = _SCHEMA.format(
    parts="    open: 7E" + _MIDDLE + _CRC + "    close: {role: terminator, value: 7E, shared: true}",
    coding="  coding: {escape: 7D, xor: 20, of: [7E, 7D]}",
)
_BARE = _MIDDLE.lstrip("\n")
COBS = _SCHEMA.format(
    parts=_BARE + _CRC + "    close: {role: terminator, value: 00}", coding="  coding: {cobs: 00}"
)
LATE = _SCHEMA.format(
    parts=_BARE + "    close: {role: terminator, value: 0A}\n" + _CRC.replace("data]", "data, close]"),
    coding="  coding: {digits: hex}",
)
SLIP = _SCHEMA.format(
    parts="    open: C0" + _MIDDLE + _CRC + "    close: {role: terminator, value: C0}",
    coding="  coding: {replace: {C0: DB DC, DB: DB DD}}",
)
DLE = _SCHEMA.format(
    parts="    open: 10 02" + _MIDDLE + _CRC + "    close: {role: terminator, value: 10 03}",
    coding="  coding: {insert: 10, after: 10}",
)
FRAMES = {"ascii": ASCII, "hdlc": HDLC, "cobs": COBS, "late": LATE, "slip": SLIP, "dle": DLE}
every_frame = pytest.mark.parametrize("text", FRAMES.values(), ids=FRAMES)


def plan(text: str) -> Plan:
    protocol, faults = loads(text, "sample.yaml")
    assert protocol is not None, faults
    return plan_of(protocol)


def test_known_frames() -> None:
    """Of the Modbus over Serial Line guide, and computed with pyserial's and crcmod's examples."""
    values = {"start": 0x006B, "count": 3}
    assert Codec(plan(ASCII)).encode("read.request", values, 0x11) == b":1103006B00037E\r\n"
    wire = Codec(plan(HDLC)).encode("read.request", {"start": 0x7E7D, "count": 0}, 0x7E)
    assert wire.startswith(b"\x7e\x7d\x5e\x03\x7d\x5e\x7d\x5d\x00\x00")
    assert wire.endswith(b"\x7e")
    wire = Codec(plan(COBS)).encode("read.request", values, 1)
    assert wire[:7] == b"\x03\x01\x03\x02\x6b\x04\x03"


def test_the_plan() -> None:
    frame = plan(HDLC).frame
    assert isinstance(frame.end, ByTerminator)
    assert (frame.end.part.data, frame.end.after, frame.end.shared) == (b"\x7e", 0, True)
    assert frame.flag == b"\x7e"
    assert frame.receiver == Rescan(bare=False, verified=True)
    assert frame.max_wire == 1 + 2 * (2 + 20 + 2) + 1
    assert plan(ASCII).frame.flag == b""


@pytest.mark.parametrize(
    ("wire", "kind"),
    [
        (b"", "truncated"),
        (b":1103006B00037E\r", "truncated"),
        (b"1103006B00037E\r\n", "frame"),
        (b":\r\n", "length"),
        (b":11\r\n", "length"),
        (b":" + b"00" * 30, "length"),
        (b":1103006B00037\r\n", "stuffing"),
        (b":1103006B0003 7E\r\n", "stuffing"),
        (b":1103006b00037e\r\n", ""),
        (b":1103006B00037F\r\n", "crc"),
        (b":1103006B00037F\r\n!", "length"),
        (b":1104006B00037D\r\n", "unknown"),
    ],
)
def test_order_of_faults(wire: bytes, kind: str) -> None:
    codec = Codec(plan(ASCII))
    if not kind:
        assert codec.decode(wire, "request").values == {"start": 0x6B, "count": 3}
        return
    with pytest.raises(BadFrame) as raised:
        codec.decode(wire, "request")
    assert raised.value.kind == kind


def test_a_shared_terminator_begins_the_next_frame() -> None:
    codec = Codec(plan(HDLC))
    wire = codec.encode("read.request", {"start": 1, "count": 2}, 3)
    events = receiver(codec.plan, "request").run(wire + wire[1:] + wire[1:] + b"\x7e\x7e" + wire)
    assert [(event.kind, event.offset) for event in events] == [
        ("message", 0), ("message", 9), ("message", 18), ("message", 30)
    ]  # fmt: skip
    assert all(event.raw == wire for event in events)


def test_a_terminator_is_not_found_across_a_pair() -> None:
    codec = Codec(plan(DLE))
    wire = codec.encode("read.request", {"start": 0x1003, "count": 0x0310}, 0x10)
    assert wire[:-4] == b"\x10\x02\x10\x10\x03\x10\x10\x03\x03\x10\x10"
    assert codec.decode(wire, "request").values == {"start": 0x1003, "count": 0x0310}


@every_frame
def test_intact_frames_after_corruption_are_delivered(text: str) -> None:
    codec, rng = Codec(plan(text)), random.Random(text)
    alphabet = b"\x10\x02\x00\x7e\x7d:0A\r\n\x01\x03\xff"
    for _ in range(60):
        stream, intact = b"", []
        for _ in range(rng.randint(1, 5)):
            noise = bytes(rng.choice(alphabet) for _ in range(rng.choice((0, 0, 1, 3, 9))))
            values = {"start": rng.choice((0, 0x7E7E, 0x0D0A)), "count": rng.randrange(65536)}
            wire = codec.encode("read.request", values, rng.randint(1, 247))
            stream += noise
            if rng.random() < 0.4:
                at = rng.randrange(len(wire))
                stream += wire[:at] + bytes((rng.choice(alphabet),)) * rng.randint(0, 1) + wire[at + 1 :]
            else:
                intact.append(len(stream))
                stream += wire
        events = receiver(codec.plan, "request").run(stream)
        found = {event.offset for event in events if event.kind == "message"}
        assert found >= set(intact), stream.hex(" ")


LINE = _SCHEMA.format(
    parts=_BARE + "    end: {role: terminator, value: 0D 0A}", coding="  coding: {digits: hex}"
)


@pytest.mark.parametrize(
    ("stream", "found"),
    [
        (b"0103000100020103\r\n", [("frame", 0)]),
        (b"FF0103006B0003\r\n0103006B0003\r\n", [("frame", 0), ("message", 16)]),
        (b"\r0103006B0003\r\n0103006B0003\r\n", [("frame", 0), ("message", 15)]),
        (b"\r\n0103006B0003\r\n", [("message", 2)]),
        (b"0" * 60 + b"0103006B0003\r\n", [("frame", 0), ("frame", 46)]),
    ],
)
def test_without_check_and_beginning_a_frame_begins_after_a_terminator(
    stream: bytes, found: list[tuple[str, int]]
) -> None:
    made = plan(LINE)
    assert made.frame.lines
    events = receiver(made, "request").run(stream)
    assert [(event.kind, event.offset) for event in events] == found


def test_a_wrong_byte_of_the_beginning_is_found_at_once() -> None:
    text = DLE.replace("open: 10 02", "open: 10 02 01")
    assert receiver(plan(text), "request").run(b"\x10\x65") == []
    assert [event.kind for event in receiver(plan(text), "request").run(b"\x10\x02")] == ["truncated"]


def test_only_such_frames_wait_for_a_terminator() -> None:
    assert not any(plan(text).frame.lines for text in FRAMES.values())
