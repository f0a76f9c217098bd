"""A slave in C that answers in another way than with the response."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from qlinkgen.backends.python import load as load_codec
from qlinkgen.schema import loads
from tests.support.cdriver import WARNINGS

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
  nak: {id: 0x7F, fields: {}}
commands:
  read: {id: 0x10, request: {number: u8}, response: {id: request.id + 0x40, fields: {value: u16}}}
  set: {id: 0x11, request: {value: u16}, response: {}, addressing: either}
  log: {id: 0x13, request: {many: {type: u8, range: 0..3}}, response: {values: "u16[request.many]"}}
  start: {id: 0x12, request: {}, response: none, addressing: broadcast}
"""
PROGRAM = r"""
#include "pump.h"
#include <stdio.h>

static bool on_read(pump_slave_t *slave, const pump_read_request_t *request, pump_read_response_t *response)
{
    const pump_read_fault_t fault = {request->number};
    if (request->number < 5U) {
        response->value = request->number;
        return true;
    }
    return (request->number < 7U) ? pump_read_fault_answer(slave, &fault) : PUMP_PENDING;
}

static bool on_set(pump_slave_t *slave, const pump_set_request_t *request)
{
    return (request->value == 0U) ? true : pump_nak_answer(slave);
}

static bool on_log(pump_slave_t *slave, const pump_log_request_t *request, pump_log_response_t *response)
{
    (void)slave;
    response->values[0] = request->many;
    return true;
}

int main(int count, char **asked)
{
    static pump_slave_t slave;
    static uint8_t wire[PUMP_MAX_WIRE_SIZE];
    slave.node = 3U;
    slave.read = on_read;
    slave.set = on_set;
    slave.log = on_log;
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
        for (size_t index = 0; index < size; ++index) {
            printf("%02x", (unsigned)wire[index]);
        }
        printf("\n");
    }
    return 0;
}
"""


def built(
    folder: Path, compiler: str, *options: str, schema: str = SCHEMA, text_of_main: str = PROGRAM
) -> Path:
    protocol, faults = loads(schema, "pump.yaml")
    assert protocol is not None, faults
    for name, text in c.generate(protocol, Options()).items():
        (folder / Path(name).name).write_text(text)
    (folder / "main.c").write_text(text_of_main)
    program = folder / "main"
    command = [compiler, *options, *WARNINGS, "-I", str(folder), str(folder / "main.c"), "-o", str(program)]
    subprocess.run(command, check=True)
    return program


@pytest.mark.parametrize(("compiler", "package"), [("gcc", "gcc"), ("clang", "clang")])
def test_a_function_answers_with_a_reply(
    tmp_path: Path, compiler: str, package: str, require_tool: Callable[..., str]
) -> None:
    require_tool(compiler, package=package)
    protocol, _ = loads(SCHEMA, "pump.yaml")
    assert protocol is not None
    pump = load_codec(protocol)
    cases = [
        (pump.ReadRequest(node=3, number=4), pump.ReadResponse(node=3, value=4).to_frame()),
        (pump.ReadRequest(node=3, number=5), pump.ReadFault(node=3, reason=5).to_frame()),
        (pump.ReadRequest(node=3, number=8), b""),  # no answer now, and none left from before
        (pump.ReadRequest(node=4, number=5), b""),
        (pump.SetRequest(node=3, value=0), pump.SetResponse(node=3).to_frame()),
        (pump.SetRequest(node=3, value=1), pump.Nak(node=3).to_frame()),
        (pump.LogRequest(node=3, many=2), pump.LogResponse(node=3, values=[2, 0]).to_frame()),
        (pump.LogRequest(node=3, many=0), pump.LogResponse(node=3, values=[]).to_frame()),
        (pump.SetRequest(node=0, value=1), b""),  # a broadcast is not answered
    ]
    program = built(tmp_path, compiler, "-O1", "-std=c99")
    arguments = [request.to_frame().hex() for request, _ in cases]
    told = subprocess.run([program, *arguments], check=True, capture_output=True, text=True).stdout
    assert told.splitlines() == [answer.hex() for _, answer in cases]


@pytest.mark.parametrize(("compiler", "package"), [("gcc", "gcc"), ("clang", "clang")])
@pytest.mark.parametrize("reply", ["fault", "nak"])
def test_a_slave_refuses_what_it_does_not_know(
    tmp_path: Path, compiler: str, package: str, reply: str, require_tool: Callable[..., str]
) -> None:
    require_tool(compiler, package=package)
    stated = f"to_unknown: {{{reply}: {'{reason: 9}' if reply == 'fault' else '{}'}}}\ncommands:"
    schema = SCHEMA.replace("commands:", stated).replace("  parts:\n", "  parts:\n    start: A5\n")
    protocol, faults = loads(schema, "pump.yaml")
    assert protocol is not None, faults
    pump = load_codec(protocol)

    def refusal(number: int) -> bytes:
        if reply == "nak":
            return bytes(pump.Nak(node=3).to_frame())
        return bytes(type("Other", (pump.ReadFault,), {"ID": number + 0x80})(node=3, reason=9).to_frame())

    def unknown(number: int, node: int) -> bytes:
        frame = bytes([0xA5, node, number, 1, 7])
        crc = pump._CHECKSUM
        return frame + int(crc.compute(frame[1:3] + frame[4:], crc.start)).to_bytes(2, "big")

    cases = [
        (pump.ReadRequest(node=3, number=4).to_frame(), pump.ReadResponse(node=3, value=4).to_frame()),
        (unknown(0x22, 3), refusal(0x22)),
        (unknown(0x22, 4), b""),
        (unknown(0x22, 0), b""),
        (unknown(0x90, 3), b"" if reply == "fault" else refusal(0)),  # no number is left for its refusal
        (pump.LogRequest(node=3, many=2).to_frame(), refusal(0x13)),
        (pump.SetRequest(node=3, value=0).to_frame(), pump.SetResponse(node=3).to_frame()),
    ]
    source = PROGRAM.replace("PUMP_REQUEST, ", "").replace("slave.log = on_log", "(void)on_log")
    program = built(tmp_path, compiler, "-O1", "-std=c99", schema=schema, text_of_main=source)
    arguments = [request.hex() for request, _ in cases]
    told = subprocess.run([program, *arguments], check=True, capture_output=True, text=True).stdout
    assert told.splitlines() == [answer.hex() for _, answer in cases]


def test_headers_without_replies_have_nothing_of_them() -> None:
    text = SCHEMA.replace("  fault: {id: request.id + 0x80, fields: {reason: u8}}\n", "")
    text = text.replace("replies:\n  nak: {id: 0x7F, fields: {}}\n", "")
    protocol, faults = loads(text, "pump.yaml")
    assert protocol is not None, faults
    assert "replying" not in "".join(c.generate(protocol, Options()).values())
