"""Schemas on which outputs once differed, found by random schemas."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from qlinkgen.backends import construct, python
from qlinkgen.plan import plan_of
from qlinkgen.plan.dissect import dissect
from qlinkgen.plan.receive import receiver
from qlinkgen.schema import loads
from tests.support.whole.reference import Reference, Wrong
from tests.support.whole.trial import Effort, run_text

_HEAD = """\
qlinkgen: 1
protocol: {name: tank, title: Tank, revision: "1", source: Example, doc: A tank}
byteorder: big
"""
_PARTS = """\
frame:
  parts:
    start: {role: constant, value: 7E}
    node: {role: address, type: u8}
    code: {role: message, type: u8}
    length: {role: length, type: u8, counts: [data]}
    data: {role: payload, size: 0..40}
    crc: {role: checksum, type: u8, algorithm: sum8, over: [code, data]}
"""
_BARE = """\
frame:
  parts:
    code: {role: message, type: u8}
    version: {role: constant, value: "01"}
    node: {role: address, type: u8}
    length: {role: length, type: u8, counts: [data]}
    data: {role: payload, size: 0..40}
    crc: {role: checksum, type: u8, algorithm: sum8, over: [code, data]}
"""
_COUNTED = """\
frame:
  parts:
    start: {role: constant, value: 10 02}
    code: {role: message, type: u8}
    data: {role: payload, size: 0..40}
  stuffing: {after: 0x10, insert: 0x03, exempt: [start]}
bus: {kind: master_slave}
"""
_STUFFED_PAYLOAD = """\
frame:
  parts:
    start: {role: constant, value: 7E}
    code: {role: message, type: u8}
    length: {role: length, type: u8, counts: [data]}
    data: {role: payload, size: 0..4}
    crc: {role: checksum, type: u8, algorithm: sum8, over: [data]}
  stuffing: {after: 0x10, insert: 0x10, exempt: [start, code, length, crc], checksum: after}
bus: {kind: master_slave}
"""
_MARKED = """\
groups: {bits: 7, first: most}
frame:
  marked:
    marker: 0x80
    header: {address: 4..6, message: 0..3}
    end: 0
    payload: 0..24
    checksum: {role: checksum, type: u16, algorithm: sum16, over: [payload], sent: [0..5, 8..13]}
bus: {kind: ring, nodes: 1..7}
"""
_ENDED = """\
bus: {kind: master_slave}
frame:
  parts:
    code: {role: message, type: u8}
    data: {role: payload, size: 0..40}
    crc: {type: u8, algorithm: sum8, over: [code, data]}
    end: {role: terminator, value: 00}
"""
_SYSEX = """\
groups: {bits: 7, first: most}
bus: {kind: master_slave}
frame:
  parts:
    code: {role: message, type: u8}
    state: {type: u8, range: 0..1}
    data: {role: payload, size: 0..40}
    end: {role: terminator, value: 80}
"""
_ESCAPED = "  coding: {escape: 7D, xor: 20, of: [7E, 7D]}\n"
_KINDS = """\
frames:
  long:
    parts:
      start: A5
      node: {role: address, type: u8}
      code: {role: message, type: u8}
      length: {type: u8, counts: [data]}
      data: {role: payload, size: 0..9}
      crc: {type: u8, algorithm: sum8, over: [code, data]}
  short: {parts: {start: 24 58}}
"""
_SILENT = """\
frame:
  parts:
    code: {role: message, type: u8}
    data: {role: payload, size: 0..40}
    crc: {type: u8, algorithm: sum8, over: [code, data, attribute.salt]}
    silence: {role: idle, time: 3.5 bytes, alone: true}
bus: {kind: master_slave, baud: 9600}
"""
_BUS = "bus: {kind: master_slave, nodes: 1..8, broadcast: 9}\n"

FOUND = {
    "bits called like a message id of several lengths, which construct took for it": """\
frame:
  parts:
    start: AA AA
    length: {type: u8, counts: [code, data]}
    code: {role: message, type: "text[1..4]"}
    data: {role: payload, size: 0..20}
    crc: {type: u8, algorithm: sum8, over: [length, code, data]}
bus: {kind: link}
messages:
  level: {id: MEAS, fields: {state: {type: u8, bits: {code: 0..2, on: 7}}, value: u16}}
""",
    "a length before the stuffed bytes, whose fault in Python depended on the bytes after it": """\
frame:
  parts:
    start: A5 A5
    length: {type: u8, counts: data}
    code: {role: message, type: u16}
    data: {role: payload, size: 0..40}
    crc: {type: u8, algorithm: sum8, over: [length, code, data]}
  stuffing: {after: 0xA5, insert: 0x00, exempt: [start, length, code]}
bus: {kind: master_slave}
messages:
  log: {id: 5, fields: {text: "bytes[0..8]"}}
""",
    "reserved bytes alone that a value of the frame decides, of which a decoder in C read nothing": """\
frame:
  parts:
    start: {role: constant, value: 7E}
    state: {type: u8, default: 0}
    code: {role: message, type: u8}
    length: {role: length, type: u8, counts: [data]}
    data: {role: payload, size: 0..40}
    crc: {role: checksum, type: u8, algorithm: sum8, over: [state, code, data]}
bus: {kind: master_slave}
messages:
  log: {id: 5, fields: {gap: {type: i32, reserved: true, if: {state: 0..3}}}}
""",
    "a wrong count, whose fault showed more bytes the longer the pieces were": _COUNTED
    + "messages:\n  log: {id: 255, fields: {n: {type: u8, counts: a}, m: {type: u8, counts: b}, "
    'a: "bytes[0..1]", b: "u16[0..3]", c: u32}}\n',
    "a message of no command, which slaves in C took from the broadcast address": _PARTS
    + _BUS
    + "messages:\n  log: {id: 5, direction: request, fields: {v: u8}}\n"
    "  state: {id: 6, direction: response, fields: {v: u8}}\n",
    "a marked frame with a count that does not fit, which the kit took for another fault": _MARKED
    + 'messages:\n  log: {id: 2, fields: {n: {type: u8, counts: t}, t: "text[0..4]"}}\n',
    "an address called like a key of the vectors": _PARTS.replace("node:", "raw:")
    + _BUS
    + "messages:\n  log: {id: 5, fields: {v: {type: u8, scale: 1/2, unit: V}}}\n",
    "an address called like a key of what construct parses": _PARTS.replace("node:", "message:")
    + _BUS
    + "messages:\n  log: {id: 5, fields: {v: u8}}\n",
    "a message called like another with a number, whose code has more than one row": _PARTS
    + _BUS
    + 'messages:\n  log: {id: 5, fields: {a: "u24[1]", n: {type: u8, counts: w}, w: "u24[0..3]", x: u16, '
    'm: {type: u8, counts: z}, z: "bytes[0..3]", y: u8}}\n'
    "  log_1: {id: 6, fields: {v: i32}}\n  log_2: {id: 7, fields: {v: u64}}\n",
    "an address of three bytes that may be any, and has four in C": _PARTS.replace(
        "address, type: u8", "address, type: u24"
    )
    + "bus: {kind: master_slave, nodes: 0..16777215}\nmessages:\n  log: {id: 5, fields: {v: u8}}\n",
    "a seed before a preamble that the check value covers, which C took after it": _PARTS.replace(
        "over: [code", "over: [attribute.salt, start, code"
    )
    .replace("7E", "02 02")
    .replace("sum8", "crc-8/wcdma")
    + "  stuffing: {after: 02 02, insert: FD, exempt: [start]}\n"
    + _BUS
    + "attributes: {salt: {type: u8}}\nmessages:\n  log: {id: 5, attributes: {salt: 7}, fields: {v: u8}}\n",
    "a coded frame, whose state C++ did not see wholly initialised": _ENDED
    + "  coding: [{cobs: 00}]\n"
    + "messages:\n  log: {id: 5, fields: {v: u8}}\n",
    "a value of every frame beside groups of bits, which Python could not decode": _SYSEX
    + "messages:\n  log: {id: 5, fields: {v: u14}}\n",
    "records that a choice has, which Python took from an attribute of the case": _PARTS
    + _BUS
    + "types: {point: {fields: {x: bool}}}\n"
    + 'messages:\n  log: {id: 5, fields: {k: u8, v: {switch: k, cases: {0: "point[4]"}, default: u8}}}\n',
    "a length of four bytes, which Python took from fewer to wait for its frame": _PARTS.replace(
        "length, type: u8", "length, type: u32"
    )
    + _BUS
    + "messages:\n  log: {id: 5, fields: {v: u8}}\n",
    "a wrong number before a terminator, a fault of a frame that the reference did not tell": _ENDED.replace(
        "parts:", "parts:\n    start: {value: 7E}\n    kind: {type: u8, const: [1, 2]}"
    ).replace("value: 00", "value: 7E")
    + _ESCAPED
    + "messages:\n  log: {id: 5, fields: {v: u8}}\n",
    "a response without address, for which the kit asked everybody": _KINDS
    + "bus: {kind: host, nodes: 1..8, broadcast: 0}\n"
    "commands:\n  ask: {id: 5, addressing: node, request: {v: u8}, response: sent, repeat: safe}\n"
    "messages:\n  sent: {direction: response, fields: {}, frame: short}\n",
    "a field called like the type of another, which C++ refuses": _PARTS
    + _BUS
    + "messages:\n  log: {id: 5, fields: {v: u8, uint8_t: u8, int64_t: i64}}\n",
    "a check value over a part after one that it does not cover, which Python placed wrongly": _PARTS.replace(
        "    crc:", '    one: "01"\n    two: "02"\n    crc:'
    ).replace("over: [code, data]", "over: [code, data, two]")
    + _BUS
    + "messages:\n  log: {id: 5, fields: {v: u8}}\n",
    "a frame of the other direction that a silence ends, whose attribute C took for that of this one": _SILENT
    + "attributes: {salt: {type: u8}}\nmessages:\n"
    "  log: {id: 5, direction: request, attributes: {salt: 7}, fields: {v: u8}}\n"
    + "".join(
        f"  state_{each}: {{id: {each}, direction: response, attributes: {{salt: {each}}}, fields: {{}}}}\n"
        for each in (0, 1, 2, 3, 4, 6, 7, 254, 255)
    ),
    "a text of a number out of range, for which C asked for a larger buffer": _PARTS
    + _BUS
    + 'messages:\n  log: {id: 5, separator: ",", fields: {v: {type: u24, as: "decimal[1..2]"}}}\n'
    '  note: {id: 6, separator: ",", fields: {v: {type: u24, as: "hex[1..2]"}}}\n',
    "a node in the header of answers alone, for which Python had no texts of faults of both": """\
frame:
  parts:
    from: {role: source, type: u8}
    code: {role: message, type: u8}
    data: {role: payload, size: 0..9}
    sum: {type: u8, algorithm: sum8, over: [from, code]}
    to: {role: destination, type: u8}
    close: {role: terminator, value: "10 0A"}
  coding: {escape: 03, xor: 01, of: [03, 10]}
bus: {kind: master_slave, nodes: 0..255, master: 234}
commands:
  ask: {id: 5, addressing: node, request: {v: u8}, response: {w: u8}, repeat: safe}
""",
    "a check value of each block beside one of the frame, which C called the same": _PARTS.replace(
        "    crc:", "    each: {type: u8, algorithm: sum8, over: [data], every: 4 bytes}\n    crc:"
    ).replace("over: [code, data]", "over: [code]")
    + _BUS
    + 'messages:\n  log: {id: 5, fields: {v: "u8[9]"}}\n',
    "a count that a value adds at the end of a stuffed frame, which Python did not wait for": _COUNTED
    + "messages:\n  log: {id: 5, fields: {on: bool, n: {type: u8, counts: v, if: on},"
    ' v: {type: "u8[1..3]", if: on}}}\n',
    "a field called like a number of a record, which hid it where the size is measured": _COUNTED
    + 'types:\n  item: {fields: {n: {type: u8, counts: v}, v: "u8[0..3]"}}\n'
    + 'messages:\n  log: {id: 5, fields: {n_1: {type: u8, counts: v_1}, a: "item[2]", v_1: "u8[0..3]"}}\n',
    "records beside one whose default is long, for which no vector could be made": _PARTS
    + _BUS
    + "types:\n  block: {fields: {a: u64, b: u64}}\n"
    "  item: {fields: {k: u8, v: {switch: k, cases: {0: {a: u64, b: u64}}, default: u8}}}\n"
    'messages:\n  log: {id: 5, fields: {n: {type: u8, counts: m}, m: "block[0..2]", i: "item[1]"}}\n',
    "a count that a value adds, which C did not cover by the check value": _COUNTED.replace(
        "0..40}", "0..40}\n    crc: {type: u8, algorithm: sum8, over: [code, data]}"
    )
    + "messages:\n  log: {id: 5, fields: {on: bool, n: {type: u8, counts: v, if: on},"
    ' v: {type: "u8[1..3]", if: on}}}\n',
    "frames of each direction, of which Python could not have one alone": _PARTS.replace(
        "    data:", "    state: {type: level, if: {direction: response}}\n    data:"
    )
    + _BUS
    + "enums: {level: {type: u8, values: {low: 0, high: 7}}}\n"
    "defaults: {addressing: node, repeat: safe}\n"
    "commands:\n  get: {id: 5, request: {}, response: {v: u8}}\n"
    "  put: {id: 6, request: {v: u8}, response: {}}\n",
    "counts of records beyond what a frame holds, for whose bytes C had no room and heard nothing more": """\
frame:
  parts:
    code: {role: message, type: u8}
    data: {role: payload, size: 0..8}
    crc: {type: u8, algorithm: sum8, over: [code, data]}
bus: {kind: master_slave}
types: {item: {fields: {n: {type: u8, counts: v}, v: "u8[0..3]"}}}
messages:
  log:
    id: 5
    fields:
      size: {type: u8, counts: items, counts_in: bytes}
      number: {type: u8, counts: items}
      items: "item[0..4]"
      x: u32
      m: {type: u8, counts: b}
      b: "u8[0..3]"
""",
    "a check value of some frames of the first kind, which C took for the main one": """\
frames:
  long:
    parts:
      start: A5
      code: {role: message, type: u8}
      length: {type: u8, counts: [data]}
      state: {type: u8, bits: {on: 0}}
      data: {role: payload, size: 0..9}
      crc: {type: u16, algorithm: fletcher-8, over: [code, data], if: state.on}
  short:
    parts:
      start: 24 58
      code: {role: message, type: u8}
      sum: {type: u8, algorithm: sum8, over: [code]}
bus: {kind: master_slave}
messages:
  log: {id: 5, frame: long, fields: {v: u8}}
  state: {id: 6, frame: short, fields: {}}
""",
    "a coding over parts of which the last is in responses alone, which the reference did not code": """\
frame:
  parts:
    code: {role: message, type: u8}
    data: {role: payload, size: 1..9}
    stamp: {type: u8, const: [1, 2], if: {direction: response}}
    crc: {type: u8, algorithm: sum8, over: [code, data]}
  coding: {add: AE, over: [code, data, stamp]}
bus: {kind: link}
commands: {ask: {id: 5, request: {v: u8}, response: {w: u8}, repeat: safe}}
""",
    "records of variable size in records, whose sizes in C had one name": _PARTS
    + _BUS
    + 'types: {leaf: {fields: {n: u8, x: "u8[n]"}}, pair: {fields: {a: leaf, b: leaf}}}\n'
    "messages:\n  log: {id: 5, fields: {v: pair}}\n",
}


@pytest.mark.slow
@pytest.mark.parametrize("text", FOUND.values(), ids=FOUND)
def test_outputs_agree(text: str, require_tool: Callable[..., str]) -> None:
    for compiler, package in (("gcc", "gcc"), ("g++", "g++"), ("clang", "clang"), ("clang++", "clang")):
        require_tool(compiler, package=package)
    outcome = run_text(_HEAD + text, effort=Effort(streams=40, every=True))
    assert not outcome.refused
    assert not outcome.differences, outcome.report()


def test_the_first_wrong_part_of_a_header_names_the_fault() -> None:
    """Without a preamble; the constant precedes the address, which is also wrong."""
    text = f"{_HEAD}{_BARE}{_BUS}messages:\n  log: {{id: 5, fields: {{v: u8}}}}\n"
    protocol, faults = loads(text, "whole.yaml")
    assert protocol, faults
    codec = python.load(protocol)
    with pytest.raises(codec.DecodeError) as caught:
        codec.decode(bytes.fromhex("05 02 63 01 00 05"))
    assert caught.value.kind == "frame"


def test_a_payload_that_is_too_long_without_inserted_bytes_is_a_fault_of_the_length() -> None:
    """Its size is that of a stuffed payload; the check value is wrong too, but is checked later."""
    text = f"{_HEAD}{_STUFFED_PAYLOAD}messages:\n  log: {{id: 5, fields: {{v: bytes}}}}\n"
    protocol, faults = loads(text, "whole.yaml")
    assert protocol, faults
    wire = bytes.fromhex("7E 05 05 01 02 03 04 05 00")
    assert dissect(plan_of(protocol), wire, "message").kind == "length"
    codec = python.load(protocol)
    with pytest.raises(codec.DecodeError) as caught:
        codec.decode(wire)
    assert caught.value.kind == "length"


def test_an_address_is_checked_after_a_payload_that_is_walked() -> None:
    """Fields that may be absent have their size and value checked one by one, and only then the address."""
    fields = "{on: bool, v: {type: u16, if: on}}"
    bus = "bus: {kind: master_slave, nodes: 1..8}\n"
    text = f"{_HEAD}{_PARTS}{bus}messages:\n  log: {{id: 5, fields: {fields}}}\n"
    protocol, faults = loads(text, "whole.yaml")
    assert protocol, faults
    wire = bytes.fromhex("7E 09 05 02 01 02 08")
    assert dissect(plan_of(protocol), wire, "message").kind == "length"
    codec = python.load(protocol)
    with pytest.raises(codec.DecodeError) as caught:
        codec.decode(wire)
    assert caught.value.kind == "length"


def test_the_size_of_a_choice_is_not_called_like_a_function() -> None:
    """A choice called as had a size called as_bytes, as the function that takes bytes of any kind."""
    kinds = '{switch: kind, cases: {9: "bytes[0..11]"}, default: "bytes[0..3]"}'
    bus = "bus: {kind: master_slave, nodes: 1..8}\n"
    fields = f"{{kind: u8, size: {{type: u16, counts: [as, size]}}, as: {kinds}}}"
    protocol, faults = loads(
        f"{_HEAD}{_PARTS}{bus}messages:\n  log: {{id: 5, fields: {fields}}}\n", "whole.yaml"
    )
    assert protocol, faults
    codec = python.load(protocol)
    message = codec.Log(node=1, kind=2, as_=b"abc")
    assert message.to_bytes().hex() == "020005616263"
    assert codec.decode(message.to_frame()) == message


def test_a_message_without_its_last_zeros_may_fix_a_value_of_its_frame() -> None:
    """Its structure took no values that are always the same."""
    parts = "{start: 7E, length: {type: u8, counts: data}, code: {role: message, type: u8}, on: {type: u8}"
    parts += (
        ", data: {role: payload, size: 0..8, trim: zeros}, sum: {type: u8, algorithm: sum8, over: [data]}}"
    )
    log = "{id: {code: 5, on: 1}, direction: request, fields: {level: u32}}"
    text = f"{_HEAD}frame: {{parts: {parts}}}\nbus: {{kind: master_slave}}\nmessages: {{log: {log}}}\n"
    protocol, faults = loads(text, "whole.yaml")
    assert protocol, faults
    frames = construct.live(protocol).frames["request"]
    wire = python.load(protocol).Log(level=0x01000000).to_frame()
    assert wire.hex() == "7e0105010101"
    assert frames.parse(wire)["on"] == 1


def test_an_id_in_the_payload_is_looked_up_after_the_check_value() -> None:
    """Of frames without a leading constant; only ids and addresses before the payload are checked first."""
    text = f"""{_HEAD}frame:
  parts:
    node: {{role: source, type: u8}}
    code: {{role: message, type: "text[2..4]"}}
    data: {{role: payload, size: 0..4}}
    sum: {{type: u8, algorithm: sum8, over: [node, code, data]}}
    to: {{role: destination, type: u8}}
    end: {{role: terminator, value: "0D"}}
  coding: {{escape: 7D, xor: 20, of: [0D, 7D]}}
bus: {{kind: master_slave, nodes: 1..8, master: 9}}
messages: {{log: {{id: GO, direction: request, fields: {{}}}}}}
"""
    protocol, faults = loads(text, "whole.yaml")
    assert protocol, faults
    wire = bytes.fromhex("09 67 4F 00 05 0D")
    codec = python.load(protocol)
    with pytest.raises(codec.DecodeError) as caught:
        codec.decode_request(wire)
    with pytest.raises(Wrong) as wrong:
        Reference(text).decode("request", wire)
    assert (caught.value.kind, wrong.value.kind) == ("crc", "crc")
    assert dissect(plan_of(protocol), wire, "request").kind == "crc"


def test_records_end_where_a_count_lies_beyond_the_longest_payload() -> None:
    """At once: the bytes of the records, announced as 3 of at most 1, are not waited for."""
    text = _HEAD + next(each for key, each in FOUND.items() if key.startswith("counts of records beyond"))
    protocol, faults = loads(text, "whole.yaml")
    assert protocol, faults
    codec = python.load(protocol)
    log = codec.Log(x=7)
    assert codec.StreamDecoder().feed(bytes((5, 3, 3)) + log.to_frame())[-1:] == [log]
    heard = receiver(plan_of(protocol), "message")
    events = [event for byte in bytes((5, 3, 3)) + log.to_frame() for event in heard.feed(byte)]
    assert events[-1].decoded


def test_a_header_with_a_wrong_constant_is_not_awaited() -> None:
    """The first byte of a constant in two bytes was taken for all of it, and a right one."""
    text = _HEAD + _PARTS.replace(
        "    data:",
        "    head: {type: u16, bits: {grade: 0..1, fixed: {at: 2..6, const: [0, 31]}}}\n    data:",
    )
    protocol, faults = loads(text + _BUS + "messages:\n  log: {id: 5, fields: {v: bytes}}\n", "tank.yaml")
    assert protocol is not None, faults
    codec = python.load(protocol)
    frame = codec.Log(node=1, v=b"ab").to_frame()
    decoder = codec.StreamDecoder("message")
    wire = bytes.fromhex("7e 01 05 28 00 04") + frame
    heard = [event for byte in wire for event in decoder.feed(bytes((byte,)))]
    assert heard == [codec.Log(node=1, v=b"ab")]
