"""Receiver and decoder of whole frames agree with the interpreter of the plan for any damage.

The family: the shipped protocols and those for tests, and shapes of frames from `test_shapes`. Messages,
faults and the bytes that complete them are equal.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Callable
from pathlib import Path

import pytest

from qlinkgen.model.message import Direction
from qlinkgen.plan import Plan, plan_of
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.ends import Hunt, InStep
from qlinkgen.schema import loads
from tests.c import test_shapes
from tests.c.conftest import PROTOCOLS, SANITIZED, protocol_of
from tests.support.agreement import compare, events, kind, wire
from tests.support.cdriver import Driver, build, raw_text
from tests.support.random_raw import damaged, random_address, random_values

#: Texts that end with a byte in a frame without a length: bytes before them have a count.
LABELS = """\
qlinkgen: 1
protocol: {name: labels, title: Labels, revision: "1", source: this test, doc: Texts that end with a byte.}
frame:
  parts:
    code: {role: message, type: u8}
    data: {role: payload, size: 0..60}
    sum: {type: u8, algorithm: sum8, over: [code, data]}
bus: {kind: master_slave}
defaults: {repeat: safe}
commands:
  label:
    id: 1
    request:
      many: {type: u8, counts: data}
      data: "bytes[0..8]"
      name: {type: "text[0..8]", terminator: 00}
      place: u16
      note: {type: "text[1..8]", terminator: 00}
    response: none
"""
ROUNDS = 40
CASES = [
    (name, direction)
    for name in PROTOCOLS
    for direction in protocol_of(name).directions
    if not (name == "mc1231a" and direction == "response")
]


@pytest.mark.parametrize(("name", "direction"), CASES)
def test_agrees_with_the_interpreter(
    name: str, direction: Direction, drivers: Callable[[str], Driver]
) -> None:
    rng = random.Random(f"{name} {direction}")
    compare(plan_of(protocol_of(name)), direction, drivers(name), rng, ROUNDS)


def test_every_shape_agrees(shared: Path, require_tool: Callable[..., str]) -> None:
    compiler = require_tool("gcc", package="gcc")
    some = itertools.islice(test_shapes.pairs(), 16)  # the first have the most pairs of options
    for number, (_, protocol) in enumerate(itertools.chain(some, [*test_shapes.others()][::9])):
        plan, rng = plan_of(protocol), random.Random(number)
        with Driver(build(protocol, shared / "shapes", compiler, ("-O0", "-std=c99"))) as driver:
            for direction in protocol.directions:
                if direction != "response" or not plan.frame.needs_request:
                    compare(plan, direction, driver, rng, 8)


@pytest.mark.parametrize("name", ["mc1231a", "unchecked"])
def test_answers_of_packets_agree(
    name: str, shared: Path, drivers: Callable[[str], Driver], require_tool: Callable[..., str]
) -> None:
    """The decoder of responses agrees with the plan for valid and damaged responses to a request."""
    if name == "mc1231a":
        _answers(plan_of(protocol_of(name)), drivers(name))
        return
    frame, nodes, _ = test_shapes.OTHERS["packet"]
    shape = {"fields": "numbers", "traffic": "command"}
    protocol, _ = loads("\n".join(test_shapes._text(name, [frame], nodes, shape)), "unchecked.yaml")
    assert protocol
    compiler = require_tool("gcc", package="gcc")
    with Driver(build(protocol, shared / "shapes", compiler, SANITIZED)) as driver:
        _answers(plan_of(protocol), driver)


def _answers(plan: Plan, driver: Driver) -> None:
    assert isinstance(plan.frame.receiver, InStep)
    rng = random.Random(1)
    for command in plan.commands:
        if command.response is None:
            continue
        asked, answer = plan.by_name[command.request.name], plan.by_name[command.response.name]
        for number in range(6):
            request = wire(plan, asked, rng)
            frame = Codec(plan).wrap(answer.name, rng.randbytes(answer.payload.most), request=request)
            frame = damaged(frame, rng, b"\x00") if number % 3 else frame
            said = driver.ask("decode", answer.name, frame.hex() or "-", request.hex()).split()
            due = kind(plan, "response", frame, request)
            assert (said[0] == "ok" and due == "intact") or said == ["error", due], (frame.hex(), due)


def test_no_receiver_waits_for_the_byte_after_a_stuffed_end(
    shared: Path, require_tool: Callable[..., str]
) -> None:
    """A frame is delivered with its last byte, a fault with the first wrong byte."""
    shape = {key: next(iter(test_shapes.AXES[key])) for key in test_shapes.AXES}
    shape |= {"start": "start", "length": "u8 length", "check": "sum", "stuffing": "stuffing"}
    shape |= {"fields": "one byte", "traffic": "command"}
    protocol = test_shapes.built(shape, "late")
    assert protocol
    plan = plan_of(protocol)
    assert not isinstance(plan.frame.receiver, Hunt)
    good, stuffed = bytes.fromhex("dc01010506"), bytes.fromhex("dc0101dbdc00")
    early = ["4:message:set.request:-:db", "9:message:set.request:-:05"]
    assert events(plan, "request", stuffed[:-1] + good) == early
    streams = (good + good, stuffed + good, stuffed[:-1] + good, stuffed[:-1], b"\xdc\x01\xdc\x05" + good)
    with Driver(build(protocol, shared / "shapes", require_tool("gcc", package="gcc"), SANITIZED)) as driver:
        for stream in streams:
            said = driver.ask("stream", "request", stream.hex()).split()[1:]
            assert said == events(plan, "request", stream), stream.hex()


def test_a_receiver_waits_for_ends_beyond_the_received_bytes(
    shared: Path, require_tool: Callable[..., str]
) -> None:
    protocol, _ = loads(LABELS, "labels.yaml")
    assert protocol
    plan = plan_of(protocol)
    frame = Codec(plan).encode("label", {"data": b"abc", "name": b"de", "place": 7, "note": b"fgh"})
    cut = [kind(plan, "request", frame[:end]) for end in range(len(frame) + 1)]
    assert cut[1:] == ["truncated"] * (len(frame) - 1) + ["intact"]
    with Driver(build(protocol, shared / "shapes", require_tool("gcc", package="gcc"), SANITIZED)) as driver:
        assert driver.ask("cuts", "request", frame.hex()).split()[1:] == cut
        said = driver.ask("stream", "request", (frame + frame).hex()).split()[1:]
        assert said == events(plan, "request", frame + frame)


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
    assert driver.ask("encode", "set_1.response", "01", 5) == "ok 0005 00050006"
    assert driver.ask("decode", "set_1.response", "00050006", "01") == "ok - 5"
    assert driver.ask("decode", "set_1.response", "00050007", "01") == "error crc"
    assert driver.ask("decode", "set_1.response", "00050000", "01") == "error illegal"
    assert driver.ask("decode", "set_1.response", "FFFF0000", "01") == "ok - 65535"
