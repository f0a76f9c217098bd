"""Slaves that answer a repeated request, told by its number, with their last answer."""

from __future__ import annotations

from functools import cache
from types import ModuleType
from typing import Any

import pytest

from qlinkgen.backends.python import load as load_codec
from qlinkgen.link import SlaveEngine
from qlinkgen.link.slave import PENDING, Refusal
from qlinkgen.model.protocol import Protocol
from qlinkgen.schema import loads

SCHEMA = """\
qlinkgen: 1
protocol: {name: meter, title: Meter, revision: "1", source: Manual}
frame:
  parts:
    start: "10"
    control:
      type: u8
      bits:
        function: {at: 0..3, role: message}
        counted: {at: 4, role: message, if: {way: request}}
        turn: {at: 5, role: counter, repeats: answered, if: {way: request, counted: 1}}
        way: {at: 6, role: direction, values: {request: 1, response: 0}}
    node: {role: address, type: u8}
    data: {role: payload, size: 0..4}
    sum: {type: u8, algorithm: sum8, over: [control, node, data]}
    stop: "16"
bus: {kind: master_slave, nodes: 1..9, broadcast: 255, baud: 2400, response_within: 100 ms}
defaults: {addressing: node, repeat: safe}
replies: {busy: {id: 9, fields: {}}}
commands:
  reset: {id: 0, addressing: either, restart: 1, request: {}, response: {}}
  take: {id: {function: 3, counted: 1}, request: {}, response: {number: u8}}
  set: {id: {function: 4, counted: 1}, request: {value: u8}, response: {}}
  peek: {id: 5, request: {}, response: {number: u8}}
"""


@cache
def loaded() -> tuple[Protocol, ModuleType]:
    protocol, faults = loads(SCHEMA, "meter.yaml")
    assert protocol is not None, faults
    return protocol, load_codec(protocol)


class Meter:
    """A node that counts what it is asked."""

    number = 3

    def __init__(self, codec: ModuleType) -> None:
        self._codec = codec
        self.asked = 0
        self.heard: Any = None
        self.answers: list[Any] = []

    def handle(self, request: Any, now: float) -> Any:
        self.asked += 1
        self.heard = request
        if self.answers:
            answer = self.answers.pop(0)
            if isinstance(answer, Exception):
                raise answer
            return answer
        if isinstance(request, self._codec.ResetRequest):
            return None if request.node == 255 else self._codec.ResetResponse(node=3)
        if isinstance(request, self._codec.SetRequest):
            return self._codec.SetResponse(node=3)
        kind = (
            self._codec.TakeResponse
            if isinstance(request, self._codec.TakeRequest)
            else self._codec.PeekResponse
        )
        return kind(node=3, number=self.asked)


def answer(slave: SlaveEngine, request: Any) -> bytes:
    """What a slave sends after a request."""
    slave.receive(request.to_frame(), 0.0)
    at = slave.next_timer()
    return b"" if at is None else slave.bytes_to_send(at)


@pytest.fixture
def codec() -> ModuleType:
    return loaded()[1]


def test_a_repeat_gets_the_answer_once_more(codec: ModuleType) -> None:
    meter = Meter(codec)
    slave = SlaveEngine(codec, meter)
    take, peek = codec.TakeRequest(node=3, turn=1), codec.PeekRequest(node=3)
    first = answer(slave, take)
    assert first == codec.TakeResponse(node=3, number=1).to_frame()
    assert answer(slave, peek) == codec.PeekResponse(node=3, number=2).to_frame()  # it is not counted
    assert answer(slave, codec.TakeRequest(node=4, turn=0)) == b""
    assert answer(slave, take) == first
    assert (meter.asked, slave.counters.repeats, slave.counters.requests) == (2, 1, 3)
    assert answer(slave, codec.TakeRequest(node=3, turn=0)) == codec.TakeResponse(node=3, number=3).to_frame()
    assert answer(slave, take) == codec.TakeResponse(node=3, number=4).to_frame()
    assert answer(slave, codec.SetRequest(node=3, turn=1, value=1)) == codec.SetResponse(node=3).to_frame()
    assert meter.asked == 5


@pytest.mark.parametrize("node", [3, 255])
def test_the_numbers_begin_anew(codec: ModuleType, node: int) -> None:
    meter = Meter(codec)
    slave = SlaveEngine(codec, meter)
    take = codec.TakeRequest(node=3, turn=1)
    answer(slave, take)
    answer(slave, codec.ResetRequest(node=node))
    assert answer(slave, take) == codec.TakeResponse(node=3, number=3).to_frame()


def test_a_refusal_is_kept_and_silence_is_not(codec: ModuleType) -> None:
    meter = Meter(codec)
    slave = SlaveEngine(codec, meter)
    take = codec.TakeRequest(node=3, turn=1)
    meter.answers = [None, Refusal(codec.Busy(node=3))]
    assert answer(slave, take) == b""
    refused = answer(slave, take)
    assert refused
    assert answer(slave, take) == refused
    assert meter.asked == 2


def test_an_answer_that_is_given_later_is_kept(codec: ModuleType) -> None:
    meter = Meter(codec)
    slave = SlaveEngine(codec, meter)
    take = codec.TakeRequest(node=3, turn=1)
    meter.answers = [PENDING]
    slave.receive(take.to_frame(), 0.0)
    assert slave.answer(meter.heard, codec.TakeResponse(node=3, number=7), 0.1)
    later = slave.bytes_to_send(0.2)
    assert later == codec.TakeResponse(node=3, number=7).to_frame()
    assert answer(slave, take) == later
    assert meter.asked == 1
