"""Check values anywhere in a frame: by hand, and the same in every output."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from qlinkgen.backends import python
from qlinkgen.model.checksum import Algorithm, find
from qlinkgen.plan import plan_of
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.dissect import dissect
from qlinkgen.plan.reading import BadFrame
from qlinkgen.plan.receive import receiver
from qlinkgen.plan.spans import Rule
from qlinkgen.plan.tree import Plan
from qlinkgen.schema import loads
from tests.support.whole.trial import Effort, run_text

_HEAD = """\
qlinkgen: 1
protocol: {name: tank, title: Tank, revision: "1", source: Example, doc: A tank}
byteorder: big
bus: {kind: master_slave}
attributes: {extra: {type: u16}, salt: {type: u8}}
messages:
  log: {id: 5, attributes: {extra: 0x1234, salt: 5}, fields: {note: "bytes[0..40]"}}
  state:
    id: 6
    direction: response
    attributes: {extra: 0, salt: 7}
    fields: {level: {type: u16, range: 0..1000}}
frame:
  parts:
"""
_TWO = """\
    start: AA
    length: {type: u8, counts: [data]}
    code: {role: message, type: u8}
    head: {type: u8, algorithm: xor8, over: [length, code]}
    data: {role: payload, size: 0..40}
    sum: {type: u16, algorithm: sum16, over: [start, head, data]}
"""
#: The link layer of DNP3, with its user data as the payload.
_DNP3 = """\
    start: 05 64
    length: {type: u8, counts: [control, code, source, data]}
    control: {type: u8, const: 0xF3}
    code: {role: message, type: u16, byteorder: little}
    source: {type: u16, byteorder: little, const: 0x0400}
    crc: {type: u16, byteorder: little, algorithm: crc-16/dnp, over: [start, length, control, code, source]}
    data: {role: payload, size: 0..40}
    blocks: {type: u16, byteorder: little, algorithm: crc-16/dnp, over: [data], every: 16 bytes}
"""
SHAPES = {
    "a check value of the header, and one over it": _TWO,
    "one before the payload that covers the end": """\
    start: AA 55
    crc: {type: u16, byteorder: little, algorithm: crc-16/modbus, over: [start, length, code, data, stop]}
    length: {type: u16, counts: [crc, data, stop]}
    code: {role: message, type: u8}
    data: {role: payload, size: 0..40}
    stop: 0D 0A
""",
    "one that comes first, and covers another": """\
    all: {type: u32, algorithm: adler-32, over: [kind, code, length, data, sum]}
    kind: 11
    code: {role: message, type: u8}
    length: {type: u8, counts: [data]}
    data: {role: payload, size: 0..40}
    sum: {type: u8, algorithm: sum8-zero, over: [length, data]}
    stop: 03
""",
    "one over the payload, which may be empty, with a start of its own": """\
    start: AA
    length: {type: u8, counts: [data]}
    code: {role: message, type: u8}
    head: {type: u8, algorithm: sum8, init: 0x55, over: [length, code]}
    data: {role: payload, size: 0..40}
    crc: {type: u16, algorithm: crc-16/modbus, init: 0x1234, over: [data], otherwise: 0xBEEF}
""",
    "one over numbers of the message that are not sent": """\
    start: FD
    length: {type: u8, counts: [data]}
    code: {role: message, type: u8}
    sum: {type: u8, algorithm: sum8, over: [attribute.salt, length]}
    data: {role: payload, size: 0..40}
    crc: {type: u16, algorithm: crc-16/mcrf4xx, over: [length, code, data, attribute.extra, attribute.salt]}
""",
    "one after each block of the payload, and one over the header": _DNP3,
    "one over the header alone, which can be replaced": """\
    start: AA
    length: {type: u8, counts: [data]}
    code: {role: message, type: u8}
    head: {type: u16, algorithm: crc-16/modbus, over: [length, code]}
    data: {role: payload, size: 0..40}
""",
    "in decimal digits, all and the last ones": """\
    start: 02
    code: {role: message, type: u8}
    length: {type: u8, counts: [data]}
    data: {role: payload, size: 0..40}
    sum: {type: u8, as: "decimal[3]", algorithm: sum8, over: [code, length, data]}
    crc: {type: u16, as: "decimal[4]", algorithm: crc-16/modbus, over: [code, length, data]}
    end: 0D
""",
    "two of one algorithm in a stuffed frame": """\
    start: A5 A5
    length: {type: u8, counts: [data]}
    code: {role: message, type: u8}
    head: {type: u16, algorithm: crc-16/xmodem, over: [start, code]}
    data: {role: payload, size: 0..40}
    crc: {type: u16, algorithm: crc-16/xmodem, over: [data]}
  stuffing: {after: 0xA5, insert: 0x00, exempt: [start]}
""",
}


def plan(parts: str) -> Plan:
    protocol, faults = loads(_HEAD + parts, "tank.yaml")
    assert protocol, faults
    return plan_of(protocol)


@pytest.mark.slow
@pytest.mark.parametrize("parts", SHAPES.values(), ids=SHAPES)
def test_outputs_agree(parts: str, require_tool: Callable[..., str]) -> None:
    for compiler, package in (("gcc", "gcc"), ("g++", "g++"), ("clang", "clang"), ("clang++", "clang")):
        require_tool(compiler, package=package)
    outcome = run_text(_HEAD + parts, effort=Effort(streams=40, every=True))
    assert not outcome.refused
    assert not outcome.differences, outcome.report()


def test_a_frame_by_hand() -> None:
    # 03 ^ 05 = 06; AA + 06 + 01 + 02 + 03 = 00B6.
    frame = bytes.fromhex("aa 03 05 06 010203 00b6")
    assert Codec(plan(_TWO)).encode("log", {"note": b"\1\2\3"}) == frame


def test_decimal_digits() -> None:
    found = plan(SHAPES["in decimal digits, all and the last ones"])
    frame = Codec(found).encode("log", {"note": b"\1\xff"})
    # 05 + 02 + 01 + FF = 107, without the carry 007; of the five digits of the CRC, the last four are sent.
    crc = find("crc-16/modbus").compute(frame[1:5])
    assert frame == bytes.fromhex("02 05 02 01ff") + b"007" + str(crc)[-4:].encode() + b"\r"
    codec = python.load(found.protocol)
    assert codec.Log(note=b"\1\xff").to_frame() == frame
    for wrong in (frame[:-2] + b"x\r", frame.replace(b"007", b"\x00\x00\x07")):
        with pytest.raises(BadFrame, match="crc"):
            Codec(found).decode(wrong, "request")
        with pytest.raises(codec.DecodeError, match="check"):
            codec.decode_request(wrong)


def test_numbers_that_are_not_sent() -> None:
    found = plan(SHAPES["one over numbers of the message that are not sent"])
    codec = Codec(found)
    frame = codec.encode("log", {"note": b"\7"})
    covered = bytes.fromhex("01 05 07 1234 05")
    assert frame == bytes.fromhex("fd 01 05 06 07") + find("crc-16/mcrf4xx").compute(covered).to_bytes(
        2, "big"
    )
    # The check value of an unknown message cannot be verified, so it proves nothing.
    unknown = frame[:2] + b"\x09" + frame[3:]
    events = receiver(found, "request").run(unknown + frame)
    assert [(event.kind, event.offset) for event in events] == [("unknown", 0), ("message", len(unknown))]
    hidden = unknown[:4] + frame  # a false start of five bytes, whose length reaches into the frame
    assert receiver(found, "request").run(hidden)[-1].kind == "message"


def test_a_check_value_after_each_block() -> None:
    found = plan(_DNP3)
    data = bytes.fromhex("c0c3013c02063c03063c04063c0106")
    # Class 0 to 3 poll, as printed in introductions to DNP3; the destination is 1.
    wire = bytes.fromhex("056414f3010000040a3b" + data.hex() + "9a12")
    text = (_HEAD + _DNP3).replace("id: 5", "id: 1")
    protocol, faults = loads(text, "tank.yaml")
    assert protocol, faults
    assert Codec(plan_of(protocol)).encode("log", {"note": data}) == wire
    long = Codec(found).encode("log", {"note": bytes(range(40))})
    assert len(long) == 10 + 16 + 2 + 16 + 2 + 8 + 2
    assert Codec(found).decode(long, "request").values == {"note": bytes(range(40))}
    for at in range(10, len(long)):
        with pytest.raises(BadFrame, match="crc"):
            Codec(found).decode(long[:at] + bytes((long[at] ^ 1,)) + long[at + 1 :], "request")
    wrong = dissect(found, long[:30] + b"\0" + long[31:], "request")
    assert [(fault.rule, fault.at) for fault in wrong.faults] == [(Rule.CHECK, 44)]


def test_a_value_where_there_is_nothing_to_cover() -> None:
    found = plan(SHAPES["one over the payload, which may be empty, with a start of its own"])
    # 55 + 00 + 05 = 5A.
    assert Codec(found).encode("log", {"note": b""}) == bytes.fromhex("aa 00 05 5a beef")


def test_a_wrong_header_is_refused_before_its_payload() -> None:
    """The length is wrong; the next frame is delivered without waiting for the bytes that it announces."""
    found = plan(_TWO)
    good = Codec(found).encode("state", {"level": 7})
    wrong = bytes.fromhex("aa 28 06 00")
    machine = receiver(found, "response")
    events = [event for byte in wrong + good for event in machine.feed(byte)]
    assert [(event.kind, event.at, event.raw) for event in events] == [
        ("crc", 3, wrong),
        ("message", len(wrong + good) - 1, good),
    ]
    decoder = python.load(found.protocol).StreamDecoder("response")
    assert [type(each).__name__ for each in decoder.feed(wrong + good)] == ["Fault", "State"]


def test_explain_names_the_wrong_one() -> None:
    found = plan(_TWO)
    for wire, part in (("aa 03 05 07 010203 00b7", "head"), ("aa 03 05 06 010203 00b7", "sum")):
        seen = dissect(found, bytes.fromhex(wire), "request")
        assert seen.kind == "crc"
        assert [(fault.rule, getattr(fault.of, "name", "")) for fault in seen.faults] == [(Rule.CHECK, part)]


def test_another_algorithm_replaces_the_one_over_the_payload() -> None:
    protocol, faults = loads(_HEAD + _TWO, "tank.yaml", crc="crc-16/modbus")
    assert protocol, faults
    names = [part.check.algorithm.name for part in plan_of(protocol).frame.envelope.checks]
    assert names == ["xor8", "crc-16/modbus"]


@pytest.mark.parametrize("parts", SHAPES.values(), ids=SHAPES)
def test_another_algorithm_at_run_time(parts: str) -> None:
    """Codec(crc) of a module codes like the module of a schema with that algorithm."""
    codec = python.load(plan(parts).protocol)
    main = plan(parts).frame.check
    assert main is not None
    if not isinstance(main.algorithm, Algorithm) or main.algorithm.width != 16:
        assert not hasattr(codec, "Codec")
        return
    other, faults = loads(_HEAD + parts, "tank.yaml", crc="crc-16/genibus")
    assert other, faults
    there, here = python.load(other), codec.Codec("crc-16/genibus")
    messages = [codec.Log(note=bytes(range(size))) for size in (0, 1, 16, 17, 40)]
    frames = [there.Log(note=message.note).to_frame() for message in messages]
    assert [here.encode(message) for message in messages] == frames
    assert [here.decode_request(frame) for frame in frames] == messages
    assert here.StreamDecoder("request").feed(b"\xaa" + b"".join(frames))[-len(frames) :] == messages
    with pytest.raises(codec.DecodeError, match="check"):
        codec.decode_request(frames[-1])
