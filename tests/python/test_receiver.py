"""The generated stream decoders return the events of the byte-at-a-time reference for any pieces."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qlinkgen.plan import Plan, plan_of
from qlinkgen.plan.receive import Event, receiver
from tests.python.protocols import EVERY, directions, module, protocol, stream, wire_of
from tests.support import strategies

STREAMS = [(name, direction) for name in EVERY for direction in directions(name)]


def some_wire(name: str, direction: Any) -> st.SearchStrategy[bytes]:
    """A valid frame, one with a byte changed, lost or added, a truncated one, or noise."""
    kinds = module(name).MESSAGES
    good = strategies.messages(protocol(name), direction).map(
        lambda both: wire_of(name, both[0], kinds[both[0].name](**both[1]))
    )
    damaged = st.tuples(
        good,
        st.integers(0, 400),
        st.sampled_from([b"", b"\xa5", b"\x00", b"\xff", b"\x7e\x7e"]),
        st.integers(0, 2),
    )
    spoilt = damaged.map(lambda d: d[0][: d[1] % len(d[0])] + d[2] + d[0][d[1] % len(d[0]) + d[3] :])
    cut = st.tuples(good, st.integers(0, 400)).map(lambda both: both[0][: both[1] % len(both[0])])
    return st.one_of(good, good, spoilt, cut, strategies.junk(protocol(name)))


@functools.cache
def streams(name: str, direction: Any) -> st.SearchStrategy[bytes]:
    return st.lists(some_wire(name, direction), max_size=6).map(b"".join)


def summary(events: Iterable[Any]) -> list[tuple[Any, ...]]:
    """Events with all properties that must be reproducible."""
    return [(e.kind, e.offset, e.raw) if hasattr(e, "kind") else ("message", repr(e), b"") for e in events]


def described(events: Iterable[Any]) -> list[tuple[object, ...]]:
    """Events of the generated decoder, in the form of the reference."""
    return [
        ("fault", e.kind, e.offset)
        if hasattr(e, "offset") and hasattr(e, "kind")
        else ("message", e.NAME, e.to_bytes().hex())
        for e in events
    ]


def _shown(name: str, event: Event) -> tuple[object, ...]:
    if event.decoded is None:
        return "fault", event.kind, event.offset
    which = event.decoded.message.name
    again = module(name).MESSAGES[which].from_bytes(event.decoded.payload)
    return "message", which, again.to_bytes().hex()


@functools.cache
def plan(name: str) -> Plan:
    return plan_of(protocol(name))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "direction"), STREAMS)
@settings(max_examples=80)
@given(data=st.data())
def test_split_streams_agree_with_the_reference(name: str, direction: Any, data: st.DataObject) -> None:
    """One test, because drawing a stream takes longer than decoding it."""
    wire = data.draw(streams(name, direction))
    expected = by_the_byte(name, direction, wire)
    whole = stream(name, direction)
    assert summary([*whole.feed(wire), *whole.finish()]) == expected
    cuts = data.draw(st.lists(st.integers(1, 20), max_size=40))
    decoder, at = stream(name, direction), 0
    found: list[Any] = []
    for size in [*cuts, len(wire)]:
        found += decoder.feed(wire[at : at + size])
        at += size
    found += decoder.finish()
    assert summary(found) == expected
    counters = whole.counters
    assert counters.frames == sum(kind == "message" for kind, _, _ in expected)
    assert sum(counters.faults.values()) == len(expected) - counters.frames
    assert (decoder.counters.frames, decoder.counters.skipped) == (counters.frames, counters.skipped)


def by_the_byte(name: str, direction: Any, wire: bytes) -> list[tuple[Any, ...]]:
    """The summary of a stream fed byte by byte; each event occurs at the same byte as in the reference."""
    decoder, machine = stream(name, direction), receiver(plan(name), direction)
    found: list[Any] = []
    for at, byte in enumerate(wire):
        events = decoder.feed(bytes((byte,)))
        expected = [_shown(name, event) for event in machine.feed(byte)]
        assert described(events) == expected, f"byte {at} of {wire.hex(' ')}"
        found += events
    ends, last = list(machine.finish()), decoder.finish()
    assert {event.at for event in ends} <= {len(wire)}
    assert described(last) == [_shown(name, event) for event in ends]
    return summary([*found, *last])


def test_skipped_bytes_are_reported_in_runs_of_the_longest_frame() -> None:
    """The maximum follows from the frame, not from the messages, as in C and in the plan."""
    machine = receiver(plan_of(protocol("modbus_rtu")), "request")
    decoder = module("modbus_rtu").StreamDecoder("request")
    noise = bytes((0xA5,)) * 600
    expected = [("fault", each.kind, each.offset) for byte in noise for each in machine.feed(byte)]
    assert described(decoder.feed(noise)) == expected == [("fault", "frame", 0), ("fault", "frame", 256)]


def test_a_frame_after_an_apparent_longer_one_is_delivered_at_its_last_byte() -> None:
    """The leading 00 10 begins a candidate with a wrong count; the frame inside it must not be delayed."""
    codec = module("modbus_rtu")
    frame = bytes.fromhex("010300000001840a")
    decoder = codec.StreamDecoder("request")
    events = [decoder.feed(bytes((byte,))) for byte in frame + frame + bytes.fromhex("0010") + frame]
    assert events[-1]
    assert events[-1][-1].NAME == "read_holding_registers.request"
