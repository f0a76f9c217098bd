"""Fields that values of the frame decide about, in frames of every kind: the same in every output."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.support.whole.trial import Effort, run_text

_HEAD = """\
qlinkgen: 1
protocol: {name: tank, title: Tank, revision: "1", source: Example, doc: A tank}
byteorder: big
bus: {kind: master_slave, nodes: 1..9}
enums: {mode: {type: u8, values: {off: 0, on: 1, slow: 7}}}
messages:
  log:
    id: 5
    fields:
      a: u8
      b: {switch: form, cases: {0: u8, 1..2: {x: u16, y: {type: u8, if: {x: 7}}}}, default: "u16[0..3]"}
  state:
    id: 6
    direction: response
    fields: {level: {type: u16, range: 0..1000, if: {mode: on}}, more: {type: "u8[2]", if: {mode: not on}}}
  set:
    id: 7
    fields:
      number: {type: u8, counts: items, if: {mode: slow}}
      items: {type: "u16[0..4]", if: {mode: slow}}
      mark: {type: u8, const: 9, if: {form: 1}}
frame:
  parts:
"""
SHAPES = {
    "stuffed, with a preamble that occurs nowhere else": """\
    start: A5 A5
    length: {type: u8, counts: [code, node, form, mode, data, crc]}
    code: {role: message, type: u8}
    node: {role: address, type: u8}
    form: {type: u8, range: 0..3}
    mode: {type: mode}
    data: {role: payload, size: 0..40}
    crc: {type: u16, algorithm: crc-16/ibm-3740, over: [length, code, node, form, mode, data]}
  stuffing: {after: 0xA5, insert: 0x00, exempt: [start]}
""",
    "ended by a terminator, coded, with values at both ends": """\
    open: 7E
    node: {role: address, type: u8}
    form: {type: u8, range: 0..3}
    code: {role: message, type: u8}
    data: {role: payload, size: 0..64}
    mode: {type: mode, default: on}
    fcs: {type: u16, byteorder: little, algorithm: crc-16/ibm-sdlc, over: [node, form, code, data, mode]}
    close: {role: terminator, value: 7E, shared: true}
  coding: {escape: 7D, xor: 20, of: [7E, 7D]}
""",
    "ended by a silence": """\
    node: {role: address, type: u8}
    code: {role: message, type: u8}
    head: {type: u16, bits: {form: {at: 3..4}, mode: {at: 8..15, type: mode}}}
    data: {role: payload, size: 0..40}
    crc: {type: u16, byteorder: little, algorithm: crc-16/modbus, over: [node, code, head, data]}
    gap: {role: idle, time: 3.5 bytes, alone: true}
""",
    "check values of blocks": """\
    start: 05 64
    length: {type: u8, counts: [code, data]}
    code: {role: message, type: u8}
    node: {role: address, type: u8}
    form: {type: i16, byteorder: little, range: -3..3, default: 1}
    mode: {type: mode}
    head: {type: u16, byteorder: little, algorithm: crc-16/dnp, over: [start, length, code, node, form, mode]}
    data: {role: payload, size: 0..40}
    blocks: {type: u16, byteorder: little, algorithm: crc-16/dnp, over: [data], every: 16 bytes}
""",
    "parts that only some frames have": """\
    start: FD
    length: {type: u8, counts: data}
    node: {role: address, type: u8}
    code: {role: message, type: u8}
    flags: {type: u8, bits: {signed: 0, form: 1..2}}
    mode: {type: mode}
    hops: {type: u8, if: flags.signed, default: 1}
    data: {role: payload, size: 0..32}
    crc: {type: u16, algorithm: crc-16/mcrf4xx, over: [length, node, code, flags, mode, hops, data]}
    link: {type: u8, if: {signed: 1}}
""",
    "a stuffed payload": """\
    header: FF FF FD 00
    node: {role: address, type: u8}
    form: {type: u8, range: 0..3}
    mode: {type: mode}
    length: {type: u16, byteorder: little, counts: [code, data, crc]}
    code: {role: message, type: u8}
    data: {role: payload, size: 0..128}
    crc: {type: u16, byteorder: little, algorithm: crc-16/umts, over: [node, form, mode, length, code, data]}
  stuffing: {after: FF FF FD, insert: 0xFD, checksum: after}
""",
    "coded, with a length": """\
    start: 7E
    length: {type: u16, counts: [code, node, form, mode, data]}
    code: {role: message, type: u8}
    node: {role: address, type: u8}
    form: {type: u8, range: 0..3}
    mode: {type: mode}
    data: {role: payload, size: 0..200}
    sum: {type: u8, algorithm: sum8-inverted, over: [code, node, form, mode, data]}
  coding: {escape: 7D, xor: 20, of: [7E, 7D, 11, 13]}
""",
}


@pytest.mark.slow
@pytest.mark.parametrize("parts", SHAPES.values(), ids=SHAPES)
def test_outputs_agree(parts: str, require_tool: Callable[..., str]) -> None:
    require_tool("gcc", package="gcc")
    require_tool("clang", package="clang")
    outcome = run_text(_HEAD + parts, effort=Effort(streams=12))
    assert not outcome.refused
    assert not outcome.differences, outcome.report()
