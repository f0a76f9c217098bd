"""Fields that depend on values of the frame: on both sides, in Python, C and construct."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from construct import ConstructError

from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from qlinkgen.errors import Refused
from qlinkgen.link import MasterEngine, SlaveEngine, Timing
from qlinkgen.plan import plan_of
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.dissect import dissect
from qlinkgen.plan.reading import BadFrame
from qlinkgen.sim.generic import GenericNode
from tests.link.line import drive
from tests.records.targets import Targets
from tests.support.cdriver import WARNINGS

TARGETS = Targets(
    """\
qlinkgen: 1
protocol: {name: servo, title: Servo, revision: "1", source: Manual}
enums: {fault: {type: u8, values: {none: 0, range: 1, busy: 2}}}
frame:
  parts:
    start: AA
    length: {type: u8, counts: data}
    node: {role: address, type: u8}
    code: {role: message, type: u8}
    head: {type: u8, bits: {long: 0, level: {at: 1..4, signed: true, range: -5..5}}, if: {direction: request}}
    fault: {type: fault, if: {direction: response}}
    data: {role: payload, size: 0..32}
    form: {type: u8, range: 0..9, default: 2}
    sum: {type: u8, algorithm: sum8, over: [length, node, code, head, fault, data, form]}
bus: {kind: master_slave, nodes: 1..8, baud: 9600, response_within: 10 ms}
defaults: {addressing: node, repeat: safe, response: {means: {switch: fault, cases: {1..2: refused}}}}
commands:
  read:
    id: 2
    request: {place: {type: u16}, far: {type: u8, if: long}, near: {type: u8, if: {place: 7, level: -5..-2}}}
    response: {value: {type: u32, if: {fault: none}}, limit: {type: u16, if: {fault: range}}}
  tell:
    id: 3
    request: {data: {switch: form, cases: {1: {a: u8, b: u16}, 2: u16}, default: "bytes[0..9]"}}
    response: {mark: {type: u8, const: 9, if: {form: 3}}}
"""
)
#: Values, those of the frame included, and the payload.
RIGHT: list[tuple[str, dict[str, Any], str]] = [
    ("read.request", {"place": 7}, "0007"),
    ("read.request", {"long": 1, "place": 1, "far": 9}, "0001 09"),
    ("read.request", {"level": -2, "place": 7, "near": 8}, "0007 08"),
    ("read.response", {"value": 5}, "00000005"),
    ("read.response", {"fault": 1, "value": None, "limit": 258}, "0102"),
    ("read.response", {"fault": 2, "value": None}, ""),
    ("tell.request", {"form": 1, "data": {"a": 1, "b": 2}}, "01 0002"),
    ("tell.request", {"data": 3}, "0003"),
    ("tell.request", {"form": 9, "data": b"abc"}, "616263"),
    ("tell.response", {"form": 3}, "09"),
    ("tell.response", {}, ""),
]


def direction(name: str) -> Any:
    return name.partition(".")[2]


@pytest.mark.parametrize(("name", "values", "payload"), RIGHT)
def test_every_target(name: str, values: dict[str, Any], payload: str) -> None:
    codec, module = Codec(plan_of(TARGETS.protocol)), TARGETS.module
    wire = codec.encode(name, values, 3)
    decoded = codec.decode(wire, direction(name))
    assert decoded.payload == bytes.fromhex(payload)
    assert {**decoded.beside, **decoded.values}.items() >= values.items()
    natives = dict(values)
    if isinstance(values.get("data"), dict):
        natives["data"] = module.TellRequestDataCase1(**values["data"])
    message = module.MESSAGES[name](node=3, **natives)
    assert message.to_frame() == wire
    assert getattr(module, f"decode_{direction(name)}")(wire) == message
    frame = TARGETS.live.frames[direction(name)]
    assert frame.build(frame.parse(wire)) == wire


@pytest.mark.parametrize(
    ("name", "wire", "kind"),
    [
        ("read.request", "aa 02 03 02 01 0007 02 0f", "length"),
        ("read.request", "aa 03 03 02 00 0007 01 02 0f", "length"),
        ("read.request", "aa 02 03 02 0d 0007 02 19", "range"),  # the level, before what depends on it
        ("read.request", "aa 02 03 02 00 0007 0a 16", "range"),
        ("read.response", "aa 04 03 02 01 00000005 02 0f", "length"),
        ("tell.response", "aa 01 03 03 00 08 03 0f", "range"),
    ],
)
def test_wrong_frames(name: str, wire: str, kind: str) -> None:
    data = bytes.fromhex(wire)
    data = data[:-1] + bytes((sum(data[1:-1]) & 0xFF,))
    plan = plan_of(TARGETS.protocol)
    with pytest.raises(BadFrame) as caught:
        Codec(plan).decode(data, direction(name))
    assert caught.value.kind == kind
    assert dissect(plan, data, direction(name)).faults[0].kind == kind
    with pytest.raises(TARGETS.module.DecodeError) as refused:
        getattr(TARGETS.module, f"decode_{direction(name)}")(data)
    assert refused.value.kind == kind
    with pytest.raises(ConstructError, match=kind):
        TARGETS.live.frames[direction(name)].parse(data)


def test_a_value_that_a_frame_does_not_have_is_refused() -> None:
    module = TARGETS.module
    with pytest.raises(module.EncodeError, match="far: 9 cannot be sent; it is present only if long is 1"):
        module.ReadRequest(node=3, place=1, far=9).to_frame()
    with pytest.raises(ConstructError, match="far"):
        TARGETS.live.payload("read.request", {"far": 9})
    assert TARGETS.live.payload("read.request", {"far": 9}, {"long": True}) == bytes.fromhex("0000 09")


def test_a_status_in_the_header_refuses_with_fields_of_its_own() -> None:
    module = TARGETS.module
    engine = MasterEngine(module, Timing.of(module, host_slack=0.002))
    slave = SlaveEngine(module, GenericNode(module, 1))
    request = module.ReadRequest(node=1, place=4)
    slave.receive(request.to_frame(), 0.0)
    assert slave.bytes_to_send(0.1) == module.ReadResponse(node=1).to_frame()
    reply = module.ReadResponse(node=1, fault=1, value=None, limit=9)
    outcome = drive(engine, request, ((0.02, reply.to_frame()),))
    assert isinstance(outcome.error, Refused)
    assert (outcome.error.reply, outcome.error.attempts) == (reply, 1)
    assert outcome.error.reason == "range"


PROGRAM = r"""
#include "servo.h"
#include <stdio.h>

static bool on_read(
    servo_slave_t *slave, const servo_read_request_t *request, servo_read_response_t *response)
{
    slave->parts.fault = (request->place > 9U) ? SERVO_FAULT_ENUM_RANGE : SERVO_FAULT_ENUM_NONE;
    response->value = request->has_far ? request->far_ : 1U;
    response->limit = 9U;
    return true;
}

int main(int count, char **asked)
{
    static servo_slave_t slave;
    static uint8_t wire[SERVO_MAX_WIRE_SIZE];

    slave.node = 3U;
    slave.read = on_read;
    for (int at = 1; at < count; ++at) {
        uint8_t bytes[64];
        size_t size = 0;
        servo_frame_t frame;
        unsigned byte;
        while (sscanf(&asked[at][2U * size], "%2x", &byte) == 1) {
            bytes[size++] = (uint8_t)byte;
        }
        if (servo_frame_decode(SERVO_REQUEST, &frame, bytes, size) != SERVO_OK) {
            return 1;
        }
        size = servo_slave_dispatch(&slave, &frame, wire, sizeof wire);
        for (size_t index = 0; index < size; ++index) {
            printf("%02x", (unsigned)wire[index]);
        }
        printf(".\n");
    }
    return 0;
}
"""


def test_a_slave_in_c(tmp_path: Path, require_tool: Callable[..., str]) -> None:
    require_tool("gcc", package="gcc")
    for name, text in c.generate(TARGETS.protocol, Options()).items():
        (tmp_path / Path(name).name).write_text(text)
    (tmp_path / "main.c").write_text(PROGRAM)
    program = tmp_path / "main"
    command = ["gcc", *WARNINGS, "-I", str(tmp_path), str(tmp_path / "main.c"), "-o", str(program)]
    subprocess.run(command, check=True)
    module = TARGETS.module
    asked = [
        module.ReadRequest(node=3, long=True, place=4, far=77),
        module.ReadRequest(node=3, place=10),
    ]
    answers = [
        module.ReadResponse(node=3, value=77),
        module.ReadResponse(node=3, fault=1, value=None, limit=9),
    ]
    given = [each.to_frame().hex() for each in asked]
    said = subprocess.run([program, *given], check=True, capture_output=True, text=True).stdout.split()
    assert said == [f"{each.to_frame().hex()}." for each in answers]


FORMS = """\
qlinkgen: 1
protocol: {name: boot, title: Boot, revision: "1", source: Manual}
byteorder: big
frame:
  parts:
    start: 1B
    size: {type: u16, counts: data}
    code: {role: message, type: u8}
    state: {type: u8, bits: {late: 0}, if: {direction: response}}
    data: {role: payload, size: 0..32}
    check: {type: u8, algorithm: xor8, over: [start, size, code, state, data]}
bus: {kind: master_slave, baud: 9600, response_within: 10 ms}
defaults: {repeat: safe}
replies:
  failed: {if: {status: 0x80..0xFF}, fields: {}}
  wrong_check: {id: 0xB0, fields: {status: u8}, means: again}
commands:
  sign_on: {id: 1, request: {}, response: {status: u8, length: {type: u8, counts: name}, name: "text[0..8]"}}
  load: {id: 6, request: {address: u32}, response: {status: u8}}
  read:
    id: 7
    request: {}
    response: {number: u8, value: u16}
    replies: {late: {if: late, fields: {number: u8, wait: u8}, means: pending, within: 2 s}}
"""


def test_a_reply_picked_by_a_value_is_another_form_of_each_response() -> None:
    targets = Targets(FORMS)
    module, codec = targets.module, Codec(plan_of(targets.protocol))
    both = [f"{name}.{way}" for name in ("load", "read", "sign_on") for way in ("request", "response")]
    assert sorted(module.MESSAGES) == [*both, "wrong_check"]
    rows: list[tuple[str, dict[str, Any], str]] = [
        ("sign_on.response", {"status": 0, "name": b"AVR"}, "00 03 415652"),
        ("sign_on.response", {"status": 0xC0, "name": None}, "C0"),
        ("read.response", {"number": 4, "value": 7}, "04 0007"),
        ("read.response", {"late": 1, "number": 4, "value": None, "wait": 9}, "04 09"),
    ]
    for name, values, payload in rows:
        assert codec.decode(codec.encode(name, values), "response").payload == bytes.fromhex(payload)
    engine = MasterEngine(module, Timing.of(module, host_slack=0.002))
    refused = module.SignOnResponse(status=0xC0, name=None).to_frame()
    outcome = drive(engine, module.SignOnRequest(), ((0.02, refused),))
    assert isinstance(outcome.error, Refused)
    late = module.ReadResponse(late=True, number=4, value=None, wait=9).to_frame()
    answer = module.ReadResponse(number=4, value=7)
    outcome = drive(engine, module.ReadRequest(), ((0.02, late), (1.5, answer.to_frame())))
    assert outcome.reply is not None
    assert outcome.reply.response == answer
    wrong = module.WrongCheck(status=1).to_frame()
    outcome = drive(
        engine, module.LoadRequest(address=1), ((0.02, wrong), (0.04, module.LoadResponse().to_frame()))
    )
    assert outcome.reply is not None
    assert (outcome.reply.response, len(outcome.sent)) == (module.LoadResponse(), 2)
