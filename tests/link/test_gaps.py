"""Frames that only a silence ends, on a line with time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest

from qlinkgen.backends import c, python
from qlinkgen.backends.base import Options
from qlinkgen.link import MasterEngine, SlaveEngine, Timing
from qlinkgen.link.events import Damaged
from qlinkgen.link.monitor import Asked, Monitor, Replied
from qlinkgen.schema import loads

_SCHEMA = """\
qlinkgen: 1
protocol: {name: gauge, title: Gauge, revision: "1", source: Made up}
frame:
  parts:
    node: {role: address, type: u8}
    code: {role: message, type: u8}
    data: {role: payload, size: 0..8}
    crc: {type: u16, algorithm: crc-16/modbus, over: [node, code, data]}
    gap: {role: idle, time: 4 bytes, at_least: 1 ms, alone: true}
bus: {kind: master_slave, nodes: 1..9, baud: 9600}
defaults: {addressing: node, repeat: safe}
replies: {nope: {id: request.id + 0x80, fields: {reason: u8}}}
to_unknown: {nope: {reason: 2}}
commands:
  read: {id: 1, request: {}, response: {text: text}}
  log: {id: 2, request: {}, response: {text: text}, many: {count: 2}}
  gone: {id: 3, until: 2, request: {}, response: {}}
"""
BYTE, SLACK = 10 / 9600, 0.002
IDLE = 4 * BYTE


def module(text: str = _SCHEMA, version: str | None = None) -> Any:
    protocol, faults = loads(text, "gauge.yaml", version=version)
    assert protocol is not None, faults
    return python.load(protocol)


GAUGE = module()


class Node:
    number = 3

    def handle(self, request: Any, now: float) -> Any:
        del now
        if request.NAME == "log.request":
            return [GAUGE.LogResponse(node=3, text=each) for each in ("a", "bc")]
        return GAUGE.ReadResponse(node=3, text="12.5")


def master() -> MasterEngine:
    return MasterEngine(GAUGE, Timing.of(GAUGE, host_slack=SLACK, attempts=1))


def kinds(events: Sequence[Any]) -> list[str]:
    return [event.kind if hasattr(event, "kind") else event.NAME for event in events]


def test_what_lies_between_two_silences_is_one_event() -> None:
    frame = GAUGE.ReadRequest(node=3).to_frame()
    decoder = GAUGE.StreamDecoder("request")
    assert decoder.feed(frame[:2]) == decoder.feed(frame[2:]) == []
    assert kinds(decoder.gap()) == ["read.request"]
    assert decoder.gap() == []
    assert decoder.feed(frame + frame) == []
    assert [(each.kind, each.offset, each.raw) for each in decoder.gap()] == [("crc", 4, frame * 2)]
    assert kinds(decoder.feed(bytes(40))) == ["length"]
    assert decoder.feed(frame) == []
    assert (decoder.gap(), decoder.counters.skipped) == ([], 31)
    decoder.feed(frame)
    assert kinds(decoder.finish()) == ["read.request"]


def test_a_master_waits_for_the_silence_after_an_answer() -> None:
    engine, answer = master(), GAUGE.ReadResponse(node=3, text="12.5").to_frame()
    engine.start(GAUGE.ReadRequest(node=3), 0.0)
    sent = engine.bytes_to_send(0.0)
    engine.receive(answer[:4], 0.010)
    assert engine.next_timer() == pytest.approx(0.010 + IDLE + SLACK)
    engine.receive(answer[4:], 0.013)
    assert engine.busy
    engine.handle_timer(engine.next_timer() or 0.0)
    assert engine.take().response.text == "12.5"
    assert sent == GAUGE.ReadRequest(node=3).to_frame()


def test_a_missing_answer_fails_at_the_deadline_and_half_of_one_too() -> None:
    for heard in (b"", b"\3\1"):
        engine = master()
        engine.start(GAUGE.ReadRequest(node=3), 0.0)
        engine.bytes_to_send(0.0)
        if heard:
            engine.receive(heard, 0.01)
        while engine.busy:
            engine.handle_timer(engine.next_timer() or 0.0)
        with pytest.raises(TimeoutError if not heard else Exception, match="read"):
            engine.take()


def test_a_slave_answers_after_the_silence_and_leaves_one_between_answers() -> None:
    slave = SlaveEngine(GAUGE, Node(), host_slack=SLACK)
    slave.receive(GAUGE.LogRequest(node=3).to_frame(), 1.0)
    assert slave.bytes_to_send(1.0) == b""
    due = slave.next_timer() or 0.0
    assert due == pytest.approx(1.0 + IDLE + SLACK)
    first = slave.bytes_to_send(due)
    then = slave.next_timer() or 0.0
    assert then == pytest.approx(due + len(first) * BYTE + IDLE + SLACK)
    decoder = GAUGE.StreamDecoder("response")
    found = []
    for frame in (first, slave.bytes_to_send(then)):
        decoder.feed(frame)
        found += decoder.gap()
    assert [each.text for each in found] == ["a", "bc"]
    assert slave.next_timer() is None


def test_a_slave_refuses_an_unknown_request_once() -> None:
    old = module(version="1").GoneRequest(node=3).to_frame()
    slave = SlaveEngine(GAUGE, Node())
    slave.receive(old, 1.0)
    answer = slave.bytes_to_send(slave.next_timer() or 0.0)
    assert answer[:3] == b"\x03\x83\x02"
    assert slave.bytes_to_send(9.0) == b""
    assert slave.counters.unknown == 1


def test_a_monitor_divides_frames_by_their_times() -> None:
    monitor = Monitor(GAUGE, Timing.of(GAUGE, host_slack=SLACK))
    monitor.receive(GAUGE.ReadRequest(node=3).to_frame(), 1.0)
    monitor.receive(GAUGE.ReadResponse(node=3, text="x").to_frame(), 1.015)
    monitor.handle_timer(monitor.next_timer() or 0.0)
    monitor.receive(b"\1\2\3", 2.0)
    monitor.finish(2.1)
    assert [type(each) for each in monitor.heard] == [Asked, Replied, Damaged]


def test_the_example_in_c_handles_frames_when_the_line_is_idle() -> None:
    protocol, _ = loads(_SCHEMA, "gauge.yaml")
    assert protocol is not None
    header = c.generate(protocol, Options())["c/gauge.h"]
    assert "(void)gauge_receive(&receiver, byte);" in header
    assert "if (gauge_rx_idle(&receiver) == GAUGE_EVENT_FRAME) {" in header
