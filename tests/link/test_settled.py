"""Messages that state values of their frames beside their ids: on both sides, in Python, C and construct."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import construct
import pytest

from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from qlinkgen.backends.construct.live import live
from qlinkgen.backends.python import load as load_codec
from qlinkgen.link import SlaveEngine
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import plan_of
from qlinkgen.plan.codec import Codec
from qlinkgen.schema import loads
from qlinkgen.sim.generic import GenericNode
from tests.support.cdriver import WARNINGS

SCHEMA = """\
qlinkgen: 1
protocol: {name: pump, title: Pump, revision: "1", source: Manual}
enums: {sort: {type: u8, values: {slow: 1, fast: 2}}}
frame:
  parts:
    start: B5
    head:
      type: u8
      bits:
        function: {at: 0..3, role: message}
        valid: 4
        way: {at: 6, role: direction, values: {request: 1, response: 0}}
    tag: {type: u8, range: 1..9, default: 1}
    again: {type: u8, equals: ~tag}
    sort: {type: sort, default: slow}
    length: {type: u8, counts: data}
    data: {role: payload, size: 0..40}
    sum: {type: u8, algorithm: sum8, over: [head, tag, again, sort, length, data]}
bus: {kind: master_slave, baud: 9600, response_within: 10 ms}
defaults: {repeat: unsafe}
replies: {nak: {id: {function: 1, tag: 7}, fields: {}}}
commands:
  confirmed:
    id: {function: 3, valid: 1}
    request: {data: u8}
    response: {id: {function: 0, sort: 2}, fields: {}}
  plain: {id: 4, request: {}, response: {level: u8}}
"""
PROGRAM = r"""
#include "pump.h"
#include <stdio.h>

static bool on_confirmed(pump_slave_t *slave, const pump_confirmed_request_t *request)
{
    return (request->data > 0U) ? true : pump_nak_answer(slave);
}

int main(int count, char **asked)
{
    static pump_slave_t slave;
    static uint8_t wire[PUMP_MAX_WIRE_SIZE];
    const pump_confirmed_request_t message = PUMP_CONFIRMED_REQUEST_INIT;
    const pump_parts_t wrong = PUMP_PARTS_INIT;
    const pump_parts_t right = PUMP_CONFIRMED_REQUEST_PARTS_INIT;
    if (pump_confirmed_request_to_frame(&message, &wrong, wire, sizeof wire) != PUMP_ERROR_RANGE) {
        return 2;
    }
    if (pump_confirmed_request_to_frame(&message, &right, wire, sizeof wire) != 8) {
        return 3;
    }
    slave.confirmed = on_confirmed;
    for (int at = 1; at < count; ++at) {
        uint8_t bytes[64];
        size_t size = 0;
        pump_frame_t frame;
        unsigned byte;
        while (sscanf(&asked[at][2U * size], "%2x", &byte) == 1) {
            bytes[size++] = (uint8_t)byte;
        }
        if (pump_frame_decode(&frame, bytes, size) != PUMP_OK) {
            return 1;
        }
        size = pump_slave_dispatch(&slave, &frame, wire, sizeof wire);
        for (size_t index = 0; index < size; ++index) {
            printf("%02x", (unsigned)wire[index]);
        }
        printf(".\n");
    }
    return 0;
}
"""
CONFIRMED, OTHER = bytes.fromhex("b553 01fe 01 01 05 59"), bytes.fromhex("b543 01fe 01 01 05 49")


@pytest.fixture(scope="module")
def protocol() -> Protocol:
    found, faults = loads(SCHEMA, "pump.yaml")
    assert found is not None, faults
    return found


@pytest.fixture(scope="module")
def pump(protocol: Protocol) -> ModuleType:
    return load_codec(protocol)


class TestPython:
    def test_a_message_has_it_by_default(self, pump: ModuleType) -> None:
        assert pump.ConfirmedRequest(data=5).to_frame() == CONFIRMED
        assert pump.ConfirmedResponse().sort == 2
        assert pump.Nak().tag == 7
        assert pump.PlainRequest().tag == 1

    def test_and_no_other_value(self, pump: ModuleType) -> None:
        with pytest.raises(ValueError, match="valid"):
            pump.ConfirmedRequest(data=5, valid=False).to_frame()
        with pytest.raises(ValueError, match="valid"):
            pump.decode_request(OTHER)
        (fault,) = pump.StreamDecoder("request").feed(OTHER)
        assert fault.kind == "range"


def test_the_interpreter_agrees(protocol: Protocol) -> None:
    codec = Codec(plan_of(protocol))
    assert codec.encode("confirmed.request", {"data": 5}) == CONFIRMED
    assert codec.decode(CONFIRMED, "request").beside == {"valid": 1, "tag": 1, "sort": 1}
    with pytest.raises(ValueError, match="valid"):
        codec.decode(OTHER, "request")


def test_construct_agrees(protocol: Protocol) -> None:
    frame = live(protocol).frames["request"]
    assert frame.build({"message": "confirmed.request", "fields": {"data": 5}}) == CONFIRMED
    assert frame.parse(CONFIRMED).valid
    with pytest.raises(construct.ConstructError, match="valid"):
        frame.parse(OTHER)
    with pytest.raises(construct.ConstructError, match="always 1"):
        frame.build({"message": "confirmed.request", "valid": False, "fields": {"data": 5}})


def test_a_slave_sends_it(pump: ModuleType) -> None:
    engine = SlaveEngine(pump, GenericNode(pump))
    engine.receive(CONFIRMED, 0.0)
    assert engine.bytes_to_send(0.1) == pump.ConfirmedResponse(sort=2).to_frame()


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_a_slave_in_c_sends_it(
    pump: ModuleType, protocol: Protocol, tmp_path: Path, compiler: str, require_tool: Callable[..., str]
) -> None:
    require_tool(compiler, package=compiler)
    for name, text in c.generate(protocol, Options()).items():
        (tmp_path / Path(name).name).write_text(text)
    (tmp_path / "main.c").write_text(PROGRAM)
    program = tmp_path / "main"
    command = [compiler, *WARNINGS, "-I", str(tmp_path), str(tmp_path / "main.c"), "-o", str(program)]
    subprocess.run(command, check=True)
    refused: Any = pump.ConfirmedRequest(data=0).to_frame()
    asked = [each.hex() for each in (CONFIRMED, refused, OTHER)]
    said = subprocess.run([program, *asked], check=True, capture_output=True, text=True).stdout.split()
    answers = [pump.ConfirmedResponse().to_frame(), pump.Nak().to_frame(), b""]
    assert said == [f"{answer.hex()}." for answer in answers]


KINDS = """\
qlinkgen: 1
protocol: {name: meter, revision: "1", source: Manual}
types:
  control:
    type: u8
    bits: {function: {at: 0..3, role: message}, valid: 4, way: {at: 6, role: direction, values: {request: 1, response: 0}}}
frames:
  short:
    parts: {start: 10, control: control, sum: {type: u8, algorithm: sum8, over: [control]}, stop: 16}
  long:
    parts:
      start: 68
      length: {type: u8, counts: [control, data]}
      control: control
      data: {role: payload, size: 0..252}
      sum: {type: u8, algorithm: sum8, over: [control, data]}
      stop: 16
bus: {kind: master_slave}
defaults: {repeat: safe}
commands:
  read: {frame: short, id: {function: 11, valid: 1}, request: {}, response: {frame: long, id: {function: 8, valid: 1}, fields: {level: u8}}}
  send: {frame: long, id: {function: 3, valid: 1}, request: {level: u8}, response: {frame: short, id: 0, fields: {}}}
"""  # noqa: E501


def test_several_kinds_of_frame() -> None:
    protocol, faults = loads(KINDS, "meter.yaml")
    assert protocol is not None, faults
    meter, codec, frame = load_codec(protocol), Codec(plan_of(protocol)), live(protocol).frames["request"]
    for request, values, right, wrong in (
        (meter.ReadRequest(), {}, "105b5b16", "104b4b16"),
        (meter.SendRequest(level=7), {"level": 7}, "680253075a16", "680243074a16"),
    ):
        wire, other = bytes.fromhex(right), bytes.fromhex(wrong)
        assert request.to_frame() == codec.encode(request.NAME, values) == wire
        assert frame.build({"message": request.NAME, "fields": values}) == wire
        request.valid = False
        with pytest.raises(ValueError, match="valid"):
            request.to_frame()
        (fault,) = meter.StreamDecoder("request").feed(other)
        assert fault.kind == "range"
        with pytest.raises(ValueError, match="valid"):
            codec.decode(other, "request")
        with pytest.raises(construct.ConstructError, match="valid"):
            frame.parse(other)
