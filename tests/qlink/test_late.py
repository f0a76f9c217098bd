"""Answers of any delay: a position may be outdated, but no word or piece is lost."""

from __future__ import annotations

import contextlib

import pytest

from qlinkgen.codecs import qlink
from qlinkgen.errors import LinkError
from qlinkgen.link import SlaveEngine
from qlinkgen.protocols.qlink import Bus
from qlinkgen.sim import FaultPlan, VirtualPort, Wire
from tests.qlink.behaviour_rig import Probe
from tests.qlink.test_behaviour_node import hex_text

SLACK = 0.002
#: Seconds: from a punctual answer to one that arrives during the third request after its own.
LATE = (0.0, 0.08)


def late_bus(seed: int, node: Probe) -> Bus:
    wire = Wire(baud=115200, faults=FaultPlan(late=(0.3, *LATE), drop=0.1, seed=seed))
    wire.attach(SlaveEngine(qlink, node))
    return Bus(VirtualPort(wire), echo="none", health=None, slack=SLACK)


@pytest.mark.parametrize("seed", range(20))
def test_no_word_is_lost_or_queued_twice(seed: int) -> None:
    node = Probe(started=True, rate=5000.0)
    bus = late_bus(seed, node)
    for _ in bus.stream_motion({1: range(1000)}, patience=60.0):
        pass
    assert node.words == list(range(1000))
    assert bus.engine.total.late > 20


@pytest.mark.parametrize("seed", range(20))
def test_no_word_is_lost_behind_a_clear(seed: int) -> None:
    node = Probe(capacity=255)
    bus = late_bus(seed, node)
    kept: list[int] = []
    for word in range(60):
        with contextlib.suppress(LinkError):
            bus.motion(1, segments=[word])
            kept.append(word)
        if word % 3 == 2:
            with contextlib.suppress(LinkError):
                bus.clear_fifo(1)
    queued = node.words
    assert sorted(set(queued)) == queued, "in order, and none twice"
    assert set(kept) <= set(queued), "what was acknowledged was taken"


@pytest.mark.parametrize("seed", range(20))
def test_a_program_is_whole_or_the_load_fails(seed: int) -> None:
    node = Probe()
    bus = late_bus(seed, node)
    text = hex_text(12)
    for _ in range(40):
        try:
            bus.load(1, text, piece=10, patience=0.5)
        except LinkError:
            assert text.startswith(bytes(node.store.text))
            continue
        break
    image = node.program
    assert image is not None
    assert image.text == text
    assert bus.engine.total.late > 3


def test_only_motion_and_load_carry_a_number_back() -> None:
    """A case that cannot be detected: answers to different requests are the same bytes."""
    assert qlink.COMMANDS["motor_position"].echoes == {}
    assert "counter" not in qlink.MotorPositionResponse.FIELDS
    for name in ("motion", "node_program_load"):
        assert qlink.COMMANDS[name].echoes == {"counter": "counter"}
