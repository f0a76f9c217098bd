"""A slave in C that answers until another command stops it."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from qlinkgen.backends.python import load as load_codec
from qlinkgen.schema import loads
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
replies: {nak: {id: 0x7F, fields: {}}}
commands:
  scan: {id: 1, request: {rate: u8}, response: {value: u8}, many: {until: stop}}
  watch: {id: 2, request: {}, response: {value: u8}, many: {until: halt}}
  sense: {id: 3, request: {sensor: u8}, response: {value: u8}, many: {until: sensed}}
  stop: {id: 4, request: {}, response: {}}
  halt: {id: 5, request: {}, response: none, addressing: either}
  sensed: {id: 6, request: {sensor: u8}, response: none}
"""
PROGRAM = r"""
#include "pump.h"
#include <stdio.h>

static uint8_t refusals;

static bool on_scan(pump_slave_t *slave, const pump_scan_request_t *request, pump_scan_response_t *response)
{
    response->value = 7;
    return (request->rate == 0U) ? pump_nak_answer(slave) : true;
}

static bool on_watch(pump_slave_t *slave, pump_watch_response_t *response)
{
    (void)slave; (void)response;
    return PUMP_PENDING;
}

static bool on_stop(pump_slave_t *slave)
{
    return (refusals++ == 0U) ? pump_nak_answer(slave) : true;
}

static void on_halt(pump_slave_t *slave)
{
    (void)slave;
}

int main(int count, char **asked)
{
    static pump_slave_t slave;
    static uint8_t wire[PUMP_MAX_WIRE_SIZE];
    slave.node = 3U;
    slave.scan = on_scan;
    slave.watch = on_watch;
    slave.stop = on_stop;
    slave.halt = on_halt;
    for (int at = 1; at < count; ++at) {
        uint8_t bytes[32];
        size_t size = 0;
        pump_frame_t frame;
        unsigned byte;
        while (sscanf(&asked[at][2U * size], "%2x", &byte) == 1) {
            bytes[size++] = (uint8_t)byte;
        }
        if (pump_frame_decode(PUMP_REQUEST, &frame, bytes, size) != PUMP_OK) {
            return 1;
        }
        size = pump_slave_dispatch(&slave, &frame, wire, sizeof wire);
        printf("%u%d%d\n", (unsigned)size, (int)slave.streaming.scan, (int)slave.streaming.watch);
    }
    return 0;
}
"""


@pytest.mark.parametrize(("compiler", "package"), [("gcc", "gcc"), ("clang", "clang")])
def test_a_flag_tells_that_answers_go_on(
    tmp_path: Path, compiler: str, package: str, require_tool: Callable[..., str]
) -> None:
    require_tool(compiler, package=package)
    protocol, faults = loads(SCHEMA, "pump.yaml")
    assert protocol is not None, faults
    pump = load_codec(protocol)
    cases = [
        (pump.ScanRequest(node=3, rate=0), "500"),  # refused
        (pump.ScanRequest(node=4, rate=1), "000"),
        (pump.ScanRequest(node=3, rate=1), "610"),
        (pump.WatchRequest(node=3), "011"),  # answered later
        (pump.StopRequest(node=3), "511"),  # refused
        (pump.StopRequest(node=3), "501"),
        (pump.HaltRequest(node=0), "000"),
    ]
    program = built(tmp_path, compiler, "-O1", "-std=c99", schema=SCHEMA, text_of_main=PROGRAM)
    arguments = [request.to_frame().hex() for request, _ in cases]
    told = subprocess.run([program, *arguments], check=True, capture_output=True, text=True).stdout
    assert told.split() == [expected for _, expected in cases]
