"""Message ids of several lengths: instruments, scales, and frames with a length."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from qlinkgen.plan import plan_of
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.dissect import dissect
from qlinkgen.plan.reading import BadFrame
from qlinkgen.schema import loads
from tests.support.whole.trial import Effort, run_text

METER = """\
qlinkgen: 1
protocol: {name: meter, title: A voltmeter, revision: "1999.0", source: SCPI-99, doc: Commands and queries}
enums:
  mode: {type: text, ignore_case: true, values: {voltage: VOLT, current: CURR}}
frame:
  parts:
    command: {role: message, type: "text[0..16]", ignore_case: true}
    data: {role: payload, size: 0..60}
    end: {role: terminator, value: 0A}
bus: {kind: master_slave, response_within: 100 ms}
defaults: {repeat: safe, separator: " ", response: {id: "", separator: ","}}
commands:
  identify: {id: "*IDN?", request: {}, response: {maker: "text[1..9]", serial: "text[0..9]"}}
  reset: {id: "*RST", request: {}, response: none}
  measure:
    id: "MEAS:VOLT?"
    request: {channel: {type: u8, as: decimal, optional: true}}
    response: {value: {type: f64, as: scientific}}
  measure_ac:
    id: "MEAS:VOLT:AC?"
    request: {channel: {type: u8, as: decimal, optional: true}}
    response: {value: {type: i32, as: "decimal[9]", scale: 1/1000}, mode: mode}
  configure:
    id: CONF
    request: {mode: mode, range: {type: u16, as: decimal}}
    response: none
    examples:
      - {wire: 43 6F 6E 66 20 63 75 52 72 20 37 0A, decode_only: true, request: {mode: current, range: 7}}
  label:
    id: DISP:TEXT
    separator: none
    request: {gap: {type: u8, const: 0x20}, text: "text[0..20]"}
    response: none
"""
_SCALE = """\
qlinkgen: 1
protocol: {name: scale, title: A scale, revision: "1", source: In the manner of MT-SICS, doc: Weights}
enums:
  state: {type: text, values: {stable: S, dynamic: D}}
  unit: {type: text, values: {gram: g, kilogram: kg}}
frame:
  parts:
    start: {text: "!"}
    node: {role: address, type: u8}
    command: {role: message, type: "text[1..4]"}
    data: {role: payload, size: 0..40}
    close: {role: terminator, text: "*"}
    check: {type: u8, as: "hex[2]", algorithm: xor8, over: [node, command, data]}
    end: 0D 0A
bus: {kind: master_slave, nodes: 65..90, response_within: 100 ms}
defaults: {repeat: safe, addressing: node, separator: " "}
commands:
  weigh:
    id: S
    request: {}
    response: {state: state, weight: {type: i32, as: decimal, scale: 1/100}, unit: unit}
  weigh_now: {id: SI, request: {}, response: {id: S2, fields: {weight: {type: i32, as: decimal}}}}
  name: {id: SIN, request: {name: "text[1..20]"}, response: {}}
messages:
  error: {id: ES, direction: response, fields: {}}
"""
_COUNTED = """\
qlinkgen: 1
protocol: {name: counted, title: Counted, revision: "1", source: Example, doc: Ids of text with a length}
frame:
  parts:
    start: 7E
    length: {type: u8, counts: [name, data, crc]}
    name: {role: message, type: "text[2..9]"}
    data: {role: payload, size: 0..32}
    crc: {type: u16, algorithm: crc-16/modbus, over: [length, name, data]}
bus: {kind: master_slave, response_within: 100 ms}
defaults: {repeat: safe, response: {id: OK}}
replies:
  failed: {id: OK, fields: {zero: {type: u8, const: 0}, reason: {type: u8, range: 1..9, default: 1}}}
commands:
  open: {id: OPEN, request: {number: u16}, response: {handle: u32}}
  read: {id: READ, request: {size: {type: u8, range: 3..8}}, response: {data: "bytes[request.size]"}}
messages:
  opened: {id: OPENED, direction: response, fields: {handle: u32}}
"""


def _codec(text: str) -> Codec:
    protocol, faults = loads(text, "ids.yaml")
    assert protocol is not None, faults
    return Codec(plan_of(protocol))


@pytest.mark.parametrize("text", [METER, _SCALE, _COUNTED], ids=["meter", "scale", "counted"])
def test_outputs_agree(text: str, require_tool: Callable[..., str]) -> None:
    for compiler, package in (("gcc", "gcc"), ("clang", "clang")):
        require_tool(compiler, package=package)
    outcome = run_text(text, 5, effort=Effort(messages=3, streams=6))
    assert not outcome.refused
    assert not outcome.differences, outcome.report()


def test_frames_by_hand() -> None:
    codec = _codec(METER)
    assert codec.encode("identify", {}) == b"*IDN?\n"
    assert codec.encode("measure", {"channel": 2}) == b"MEAS:VOLT? 2\n"
    assert codec.encode("measure.response", {"value": 0xC028_99999999_999A}) == b"-1.23E+01\n"
    assert codec.encode("configure", {"mode": 1, "range": 10}) == b"CONF CURR 10\n"
    assert codec.encode("label", {"text": b"a, b"}) == b"DISP:TEXT a, b\n"
    found = codec.decode(b"1.5,CURR\n", "response")
    assert (found.message.name, found.values) == ("unasked", {"data": b"1.5,CURR"})
    found = codec.decode(b"00001.500,CURR\n", "response", b"MEAS:VOLT:AC? 1\n")
    assert (found.message.name, found.values) == ("measure_ac.response", {"value": 1500, "mode": 1})


@pytest.mark.parametrize(
    ("wire", "kind"),
    [
        (b"MEAS:VOL?\n", "unknown"),
        (b"MEAS:VOLT?2\n", "length"),
        (b"CONF\n", "length"),
    ],
)
def test_ids_that_are_not_known_and_fields_that_do_not_follow_them(wire: bytes, kind: str) -> None:
    codec = _codec(METER)
    with pytest.raises(BadFrame) as raised:
        codec.decode(wire, "request")
    assert raised.value.kind == kind
    assert [each.kind for each in dissect(codec.plan, wire, "request").faults] == [kind]
