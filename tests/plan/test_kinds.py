"""Several kinds of frame in one protocol: which is sent, and which is found in a damaged stream."""

from __future__ import annotations

import random

import pytest

from qlinkgen.backends import construct
from qlinkgen.backends.python import load as load_codec
from qlinkgen.plan import Plan, plan_of
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.dissect import dissect
from qlinkgen.plan.reading import BadFrame
from qlinkgen.plan.receive import Event, receiver
from qlinkgen.plan.select import Options
from qlinkgen.schema import find, load
from qlinkgen.schema.loader import loads

_LOST = b"\x00\x16"


@pytest.fixture(scope="module")
def vesc() -> Plan:
    return plan_of(load(find("vesc")))


@pytest.fixture(scope="module")
def mbus() -> Plan:
    return plan_of(load(find("mbus")))


def heard(plan: Plan, stream: bytes) -> list[tuple[str, int]]:
    def called(event: Event) -> str:
        return event.decoded.message.name if event.decoded else event.kind

    return [(called(event), event.offset) for event in receiver(plan, "response").run(stream)]


@pytest.mark.parametrize(
    ("size", "start"), [(53, "02 36"), (254, "02 FF"), (255, "03 01 00"), (511, "03 02 00")]
)
def test_the_size_picks_the_kind(vesc: Plan, size: int, start: str) -> None:
    wire = Codec(vesc).wrap("get_values.response", bytes(size))
    assert wire.startswith(bytes.fromhex(start))
    assert len(Codec(vesc).decode(wire, "response").payload) == size


def test_the_greatest_frame_is_of_the_longest_kind(vesc: Plan) -> None:
    by_name = vesc.by_name
    assert by_name["get_values.response"].wire_size == 511 + 7
    assert by_name["set_duty.request"].wire_size == 4 + 6
    assert vesc.frame.max_wire == 511 + 7


def test_a_long_frame_of_a_short_payload_is_none(vesc: Plan) -> None:
    message = vesc.by_name["get_values.response"]
    codec, long = Codec(vesc), message.frames[-1]
    with pytest.raises(BadFrame, match="length"):
        codec.decode(codec.join(message, codec.cells(message, bytes(99), frame=long), frame=long), "response")


def test_ids_of_different_kinds_do_not_clash(mbus: Plan) -> None:
    codec = Codec(mbus)
    assert codec.wrap("initialise.request", b"", 1) == bytes.fromhex("10 40 01 41 16")
    assert codec.wrap("ack", b"") == b"\xe5"
    numbers = [(each.frames[-1].name, each.number) for each in mbus.messages]
    # The control byte has bits of one direction, so requests and responses are of different kinds.
    assert ("short_request", 32) in numbers
    assert ("ack", 0) in numbers
    assert len({each.id for each in mbus.messages}) == len(numbers)
    assert codec.decode(b"\xe5", "response").address is None


@pytest.mark.parametrize(
    ("wire", "kind"),
    [
        ("", "truncated"),
        ("10 40 01", "truncated"),
        ("11 40 01 41 16", "frame"),
        ("10 40 01 42 16", "crc"),
        ("10 41 01 42 16", "unknown"),
        ("10 40 01 41 17", "frame"),
        ("10 40 01 41 16 E5", "length"),
        ("68 03 04 68 53 01 50 A4 16", "frame"),
        ("68 03 03 69 53 01 50 A4 16", "frame"),
        ("68 02 02 68 53 01 50 A4 16", "length"),
    ],
)
def test_each_kind_is_judged_by_its_own_rules(mbus: Plan, wire: str, kind: str) -> None:
    data = bytes.fromhex(wire)
    with pytest.raises(BadFrame) as caught:
        Codec(mbus).decode(data, "request")
    assert caught.value.kind == kind
    found = dissect(mbus, data, "request")
    assert (found.kind, kind in {fault.kind for fault in found.faults}) == (kind, True)


def test_frames_of_all_kinds_are_found_between_noise(mbus: Plan) -> None:
    codec = Codec(mbus)
    long = codec.wrap("read.response", bytes(20), 5)
    stream = long + _LOST + b"\xe5" + long[:-3] + b"\xe5" + long
    assert heard(mbus, stream) == [
        ("read.response", 0),
        ("ack", len(long) + 2),
        ("frame", len(long) + 3),
        ("ack", 2 * len(long)),
        ("read.response", 2 * len(long) + 1),
    ]


def test_no_intact_frame_is_lost_after_a_corruption(vesc: Plan) -> None:
    rng, codec = random.Random(1), Codec(vesc)
    for _ in range(40):
        payloads = [rng.randbytes(rng.choice((53, 60, 300))) for _ in range(5)]
        frames = [codec.wrap("get_values.response", each) for each in payloads]
        hit = bytearray(frames[2])
        hit[rng.randrange(len(hit))] ^= 1 << rng.randrange(8)
        frames[2] = bytes(hit)
        # A corrupted length may announce bytes of a later frame until the stream ends.
        events = receiver(vesc, "response").run(b"".join(frames))
        found = [event.raw for event in events if event.decoded]
        assert [each for each in frames if each in found] == [*frames[:2], *frames[3:]]


MIXED = """
qlinkgen: 1
protocol: {name: mixed, revision: "1", source: Made up}
byteorder: little
frames:
  line:
    parts:
      start: {text: "$"}
      code: {role: message, type: "text[2]"}
      data: {role: payload, size: 0..20}
      star: {role: terminator, text: "*"}
      sum: {type: u8, as: "hex[2]", algorithm: xor8, over: [code, data]}
  packet:
    parts:
      start: B5 62
      code: {role: message, type: u8}
      length: {type: u8, counts: data}
      data: {role: payload, size: 0..20}
      sum: {type: u16, algorithm: fletcher-8, over: [code, length, data]}
bus: {kind: link}
commands: {}
messages:
  depth: {frame: line, id: DP, separator: ",", fields: {depth: {type: u32, as: decimal}}}
  speed: {frame: packet, id: 7, fields: {speed: u32}}
"""


def test_lines_and_packets_share_a_stream() -> None:
    protocol, faults = loads(MIXED, "mixed.yaml")
    assert protocol is not None, faults
    plan = plan_of(protocol)
    codec, generated = Codec(plan), load_codec(protocol)
    line, packet = codec.encode("depth", {"depth": 76}), codec.encode("speed", {"speed": 0x2A24})
    assert line == b"$DP76*15"
    # The packet holds the bytes that begin and end a line.
    stream = b"$*" + packet + line[:-1] + packet + line + b"$" + line
    found = [
        (event.decoded.message.name, event.offset)
        for event in receiver(plan, "message").run(stream)
        if event.decoded
    ]
    assert found == [("speed", 2), ("speed", 19), ("depth", 29), ("depth", 38)]
    decoder = generated.StreamDecoder("message")
    heard = [event for byte in stream for event in decoder.feed(bytes((byte,)))]
    assert [each.NAME for each in heard if hasattr(each, "NAME")] == [name for name, _ in found]
    assert generated.decode(line).depth == 76
    for wire in (line, packet):
        assert [fault.kind for fault in dissect(plan, wire, "message").faults] == []
    with pytest.raises(BadFrame, match="length"):
        codec.decode(b"$*", "message")


_LED = """\
qlinkgen: 1
protocol: {name: sample, revision: "1", source: Made up}
byteorder: big
frames:
  command: {parts: {code: {role: message, type: u8}, inverse: {type: u8, equals: ~code}}}
  data:
    parts:
      code: {role: message, type: u16}
      data: {role: payload, size: 0..9}
      sum: {type: u8, algorithm: sum8, over: [code, data]}
  ack: {parts: {byte: 79}}
bus: {kind: master_slave}
defaults: {frame: command, addressing: none, repeat: safe}
messages: {ack: {frame: ack, direction: response, fields: {}}}
commands:
  get: {id: 0x00, request: {}, response: {frame: data, id: 0x8001, fields: {value: u16}}}
  go: {id: 0x11, request: {}, response: ack}
"""


def led() -> Plan:
    protocol, faults = loads(_LED, "sample.yaml")
    assert protocol is not None, faults
    return plan_of(protocol)


def test_a_kind_may_begin_with_its_message_id() -> None:
    plan = led()
    codec = Codec(plan)
    assert codec.wrap("go.request", b"") == bytes.fromhex("11 EE")
    wire = codec.wrap("get.response", b"\x12\x34")
    assert wire == bytes.fromhex("80 01 12 34 C7")
    assert codec.decode(wire, "response").message.name == "get.response"
    stream = bytes.fromhex("80 11 80 11 ED 00 FF 79 80 02") + wire + b"\x79"
    assert heard(plan, stream) == [("unknown", 5), ("ack", 7), ("get.response", 10), ("ack", 15)]


@pytest.mark.parametrize(
    ("wire", "kind"),
    [("11", "truncated"), ("11 11", "frame"), ("22 DD", "frame"), ("80", "truncated"), ("80 02", "frame")],
)
def test_only_known_ids_begin_a_frame(wire: str, kind: str) -> None:
    plan = led()
    with pytest.raises(BadFrame) as caught:
        Codec(plan).decode(bytes.fromhex(wire), "request")
    assert caught.value.kind == kind
    module = load_codec(plan.protocol)
    with pytest.raises(module.DecodeError) as refused:
        module.decode_request(bytes.fromhex(wire))
    assert refused.value.kind == kind
    assert dissect(plan, bytes.fromhex(wire), "request").kind == kind


CODED = """
qlinkgen: 1
protocol: {name: coded, revision: "1", source: Made up}
byteorder: big
frames:
  line:
    parts:
      start: {text: ":"}
      code: {role: message, type: u8}
      data: {role: payload, size: 0..20}
      lrc: {type: u8, algorithm: sum8-zero, over: [code, data]}
      end: {role: terminator, value: 0D 0A}
    coding: {digits: hex}
  packet:
    parts:
      start: 10 02
      code: {role: message, type: u8}
      data: {role: payload, size: 0..20}
      sum: {type: u8, algorithm: sum8, over: [code, data]}
      close: {role: terminator, value: 10 03}
    coding: {insert: 10, after: 10}
bus: {kind: link}
commands: {}
messages:
  greeting: {frame: line, id: 1, fields: {data: bytes}}
  picture: {frame: packet, id: 2, fields: {data: bytes}}
"""


def test_each_kind_has_a_coding_of_its_own() -> None:
    protocol, faults = loads(CODED, "coded.yaml")
    assert protocol is not None, faults
    plan, generated = plan_of(protocol), load_codec(protocol)
    codec, data = Codec(plan), bytes.fromhex("10 03 3A 0D 0A")
    line, packet = codec.encode("greeting", {"data": data}), codec.encode("picture", {"data": data})
    assert line == b":0110033A0D0A9B\r\n"
    assert packet == bytes.fromhex("10 02 02 10 10 03 3A 0D 0A 66 10 03")
    wrong = line.replace(b"3A", b"3G")
    stream = b"\x10" + packet + wrong + line + packet[:5] + packet
    found = [event.decoded.message.name if event.decoded else event.kind
             for event in receiver(plan, "message").run(stream)]  # fmt: skip
    assert [each for each in found if each in plan.by_name] == ["picture", "greeting", "picture"]
    assert "stuffing" in found
    decoder = generated.StreamDecoder()
    heard = [event for byte in stream for event in decoder.feed(bytes((byte,)))]
    heard += decoder.finish()
    assert [getattr(each, "NAME", "") or each.kind for each in heard] == found
    assert generated.decode(line).data == generated.decode(packet).data == data
    assert [fault.kind for fault in dissect(plan, wrong, "message").faults] == ["stuffing"]


OPEN = """
qlinkgen: 1
protocol: {name: open_coded, revision: "1", source: Made up}
byteorder: big
frames:
  escaped:
    parts:
      start: 7E
      size: {type: u8, counts: data}
      data: {role: payload, size: 0..20}
      crc: {type: u8, algorithm: crc-8/smbus, over: [data]}
    coding: {escape: 7D, xor: 20, of: [7E, 7D, 06]}
  stuffed:
    parts:
      start: A5 5A
      count: {type: u8, counts: data}
      data: {role: payload, size: 0..20}
      total: {type: u8, algorithm: sum8, over: [data]}
    coding: {insert: 00, after: A5}
  ack: {parts: {byte: 06}}
bus: {kind: host}
defaults: {repeat: safe}
commands: {}
messages:
  note: {frame: escaped, direction: response, fields: {data: bytes}}
  total: {frame: stuffed, direction: response, fields: {data: bytes}}
  taken: {frame: ack, direction: response, fields: {}}
"""


def test_codings_without_a_terminator_are_decoded_as_they_are_read() -> None:
    protocol, faults = loads(OPEN, "open.yaml")
    assert protocol is not None, faults
    plan, generated = plan_of(protocol), load_codec(protocol)
    codec = Codec(plan)
    note, total = codec.encode("note", {"data": b"\x06~"}), codec.encode("total", {"data": b"\xa5\0"})
    taken = codec.encode("taken", {})
    assert note.startswith(bytes.fromhex("7E 02 7D 26 7D 5E"))
    # A byte is inserted after the last one. Receivers do not wait for it.
    assert total == bytes.fromhex("A5 5A 02 A5 00 00 A5 00")
    stream = note[:4] + taken + total + taken + total[:-1] + note + total + taken
    events = receiver(plan, "response").run(stream)
    found = [event.decoded.message.name if event.decoded else event.kind for event in events]
    names = ["taken", "total", "taken", "total", "note", "total", "taken"]
    assert [each for each in found if each in plan.by_name] == names
    for size in (1, 5, len(stream)):
        decoder = generated.StreamDecoder("response")
        pieces = [stream[at : at + size] for at in range(0, len(stream), size)]
        heard = [event for piece in pieces for event in decoder.feed(piece)] + decoder.finish()
        assert [getattr(each, "NAME", "") or each.kind for each in heard] == found
        assert [each.offset for each in heard if hasattr(each, "offset")] == [
            event.offset for event in events if not event.decoded
        ]
        assert decoder.counters.skipped == 4
    assert generated.decode_response(total).data == generated.decode_response(total[:-1]).data == b"\xa5\0"
    assert generated.encode(generated.decode_response(note)) == note


ONE_WAY = """
qlinkgen: 1
protocol: {name: one_way, revision: "1", source: Made up}
byteorder: big
frames:
  tell:
    if: {direction: response}
    parts: {start: 10, code: {role: message, type: u8}, data: {role: payload, size: 0..4}, stop: 16}
bus: {kind: master_slave}
commands: {}
messages:
  level: {id: 1, direction: response, fields: {value: u8}}
"""


def test_where_no_frame_goes_one_direction_those_of_the_other_are_passed_over() -> None:
    protocol, faults = loads(ONE_WAY, "one_way.yaml")
    assert protocol is not None, faults
    plan, wire = plan_of(protocol), bytes.fromhex("10 01 07 16")
    assert construct.live(protocol).frames["response"].parse(wire).message == "level"
    assert heard(plan, wire) == [("level", 0)]
    asked = [event.kind for event in receiver(plan, "request").run(wire)]
    assert [fault.kind for fault in load_codec(protocol).StreamDecoder("request").feed(wire)] == asked
    assert load_codec(protocol, Options(role="slave")).StreamDecoder("request").feed(wire)


def test_the_kind_of_the_defaults_is_that_of_messages_too() -> None:
    protocol, faults = loads(
        """\
qlinkgen: 1
protocol: {name: pair, revision: "1", source: Manual}
frames:
  first: {parts: {start: 11, code: {role: message, type: u8}, length: {type: u8, counts: data}, data: {role: payload, size: 0..4}}}
  second: {parts: {start: 22, code: {role: message, type: u8}, length: {type: u8, counts: data}, data: {role: payload, size: 0..4}}}
bus: {kind: link}
defaults: {frame: second}
commands: {}
messages:
  tell: {id: 1, fields: {level: u8}}
  other: {id: 1, frame: first, fields: {level: u8}}
""",  # noqa: E501
        "pair.yaml",
    )
    assert protocol is not None, faults
    codec = Codec(plan_of(protocol))
    assert codec.encode("tell", {"level": 5}) == bytes.fromhex("22 01 01 05")
    assert codec.encode("other", {"level": 5}) == bytes.fromhex("11 01 01 05")


CONDITIONAL = """
qlinkgen: 1
protocol: {name: conditional, revision: "1", source: Made up}
byteorder: big
frames:
  data:
    parts:
      start: 68
      length: {type: u8, counts: data}
      state: {type: u8, bits: {timed: {at: 0, type: bool}, signed: {at: 1, type: bool}}}
      hops: {type: u8, default: 3, if: timed}
      data: {role: payload, size: 0..20}
      sum: {type: u8, algorithm: sum8, over: [state, hops, data]}
      stamp: {type: u16, if: signed}
      seal: {type: u8, algorithm: xor8, over: [data, stamp], if: signed}
  ack: {parts: {byte: 06}}
bus: {kind: host}
defaults: {repeat: safe}
commands: {}
messages:
  note: {frame: data, direction: response, fields: {text: bytes}}
  taken: {frame: ack, direction: response, fields: {}}
"""


def test_values_of_the_header_decide_about_parts_of_a_kind() -> None:
    protocol, faults = loads(CONDITIONAL, "conditional.yaml")
    assert protocol is not None, faults
    plan, generated = plan_of(protocol), load_codec(protocol)
    codec = Codec(plan)
    plain = codec.encode("note", {"text": b"\x06"})
    signed = codec.encode("note", {"text": b"\x06", "timed": 1, "signed": 1, "hops": 7, "stamp": 0x102})
    assert plain == bytes.fromhex("68 01 00 06 06")
    assert signed == bytes.fromhex("68 01 03 07 06 10 01 02 05")
    note = generated.Note(text=b"\x06", timed=True, signed=True, hops=7, stamp=0x102)
    assert (generated.encode(generated.Note(text=b"\x06")), generated.encode(note)) == (plain, signed)
    wrong = signed[:-1] + b"\xff"
    stream = wrong + plain + b"\x06" + signed
    heard = generated.StreamDecoder("response").feed(stream)
    found = [event.decoded.message.name if event.decoded else event.kind
             for event in receiver(plan, "response").run(stream)]  # fmt: skip
    assert [getattr(each, "NAME", "") or each.kind for each in heard] == found
    assert found == ["crc", "taken", "note", "taken", "note"]
    assert (heard[2].hops, heard[2].stamp, heard[4].hops, heard[4].stamp) == (3, 0, 7, 0x102)
    with pytest.raises(generated.EncodeError):
        generated.encode(generated.Note(text=b"", stamp=1))


BITS = """
qlinkgen: 1
protocol: {name: told_by_bits, revision: "1", source: Made up}
byteorder: big
frames:
  level:
    parts:
      head: {type: u8, bits: {tenths: 0..5, mark: {at: 6..7, const: 2}}}
      sum: {type: u8, algorithm: sum8-inverted, over: [head]}
  data:
    parts:
      head: {type: u8, bits: {code: {at: 0..3, role: message}, spare: {at: 4..5, const: [0, 1]}, mark: {at: 6..7, const: 3}}}
      length: {type: u8, counts: data}
      data: {role: payload, size: 0..20}
      crc: {type: u8, algorithm: crc-8/smbus, over: [head, length, data]}
bus: {kind: host}
defaults: {repeat: safe}
commands: {}
messages:
  level: {frame: level, direction: response, fields: {}}
  note: {frame: data, id: 5, direction: response, fields: {text: bytes}}
"""  # noqa: E501


def test_bits_of_the_first_byte_tell_kinds() -> None:
    protocol, faults = loads(BITS, "bits.yaml")
    assert protocol is not None, faults
    plan, generated = plan_of(protocol), load_codec(protocol)
    codec = Codec(plan)
    starts = {each.name: set(b"".join(each.envelope.starts)) for each in plan.frame.kinds}
    assert starts == {"level": set(range(0x80, 0xC0)), "data": {0xC5, 0xD5}}
    level, note = codec.encode("level", {"tenths": 0x25}), codec.encode("note", {"text": b"\xc5\x80"})
    assert (level, note[:2]) == (bytes.fromhex("A5 5A"), bytes.fromhex("C5 02"))
    # An unknown id, and spare bits that no frame has, begin none.
    stream = b"\xc6\xe5" + note[:3] + level + b"\xff" + note + level
    found = [event.decoded.message.name if event.decoded else event.kind
             for event in receiver(plan, "response").run(stream)]  # fmt: skip
    decoder = generated.StreamDecoder("response")
    heard = [event for byte in stream for event in decoder.feed(bytes((byte,)))] + decoder.finish()
    assert [getattr(each, "NAME", "") or each.kind for each in heard] == found
    assert [each for each in found if each in plan.by_name] == ["level", "note", "level"]
    with pytest.raises(generated.DecodeError) as refused:
        generated.decode_response(b"\xe5" + note[1:])
    assert refused.value.kind == dissect(plan, b"\xe5" + note[1:], "response").kind == "frame"
