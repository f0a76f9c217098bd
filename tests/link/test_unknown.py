"""A slave refuses requests with a number that it does not know, and commands that it does not support."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import pytest

from qlinkgen.backends.python import load as load_codec
from qlinkgen.link import SlaveEngine
from qlinkgen.schema import loads

FRAME = """\
qlinkgen: 1
protocol: {name: pump, title: Pump, revision: "1", source: Manual}
frame:
  parts:
    START
    node: {role: address, type: u8}
    code: {role: message, type: u8}
    data: {role: payload, size: 0..8}
    crc: {type: u16, algorithm: crc-16/modbus, over: [node, code, data]}
    END
bus: {kind: master_slave, nodes: 1..9, broadcast: 0, baud: 9600}
defaults: {addressing: node, repeat: safe}
replies:
  nope: {id: ID, fields: {reason: u8, detail: {type: u16, default: 7}}}
to_unknown: {nope: {reason: 2}}
commands:
  read: {id: 0x10, request: {number: u8}, response: {value: u16}}
  stop: {id: 0x11, request: {}, response: none, addressing: either}
"""
START_OF = "start: A5\n    length: {type: u8, counts: [data]}"
SILENCE = "gap: {role: idle, time: 3.5 bytes}"


def made(start: str, end: str, number: str) -> ModuleType:
    text = FRAME.replace("START", start).replace("END", end).replace("id: ID", f"id: {number}")
    protocol, faults = loads(text, "pump.yaml")
    assert protocol is not None, faults
    return load_codec(protocol)


class Silent:
    number = 3

    def handle(self, request: Any, now: float) -> None:
        return None


def asked(codec: Any, node: int, number: int) -> bytes:
    """A request with any number."""
    kind = type("Other", (codec.ReadNope if hasattr(codec, "ReadNope") else codec.Nope,), {"ID": number})
    wire: bytes = kind(node=node, reason=0).to_frame()
    return wire


def test_a_fault_of_the_decoder_is_refused() -> None:
    codec: Any = made(START_OF, "", "request.id + 0x80")
    slave = SlaveEngine(codec, Silent())
    slave.receive(asked(codec, 3, 0x22), 1.0)
    answer = slave.bytes_to_send(1.0)
    assert answer[3] == 0xA2
    assert answer[4:7] == b"\x02\x00\x07"
    assert slave.counters.unknown == 1
    slave.receive(asked(codec, 4, 0x22) + asked(codec, 3, 0xA2), 2.0)
    assert slave.bytes_to_send(3.0) == b""
    assert slave.counters.unknown == 1


def test_a_reply_may_have_a_number_of_its_own() -> None:
    codec: Any = made(START_OF, "", "0x7F")
    slave = SlaveEngine(codec, Silent())
    slave.receive(asked(codec, 3, 0x22), 1.0)
    assert codec.decode_response(slave.bytes_to_send(1.0)) == codec.Nope(node=3, reason=2)


@pytest.mark.parametrize("cut", [0, 3])
def test_a_silence_ends_an_unknown_request(cut: int) -> None:
    codec: Any = made("", SILENCE, "request.id + 0x80")
    slave = SlaveEngine(codec, Silent())
    silence = 3.5 * 10 / 9600
    wire = asked(codec, 3, 0x22)
    slave.receive(wire[:cut], 1.0)
    assert slave.bytes_to_send(1.01) == b""  # the line is slow, or its adapter
    slave.receive(wire[cut:], 1.02)
    assert slave.bytes_to_send(1.02) == b""
    due = slave.next_timer() or 0.0
    assert due == pytest.approx(1.02 + silence)
    answer = slave.bytes_to_send(due)
    assert answer[:2] == b"\x03\xa2"
    assert slave.next_timer() is None


def test_a_known_request_is_not_refused() -> None:
    codec: Any = made("", SILENCE, "request.id + 0x80")
    slave = SlaveEngine(codec, Silent())
    slave.receive(codec.ReadRequest(node=3, number=1).to_frame(), 1.0)
    assert slave.bytes_to_send(2.0) == b""
    assert slave.next_timer() is None
