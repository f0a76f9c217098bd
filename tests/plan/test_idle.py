"""Silence on the line: stated in a schema, told to receivers of every kind."""

from __future__ import annotations

from fractions import Fraction

import pytest

from qlinkgen.backends import c, python
from qlinkgen.backends.base import Options
from qlinkgen.model.frame import Silence
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import plan_of
from qlinkgen.plan.describe import end_text, idle_text
from qlinkgen.plan.receive import receiver
from qlinkgen.schema import loads

_SCHEMA = """
qlinkgen: 1
protocol: {{name: sample, revision: "1", source: Made up}}
frame:
  parts:
    start: {start}
    length: {{type: u8, counts: [data, sum]}}
    code: {{role: message, type: u8}}
    data: {{role: payload, size: 0..20}}
    sum: {{type: u8, algorithm: sum8, over: [length, code, data]}}
{idle}
  {stuffing}
bus: {{kind: host, bits_per_byte: 11}}
defaults: {{repeat: safe}}
commands:
  go: {{id: 1, request: {{data: bytes}}, response: {{}}}}
"""
HUNT = {"start": "A5 A5", "stuffing": "stuffing: {after: A5, insert: 00, exempt: [start]}"}
RESCAN = {"start": "02", "stuffing": ""}
each_kind = pytest.mark.parametrize("kind", [HUNT, RESCAN], ids=["hunt", "rescan"])


def protocol(
    kind: dict[str, str], idle: str = "{role: idle, time: 3.5 bytes, at_least: 1750 us}"
) -> Protocol:
    found, faults = loads(_SCHEMA.format(**kind, idle=f"    gap: {idle}" if idle else ""), "sample.yaml")
    assert found is not None, faults
    return found


@each_kind
def test_an_unfinished_frame_ends_and_the_next_byte_begins_anew(kind: dict[str, str]) -> None:
    module = python.load(protocol(kind))
    plan = plan_of(protocol(kind))
    whole = module.MESSAGES["go.request"](data=b"abc").to_frame()
    decoder, reference = module.StreamDecoder("request"), receiver(plan, "request")
    assert decoder.feed(whole[:-1]) == [event for byte in whole[:-1] for event in reference.feed(byte)] == []
    faults = decoder.gap()
    assert [(fault.kind, fault.offset, fault.raw) for fault in faults] == [("truncated", 0, whole[:-1])]
    told = [(event.kind, event.offset, event.raw) for event in reference.gap()]
    assert told == [("truncated", 0, whole[:-1])]
    assert decoder.gap() == []
    assert [each.data for each in decoder.feed(whole)] == [b"abc"]
    assert [event.kind for byte in whole for event in reference.feed(byte)] == ["message"]


@each_kind
def test_without_being_told_frames_are_received_all_the_same(kind: dict[str, str]) -> None:
    module = python.load(protocol(kind))
    whole = module.MESSAGES["go.request"](data=b"abc").to_frame()
    assert [each.data for each in module.StreamDecoder("request").feed(whole * 2)] == [b"abc"] * 2


@each_kind
def test_the_duration(kind: dict[str, str]) -> None:
    stated = protocol(kind)
    plan = plan_of(stated)
    assert plan.frame.idle == Silence(Fraction(7, 2), Fraction(1750, 10**6))
    assert "; an idle line of 3.5 byte times, at least 1750 us, ends it early" in end_text(plan.frame)
    assert python.load(stated).IDLE == (3.5, 0.00175)
    header = c.generate(stated, Options())["c/sample.h"]
    assert "#define SAMPLE_IDLE_BITS 39U\n#define SAMPLE_IDLE_US 1750U\n" in header
    assert "sample_rx_idle(sample_receiver_t *receiver)" in header


@pytest.mark.parametrize(
    ("time", "found"),
    [
        ("20 ms", "an idle line of 20000 us"),
        ("4 bytes", "an idle line of 4 byte times"),
        ("1 ms, at_least: 2 ms", "an idle line of 2000 us"),
    ],
)
def test_texts(time: str, found: str) -> None:
    silence = plan_of(protocol(RESCAN, f"{{role: idle, time: {time}}}")).frame.idle
    assert silence is not None
    assert idle_text(silence) == found


@each_kind
def test_without_the_part_nothing_is_generated(kind: dict[str, str]) -> None:
    stated = protocol(kind, "")
    assert not hasattr(python.load(stated), "IDLE")
    assert not hasattr(python.load(stated).StreamDecoder, "gap")
    assert "idle(" not in c.generate(stated, Options())["c/sample.h"]
