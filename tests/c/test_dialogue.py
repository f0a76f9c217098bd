"""Dialogues in C: a slave that follows them, and the numbered steps of a master."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from qlinkgen.backends.python import load as load_codec
from qlinkgen.schema import loads
from tests.c.test_replies import PROGRAM as REPLYING
from tests.c.test_replies import built

SCHEMA = """\
qlinkgen: 1
protocol: {name: pump, title: Pump, revision: "1", source: Manual}
frame:
  parts:
    node: {role: address, type: u8}
    code: {role: message, type: u8}
    length: {type: u8, counts: [data]}
    data: {role: payload, size: 0..8}
    crc: {type: u16, algorithm: crc-16/modbus, over: [node, code, data]}
bus: {kind: master_slave, nodes: 1..9, broadcast: 0}
defaults: {addressing: node, repeat: safe}
replies:
  fault: {id: request.id + 0x80, fields: {reason: u8}}
messages:
  ack: {id: 0x79, direction: response, fields: {}}
commands:
  load:
    id: 0x10
    request: {}
    steps:
      - {receive: ack}
      - {name: place, send: {id: 0x11, fields: {start: u16}}}
      - {receive: ack}
      - {name: end, send: {id: 0x12, fields: {}}}
      - {name: sum, receive: {id: 0x13, fields: {sum: u16}}}
      - {name: taken, send: {id: 0x14, fields: {}}}
  dump:
    id: 0x30
    request: {size: {type: u8, range: 1..4}}
    steps:
      - {receive: ack}
      - {name: ready, send: {id: 0x31, fields: {}}}
      - {name: bytes, receive: {id: 0x32, fields: {data: "bytes[request.size]"}}}
  peek:
    id: 0x40
    request: {}
    steps:
      - {receive: ack}
      - {name: place, send: {id: 0x41, fields: {size: {type: u8, range: 1..4}}}}
      - {name: bytes, receive: {id: 0x42, fields: {data: "bytes[place.size]"}}}
  count: {id: 0x20, request: {}, response: {number: u8}}
"""
PROGRAM = r"""
#include "pump.h"
#include <stdio.h>

static uint16_t start;
static uint8_t taken;

static bool on_load(pump_slave_t *slave)
{
    (void)slave;
    return true;
}

static bool on_place(pump_slave_t *slave, const pump_load_place_t *request)
{
    const pump_load_fault_t fault = {4};
    start = request->start;
    if (start == 1U) {
        slave->turn = slave->due;
    }
    return (start == 0U) ? pump_load_fault_answer(slave, &fault) : (start != 1U);
}

static bool on_end(pump_slave_t *slave, pump_load_sum_t *response)
{
    (void)slave;
    response->sum = (uint16_t)(start + 1U);
    return true;
}

static void on_taken(pump_slave_t *slave)
{
    (void)slave;
    ++taken;
}

static bool on_count(pump_slave_t *slave, pump_count_response_t *response)
{
    (void)slave;
    response->number = taken;
    return true;
}
""" + REPLYING[REPLYING.index("\nint main") :].replace(
    "slave.read = on_read;", "slave.load = on_load;\n    slave.load_place = on_place;"
).replace("slave.set = on_set;", "slave.load_end = on_end;\n    slave.load_taken = on_taken;").replace(
    "slave.log = on_log;", "slave.count = on_count;"
)
MASTER = r"""
#include "pump.h"
#include <stdio.h>

int main(void)
{
    const uint8_t ids[] = {0x10, 0x13, 0x79, 0x79, 0x11, 0x79, 0x12, 0x13, 0x14, 0x14};
    uint8_t step = 0;
    for (size_t at = 0; at < sizeof ids; ++at) {
        step = pump_load_next(step, ids[at]);
        printf("%u ", (unsigned)step);
    }
    return (step == PUMP_LOAD_STEPS) ? 0 : 1;
}
"""


@pytest.mark.parametrize(("compiler", "package"), [("gcc", "gcc"), ("clang", "clang")])
def test_a_slave_follows_the_steps(
    tmp_path: Path, compiler: str, package: str, require_tool: Callable[..., str]
) -> None:
    require_tool(compiler, package=package)
    protocol, faults = loads(SCHEMA, "pump.yaml")
    assert protocol is not None, faults
    pump = load_codec(protocol)
    ack, load, end = pump.Ack(node=3), pump.LoadRequest(node=3), pump.LoadEnd(node=3)
    whole = [
        (load, ack),
        (pump.LoadPlace(node=3, start=7), ack),
        (end, pump.LoadSum(node=3, sum=8)),
        (pump.LoadTaken(node=3), None),
        (pump.CountRequest(node=3), pump.CountResponse(node=3, number=1)),
    ]
    cases = [
        *whole,
        (pump.LoadTaken(node=3), None),  # not its turn
        (pump.LoadPlace(node=3, start=7), None),
        (load, ack),
        (end, None),  # leaves the dialogue
        (pump.LoadPlace(node=3, start=7), None),
        (load, ack),
        (pump.LoadPlace(node=4, start=7), None),  # to another node
        (pump.LoadPlace(node=3, start=1), None),  # asked for once more
        (pump.LoadPlace(node=3, start=0), pump.LoadFault(node=3, reason=4)),
        (pump.LoadPlace(node=3, start=2), None),  # after a refusal
        (load, ack),
        (pump.CountRequest(node=3), pump.CountResponse(node=3, number=1)),
        (pump.LoadPlace(node=3, start=2), None),
    ]
    program = built(tmp_path, compiler, "-O1", "-std=c99", schema=SCHEMA, text_of_main=PROGRAM)
    arguments = [sent.to_frame().hex() for sent, _ in cases]
    told = subprocess.run([program, *arguments], check=True, capture_output=True, text=True).stdout
    assert told.splitlines() == [answer.to_frame().hex() if answer else "" for _, answer in cases]


@pytest.mark.parametrize(("compiler", "package"), [("gcc", "gcc"), ("clang", "clang")])
def test_a_master_numbers_the_steps(
    tmp_path: Path, compiler: str, package: str, require_tool: Callable[..., str]
) -> None:
    require_tool(compiler, package=package)
    program = built(tmp_path, compiler, "-O1", "-std=c99", schema=SCHEMA, text_of_main=MASTER)
    told = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    assert told.split() == ["1", "1", "2", "2", "3", "4", "5", "6", "7", "7"]


def test_an_answer_begins_with_the_size_of_the_frame_before_it() -> None:
    protocol, faults = loads(SCHEMA, "pump.yaml")
    assert protocol is not None, faults
    header = "".join(c.generate(protocol, Options()).values())
    assert header.count("response.data_size = (uint8_t)request.size;") == 1


def test_headers_without_dialogues_have_nothing_of_them() -> None:
    text = SCHEMA[: SCHEMA.index("  load:")] + SCHEMA[SCHEMA.index("  count:") :]
    protocol, faults = loads(text, "pump.yaml")
    assert protocol is not None, faults
    header = "".join(c.generate(protocol, Options()).values())
    assert "turn;" not in header
    assert "Dialogue" not in header
