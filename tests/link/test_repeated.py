"""Answers that repeat fields of their request, pieces of its id and its address: both sides, Python and C."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from qlinkgen.backends.python import load as load_codec
from qlinkgen.errors import BadReply, Refused
from qlinkgen.link import MasterEngine, Refusal, SlaveEngine, Timing
from qlinkgen.schema import loads
from qlinkgen.sim.generic import GenericNode
from tests.link.line import drive
from tests.support.cdriver import WARNINGS

SCHEMA = """\
qlinkgen: 1
protocol: {name: pump, title: Pump, revision: "1", source: Manual}
types: {span: {fields: {first: u8, last: u8}}}
frame:
  parts:
    start: B5
    group: {role: message, type: u8}
    head: {type: u8, bits: {node: {at: 0..3, role: address}, number: {at: 4..7, role: message}}}
    tag: {type: u8, range: 1..9, default: 1}
    length: {type: u8, counts: data}
    data: {role: payload, size: 0..40}
    sum: {type: u8, algorithm: sum8, over: [group, head, tag, length, data]}
bus: {kind: master_slave, nodes: 1..8, broadcast: 0, baud: 9600, response_within: 10 ms}
defaults: {addressing: node, repeat: unsafe}
replies:
  nak:
    id: {group: 5, number: 0}
    fields: {whose: {type: u8, equals: request.group}, which: {type: u8, equals: request.number}}
messages:
  ack:
    id: {group: 5, number: 1}
    direction: response
    fields:
      whose: {type: u16, equals: request.group}
      which: {type: u8, equals: request.number}
      from: {type: u16, equals: request.node}
commands:
  set: {id: {group: 6, number: 8}, request: {period: u16}, response: ack}
  clear: {id: {group: 6, number: 9}, request: {}, response: ack}
  get:
    id: {group: 6, number: 10}
    request: {first: u8, wanted: span, name: "bytes[0..4]", marks: "u16[2]"}
    response:
      start: {type: u8, equals: request.first}
      label: {type: u8, range: 1..10, equals: request.tag}
      span: {type: span, equals: request.wanted}
      title: {type: "bytes[0..6]", equals: request.name}
      marks: {type: "u16[2]", echo: true}
      level: u16
"""
PROGRAM = r"""
#include "pump.h"
#include <stdio.h>

static bool on_set(pump_slave_t *slave, const pump_set_request_t *request, pump_ack_t *response)
{
    const pump_nak_t nak = {0U, 0U};
    (void)response;
    return (request->period > 0U) ? true : pump_nak_answer(slave, &nak);
}

static bool on_clear(pump_slave_t *slave, pump_ack_t *response)
{
    (void)slave;
    (void)response;
    return true;
}

static bool on_get(pump_slave_t *slave, const pump_get_request_t *request, pump_get_response_t *response)
{
    const pump_nak_t nak = {0U, 0U};
    response->level = 7U;
    return (request->first < 9U) ? true : pump_nak_answer(slave, &nak);
}

int main(int count, char **asked)
{
    static pump_slave_t slave;
    static uint8_t wire[PUMP_MAX_WIRE_SIZE];
    slave.node = 3U;
    slave.set = on_set;
    slave.clear = on_clear;
    slave.get = on_get;
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
        printf("\n");
    }
    return 0;
}
"""


@pytest.fixture(scope="module")
def pump() -> ModuleType:
    protocol, faults = loads(SCHEMA, "pump.yaml")
    assert protocol is not None, faults
    return load_codec(protocol)


def get(pump: ModuleType, first: int = 2, tag: int = 4) -> Any:
    wanted = pump.Span(first=1, last=9)
    return pump.GetRequest(node=3, tag=tag, first=first, wanted=wanted, name=b"ab", marks=[5, 6])


def got(pump: ModuleType, **changed: Any) -> Any:
    """The response to `get`."""
    span = pump.Span(first=1, last=9)
    right = {"start": 2, "label": 4, "span": span, "title": b"ab", "marks": [5, 6], "level": 7}
    return pump.GetResponse(node=3, **{**right, **changed})


def outcome(pump: ModuleType, request: Any, answer: Any) -> Any:
    engine = MasterEngine(pump, Timing.of(pump, host_slack=0.002))
    arrival = (len(request.to_frame() + answer.to_frame()) + 1) * 10 / 9600
    return drive(engine, request, [(arrival, answer.to_frame())], attempts=1)


class TestMaster:
    def test_takes_what_repeats_the_id_of_its_request(self, pump: ModuleType) -> None:
        ack = pump.Ack(node=3, whose=6, which=8, from_=3)
        assert outcome(pump, pump.SetRequest(node=3, period=1), ack).response == ack
        assert isinstance(outcome(pump, pump.ClearRequest(node=3), ack).error, BadReply)
        wrong = pump.Ack(node=3, whose=6, which=9, from_=4)
        assert isinstance(outcome(pump, pump.ClearRequest(node=3), wrong).error, BadReply)

    def test_is_refused_by_a_reply_to_its_request_alone(self, pump: ModuleType) -> None:
        nak = pump.Nak(node=3, whose=6, which=8)
        assert isinstance(outcome(pump, pump.SetRequest(node=3, period=1), nak).error, Refused)
        assert isinstance(outcome(pump, pump.ClearRequest(node=3), nak).error, BadReply)

    @pytest.mark.parametrize(
        "changed", [{"start": 3}, {"label": 5}, {"title": b"a"}, {"marks": [5, 7]}], ids=str
    )
    def test_takes_what_repeats_fields_of_other_names(
        self, pump: ModuleType, changed: dict[str, Any]
    ) -> None:
        assert outcome(pump, get(pump), got(pump)).response == got(pump)
        assert isinstance(outcome(pump, get(pump), got(pump, **changed)).error, BadReply)


class Handlers:
    """A node that leaves to its engine what an answer repeats."""

    number = 3

    def __init__(self, pump: ModuleType) -> None:
        self._pump = pump

    def handle(self, request: Any, now: float) -> Any:
        pump = self._pump
        if isinstance(request, pump.GetRequest) and request.first < 9:
            return got(pump, start=0, label=1, title=b"", marks=[0, 0])
        if isinstance(request, pump.GetRequest) or getattr(request, "period", 1) == 0:
            raise Refusal(pump.Nak(node=3, whose=0, which=0))
        return pump.Ack(node=3, whose=0, which=0, from_=0)


def cases(pump: ModuleType) -> list[tuple[Any, Any]]:
    """Requests, and what a node answers."""
    return [
        (pump.SetRequest(node=3, period=1), pump.Ack(node=3, whose=6, which=8, from_=3)),
        (pump.SetRequest(node=3, period=0), pump.Nak(node=3, whose=6, which=8)),
        (pump.ClearRequest(node=3), pump.Ack(node=3, whose=6, which=9, from_=3)),
        (get(pump), got(pump)),
        (get(pump, first=9), pump.Nak(node=3, whose=6, which=10)),
    ]


@pytest.mark.parametrize("number", range(5))
def test_a_slave_fills_it_in(pump: ModuleType, number: int) -> None:
    request, answer = cases(pump)[number]
    engine = SlaveEngine(pump, Handlers(pump))
    engine.receive(request.to_frame(), 0.0)
    assert engine.bytes_to_send(0.0) == answer.to_frame()


def test_a_simulated_node_repeats_it(pump: ModuleType) -> None:
    node = GenericNode(pump, 3)
    assert node.handle(pump.ClearRequest(node=3), 0.0) == pump.Ack(node=3, whose=6, which=9, from_=3)
    assert node.handle(get(pump), 0.0) == got(pump, level=0)


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_a_slave_in_c_fills_it_in(
    pump: ModuleType, tmp_path: Path, compiler: str, require_tool: Callable[..., str]
) -> None:
    require_tool(compiler, package=compiler)
    protocol, _ = loads(SCHEMA, "pump.yaml")
    assert protocol is not None
    for name, text in c.generate(protocol, Options()).items():
        (tmp_path / Path(name).name).write_text(text)
    (tmp_path / "main.c").write_text(PROGRAM)
    program = tmp_path / "main"
    command = [compiler, *WARNINGS, "-I", str(tmp_path), str(tmp_path / "main.c"), "-o", str(program)]
    subprocess.run(command, check=True)
    pairs = cases(pump)
    asked = [request.to_frame().hex() for request, _ in pairs]
    said = subprocess.run([program, *asked], check=True, capture_output=True, text=True).stdout.split()
    assert said == [answer.to_frame().hex() for _, answer in pairs]
