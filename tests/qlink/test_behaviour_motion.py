"""Motion: counters, repeats, flow control. Sections 7.10 to 7.13 and settled questions 7, 9 and 10."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import count, pairwise
from typing import Any

import pytest

from qlinkgen.codecs import qlink
from qlinkgen.codecs.qlink import MotorStatus, PositionType
from qlinkgen.errors import CommandError, LinkError, NoReply
from tests.qlink.behaviour_rig import CLEAN, Probe, Rig, Setting, Slave, make_rig
from tests.qlink.conftest import MakeRig


def counters(node: Probe) -> list[int]:
    """Counters of the received motions, without repeats."""
    heard = [each.counter for each in node.heard if isinstance(each, qlink.MotionRequest)]
    return heard[:1] + [after for before, after in pairwise(heard) if after != before]


def test_the_counter_starts_at_0_advances_by_one_and_wraps(make: MakeRig) -> None:
    rig = make(Slave(capacity=255, rate=1e6, started=True))
    for word in range(300):
        rig.move(1, [word])
    assert rig.node.words == list(range(300))
    seen = counters(rig.node)
    assert seen[0] == 0
    assert all(after == (before + 1) % 256 for before, after in pairwise(seen))
    assert len(seen) >= 300


def test_a_motion_whose_answer_is_lost_is_repeated_under_its_counter(make: MakeRig) -> None:
    rig = make(Slave())
    rig.move(1, [1])
    rig.node.mute = 2
    answer = rig.move(1, [2, 3], outputs=5)
    assert rig.node.words == [1, 2, 3]
    assert rig.node.outputs == 5
    assert answer.fifo_space == 45
    repeated = [
        each.counter
        for each in rig.node.heard
        if isinstance(each, qlink.MotionRequest) and 2 in each.segments
    ]
    assert len(repeated) >= 3
    assert len(set(repeated)) == 1
    assert rig.node.statistics.duplicates >= 2


def test_a_motion_that_fails_stays_pending_and_is_taken_once(make_clean: MakeRig) -> None:
    rig = make_clean(Slave())
    rig.bus.motion(1, segments=[1])
    for heard in (True, False):  # the answers are lost, or the requests
        rig.node.mute, rig.node.deaf = (100, 0) if heard else (0, 100)
        with pytest.raises(NoReply):
            rig.bus.motion(1, segments=[2])
        rig.node.mute = rig.node.deaf = 0
        pending = rig.bus.state.motions[1].pending
        assert pending is not None
        assert pending.segments == [2]
        rig.bus.motion(1, segments=[3])
    assert rig.node.words == [1, 2, 3, 2, 3]


def test_a_repeat_is_answered_with_what_is_now_and_not_taken(make: MakeRig) -> None:
    rig = make(Slave(position_type=PositionType.METRONIX, capacity=10))
    rig.sure(lambda: rig.bus.motion(1, counter=5, outputs=1, segments=[7, 8]))
    rig.sure(lambda: rig.bus.write(1, data=b"\0"))
    rig.sure(lambda: rig.bus.preset_motor_position(1, position=-5))
    rig.node.inputs = 0x92
    answer = rig.sure(lambda: rig.bus.motion(1, counter=5, outputs=1, segments=[7, 8]))
    assert (answer.inputs, answer.position, answer.fifo_space) == (0x92, -5, 8)
    assert answer.motor_status == MotorStatus.POSITION_VALID
    assert rig.node.words == [7, 8]
    assert rig.node.outputs == 0, "a repeat writes no outputs"


@pytest.mark.parametrize("command", ["clear_fifo", "node_reset"])
def test_the_first_motion_after_a_clear_or_a_reset_is_taken_whatever_its_counter(
    make: MakeRig, command: str
) -> None:
    rig = make(Slave())
    rig.sure(lambda: rig.bus.motion(1, counter=9, segments=[1]))
    rig.sure(lambda: getattr(rig.bus, command)(1))
    assert rig.node.waiting == 0
    rig.sure(lambda: rig.bus.motion(1, counter=9, segments=[2]))
    assert rig.node.words == [1, 2]


@pytest.mark.parametrize("command", ["clear_fifo", "node_reset"])
def test_a_clear_drops_what_is_pending(make_clean: MakeRig, command: str) -> None:
    rig = make_clean(Slave())
    rig.move(1, [1])
    rig.node.mute = 100
    with pytest.raises(NoReply):
        rig.bus.motion(1, segments=[2])
    rig.node.mute = 0
    getattr(rig.bus, command)(1)
    rig.move(1, [3])
    assert rig.node.words == [1, 2, 3]
    assert rig.node.waiting == 1


@pytest.mark.parametrize("command", ["clear_fifo", "node_reset"])
def test_a_clear_that_is_not_answered_does_not_bring_back_what_was_pending(
    make_clean: MakeRig, command: str
) -> None:
    rig = make_clean(Slave(started=True, rate=1e6))
    rig.move(1, [1])
    rig.node.mute = 100
    with pytest.raises(NoReply):
        rig.bus.motion(1, segments=[2])
    with pytest.raises(NoReply):
        getattr(rig.bus, command)(1)
    rig.node.mute = 0
    rig.move(1, [3])
    assert rig.node.words == [1, 2, 3], "2 was moved before the clear, and must not be moved again"


def test_a_new_master_is_not_mistaken_for_a_repeat(make_clean: MakeRig) -> None:
    rig = make_clean(Slave())
    for outputs in (1, 2, 3):
        rig.bus.state.motions.clear()  # as after a restart of the program
        rig.bus.motion(1, outputs=outputs)
        assert rig.node.outputs == outputs
    rig.bus.state.motions.clear()
    rig.bus.motion(1, segments=[4])
    assert rig.node.words == [4]


def test_a_node_that_takes_over_a_number_is_not_mistaken_for_the_other(make_clean: MakeRig) -> None:
    rig = make_clean(Slave(1), Slave(2))
    rig.move(1, [1])
    rig.move(2, [1])
    rig.bus.node_setup(2, node_number=3)
    rig.bus.node(1).node_setup(node_number=2)
    rig.move(2, [2])
    assert rig.nodes[0].words == [1, 2]
    assert rig.nodes[1].words == [1]


def stream(rig: Rig, words: dict[int, list[int]]) -> dict[int, int]:
    """Stream, and compare each answer with the FIFO of its node."""
    nodes = {node.number: node for node in rig.nodes}
    queued = dict.fromkeys(words, 0)
    for progress in rig.bus.stream_motion(words, patience=60.0):
        assert progress.queued >= queued[progress.node]
        assert 0 <= progress.fifo_space <= nodes[progress.node].capacity
        queued[progress.node] = progress.queued
    return queued


def test_a_stream_fills_many_fifos_and_never_too_full(make: MakeRig) -> None:
    rig = make(
        Slave(1, capacity=48, rate=2000.0, started=True),
        Slave(2, capacity=5, rate=300.0, started=True),
        Slave(3, capacity=255, rate=50000.0, started=True),
    )
    words = {node.number: [(node.number << 12) + index for index in range(150)] for node in rig.nodes}
    assert stream(rig, words) == {1: 150, 2: 150, 3: 150}
    for node in rig.nodes:
        assert node.words == words[node.number]
        assert node.statistics.overruns == 0


def test_a_stream_takes_no_word_before_it_fits(make: MakeRig) -> None:
    rig = make(Slave(capacity=20))  # it is stopped, so nothing drains
    taken = count()
    source: Iterator[int] = iter(lambda: next(taken) + 1, 0)
    steps = rig.bus.stream_motion({1: source}, patience=60.0)
    for progress in steps:
        if progress.queued == 20 and progress.fifo_space == 0:
            break
    for _ in range(5):
        assert next(steps).queued == 20
    steps.close()
    assert next(taken) == 20
    assert rig.node.words == list(range(1, 21))
    assert rig.node.statistics.overruns == 0
    rig.move(1, [])


def test_a_node_used_by_a_stream_is_not_moved(make_clean: MakeRig) -> None:
    rig = make_clean(Slave())
    steps = rig.bus.stream_motion({1: range(100)})
    next(steps)
    with pytest.raises(RuntimeError, match="used by a stream"):
        rig.bus.motion(1, segments=[1])
    steps.close()
    rig.bus.motion(1)


def test_a_preset_is_refused_while_the_motor_runs(make: MakeRig) -> None:
    rig = make(Slave(started=True, rate=0.0, position_type=PositionType.JVL_MACTALK))
    rig.sure(lambda: rig.bus.preset_motor_position(1, position=-(2**31)))
    assert rig.sure(lambda: rig.bus.motor_position(1)).position == -(2**31)
    answer = rig.move(1, [1])
    assert answer.motor_status & MotorStatus.RUNNING
    with pytest.raises(
        CommandError, match=r"while the motor runs .* nothing was sent. Stop the node, or refresh"
    ) as told:
        rig.bus.preset_motor_position(1, position=5)
    assert (told.value.node, told.value.attempts) == (1, 0)
    assert told.value.status & MotorStatus.RUNNING
    assert rig.node.statistics.refused_presets == 0
    rig.bus.state.statuses.clear()  # as in a master that was just started
    with pytest.raises(LinkError if rig.faulty else NoReply):
        rig.bus.preset_motor_position(1, position=5)
    assert rig.node.position == -(2**31)
    assert rig.node.statistics.refused_presets == 1 or rig.faulty  # not repeated


on_a_virtual_clock = pytest.mark.parametrize(
    "setting", [each for each in CLEAN if each.transport == "virtual"], ids=lambda setting: setting.name
)
STOPS: dict[str, Callable[[Any], object]] = {
    "node_stop": lambda bus: bus.node_stop(1),
    "node_stop for all": lambda bus: bus.node_stop(0),
    "clear_fifo": lambda bus: bus.clear_fifo(1),
    "node_reset": lambda bus: bus.node_reset(1),
    "node_setup": lambda bus: bus.node_setup(1, node_number=1),
}


@pytest.mark.parametrize("stop", STOPS)
@on_a_virtual_clock
def test_a_preset_is_sent_once_a_request_has_outdated_the_status(setting: Setting, stop: str) -> None:
    node = Probe(started=True, rate=0.0, position_type=PositionType.JVL_MACTALK)
    with make_rig(setting, node) as rig:
        rig.move(1, [1])
        with pytest.raises(CommandError):
            rig.bus.preset_motor_position(1, position=5)
        STOPS[stop](rig.bus)
        if stop == "node_setup":  # outdated, and running all the same
            with pytest.raises(NoReply):
                rig.bus.preset_motor_position(1, position=5)
        else:
            rig.bus.preset_motor_position(1, position=5)
            assert rig.node.position == 5


@on_a_virtual_clock
def test_a_later_status_counts(setting: Setting) -> None:
    node = Probe(started=True, rate=100.0, position_type=PositionType.JVL_MACTALK)
    with make_rig(setting, node) as rig:
        assert rig.move(1, [1, 2]).motor_status & MotorStatus.RUNNING
        rig.sleep(1.0)
        with pytest.raises(CommandError):
            rig.bus.preset_motor_position(1, position=5)
        assert not rig.move(1, []).motor_status & MotorStatus.RUNNING
        rig.bus.preset_motor_position(1, position=5)
        assert rig.node.position == 5


@pytest.mark.parametrize("kind", list(range(4)))
def test_a_position_counts_only_with_a_position_type(make: MakeRig, kind: int) -> None:
    rig = make(Slave(position_type=kind))
    rig.node.position = 1234
    known = kind in {1, 2}
    assert rig.sure(lambda: rig.bus.motor_position(1)).position == (1234 if known else 0)
    answer = rig.sure(lambda: rig.bus.motion(1, counter=0))
    assert bool(answer.motor_status & MotorStatus.POSITION_VALID) is known
    assert answer.position == (1234 if known else 0)
