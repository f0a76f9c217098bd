"""The receiver delivers what the reference model delivers, on streams of frames with every kind of damage."""

from __future__ import annotations

import random
from collections.abc import Callable

import pytest

from qlinkgen.model.frame import DelimitedFrame, MarkedFrame, PacketFrame
from qlinkgen.model.message import Direction, Message
from qlinkgen.model.protocol import Protocol
from tests.c.conftest import PROTOCOLS, protocol_of
from tests.support.cdriver import Driver, raw_text
from tests.support.random_raw import damaged, random_address, random_values
from tests.support.receiver_model import Event, receiver

STREAMS = 80
CASES = [
    (name, direction)
    for name in PROTOCOLS
    for direction in protocol_of(name).directions
    if not (name == "mc1231a" and direction == "response")
]


def wire_of(driver: Driver, protocol: Protocol, message: Message, rng: random.Random) -> bytes:
    address = random_address(message, rng) if protocol.address_name else "-"
    values = [
        raw_text(value, raw) for value, raw in zip(message.values, random_values(message, rng), strict=True)
    ]
    status, *rest = driver.ask("encode", message.name, address, *values).split()
    assert status == "ok", (message.name, address, values, rest)
    return bytes.fromhex(rest[1].replace("-", ""))


def marks_of(protocol: Protocol) -> bytes:
    frame = protocol.frame
    if isinstance(frame, DelimitedFrame):
        stuffing = frame.stuffing
        return frame.preamble + (stuffing.after + bytes([stuffing.insert]) if stuffing else b"") + b"\x00\x03"
    return bytes([frame.marker, 0x8A, 0x99, 0x88]) if isinstance(frame, MarkedFrame) else b"\x00\x10"


def told(event: Event) -> str:
    if event.kind != "message":
        return f"{event.at}:{event.kind}"
    address = "-" if event.address is None else event.address
    return f"{event.at}:message:{event.name}:{address}:{event.payload.hex() or '-'}"


def expected(protocol: Protocol, direction: Direction, stream: bytes) -> list[str]:
    machine, frame = receiver(protocol, direction), protocol.frame
    events = [event for byte in stream for event in machine.feed(byte)]
    if isinstance(frame, DelimitedFrame) and not frame.unique_preamble:
        events += machine.finish()
    return [told(event) for event in events]


@pytest.mark.parametrize(("name", "direction"), CASES)
def test_receiver_agrees_with_the_model(
    name: str, direction: Direction, drivers: Callable[[str], Driver]
) -> None:
    protocol, driver, rng = protocol_of(name), drivers(name), random.Random(f"{name} {direction}")
    messages, alphabet = protocol.received(direction), marks_of(protocol)
    for number in range(STREAMS):
        frames = [wire_of(driver, protocol, rng.choice(messages), rng) for _ in range(rng.randint(1, 6))]
        stream = b"".join(frames)
        if number % 10:
            stream = damaged(stream, rng, alphabet)
        assert driver.ask("stream", direction, stream.hex() or "-").split()[1:] == expected(
            protocol, direction, stream
        ), stream.hex()


@pytest.mark.parametrize(("name", "direction"), CASES)
def test_receiver_agrees_on_noise(name: str, direction: Direction, drivers: Callable[[str], Driver]) -> None:
    protocol, driver, rng = protocol_of(name), drivers(name), random.Random(f"noise {name} {direction}")
    alphabet = marks_of(protocol) + bytes(range(8))
    for _ in range(STREAMS // 3):
        stream = bytes(rng.choice(alphabet) for _ in range(rng.randint(0, 300)))
        assert driver.ask("stream", direction, stream.hex() or "-").split()[1:] == expected(
            protocol, direction, stream
        ), stream.hex()


@pytest.mark.parametrize(("name", "direction"), CASES)
def test_every_message_comes_back(name: str, direction: Direction, drivers: Callable[[str], Driver]) -> None:
    protocol, driver, rng = protocol_of(name), drivers(name), random.Random(f"messages {name}")
    for message in protocol.received(direction):
        for _ in range(8):
            address = random_address(message, rng) if protocol.address_name else "-"
            values = [
                raw_text(value, raw)
                for value, raw in zip(message.values, random_values(message, rng), strict=True)
            ]
            status, _, wire = driver.ask("encode", message.name, address, *values).split()
            assert status == "ok"
            assert driver.ask("decode", message.name, wire).split() == ["ok", str(address), *values]


def test_packets_answer_over_their_request(drivers: Callable[[str], Driver]) -> None:
    driver = drivers("mc1231a")
    assert isinstance(protocol_of("mc1231a").frame, PacketFrame)
    assert driver.ask("encode", "set_1.response", "01", 5) == "ok 0005 00050006"
    assert driver.ask("decode", "set_1.response", "00050006", "01") == "ok - 5"
    assert driver.ask("decode", "set_1.response", "00050007", "01") == "error crc"
    assert driver.ask("decode", "set_1.response", "00050000", "01") == "error illegal"
    assert driver.ask("decode", "set_1.response", "FFFF0000", "01") == "ok - 65535"
