"""Nodes that do not answer a repeated motion, as section 7.10 may be read."""

from __future__ import annotations

from typing import Literal

import pytest

from qlinkgen.codecs import qlink
from qlinkgen.errors import NoReply
from qlinkgen.protocols.qlink import Bus
from qlinkgen.protocols.qlink.bus_state import BusState
from qlinkgen.protocols.qlink.motion import Repeats
from qlinkgen.sim import FaultPlan, Wire
from qlinkgen.sim.pty_bus import PtyBus
from tests.qlink.behaviour_rig import Probe, Setting, Slave, make_rig
from tests.qlink.conftest import MakeRig

SILENT = Slave(silent_repeats=True)


def test_a_lost_answer_blocks_a_master_that_waits_for_the_answer_to_a_repeat(make_simulated: MakeRig) -> None:
    rig = make_simulated(SILENT)
    rig.bus.motion(1, segments=[1])
    rig.node.mute = 1
    for _ in range(3):
        with pytest.raises(NoReply):
            rig.bus.motion(1, segments=[2])
    assert rig.node.words == [1, 2]


@pytest.mark.parametrize("repeats", ["silent", "auto"])
@pytest.mark.parametrize("lost", [1, 2, 3])
def test_a_motion_counts_as_taken_when_the_node_answers_something_else(
    make_simulated: MakeRig, repeats: Repeats, lost: int
) -> None:
    rig = make_simulated(SILENT, repeats=repeats)
    rig.bus.motion(1, segments=[1])
    rig.node.mute = lost
    answer = rig.bus.motion(1, segments=[2, 3], outputs=5)
    assert answer.fifo_space == 45
    assert rig.node.outputs == 5
    rig.bus.motion(1, segments=[4])
    assert rig.node.words == [1, 2, 3, 4]


def test_a_node_that_is_really_away_keeps_its_motion_pending(make_simulated: MakeRig) -> None:
    rig = make_simulated(SILENT, repeats="silent")
    rig.bus.motion(1, segments=[1])
    rig.node.deaf = 100
    with pytest.raises(NoReply):
        rig.bus.motion(1, segments=[2])
    rig.node.deaf = 0
    rig.bus.motion(1, segments=[3])
    assert rig.node.words == [1, 2, 3]


@pytest.mark.parametrize("before", ["nothing", "clear_fifo", "node_reset"])
@pytest.mark.parametrize("silent", [False, True])
def test_the_first_motion_finds_out_whether_repeats_are_answered(
    make_simulated: MakeRig, silent: bool, before: str
) -> None:
    rig = make_simulated(Slave(silent_repeats=silent), repeats="auto")
    if before != "nothing":
        getattr(rig.bus, before)(1)
    rig.bus.motion(1, segments=[1])
    assert rig.bus.state.motions[1].repeats == ("silent" if silent else "answered")
    rig.node.heard.clear()
    rig.bus.motion(1, segments=[2])
    assert [type(each) for each in rig.node.heard] == [qlink.MotionRequest]
    assert rig.node.words == [1, 2]


@pytest.mark.parametrize("client", ["blocking", "asyncio"])
@pytest.mark.parametrize("lost", ["answers", "both"])
def test_no_word_of_a_stream_is_lost_or_doubled(client: Literal["blocking", "asyncio"], lost: str) -> None:
    """Requests are lost so seldom that all six of a motion are not."""
    node = Probe(1, silent_repeats=True, started=True)
    with make_rig(Setting("repeats", client), node, repeats="silent", attempts=6) as rig:
        rig.wire.faults = FaultPlan(drop=0.3, to="master") if lost == "answers" else FaultPlan(drop=0.1)
        words = list(range(1000))
        for _ in rig.bus.stream_motion({1: words}):
            pass
        assert node.words == words
        assert node.statistics.duplicates > 10


def test_another_word_is_refused() -> None:
    with pytest.raises(ValueError, match="known are answered, auto, silent"):
        BusState("maybe")  # type: ignore[arg-type]


@pytest.mark.pty
def test_a_port_is_closed_again_if_an_option_is_wrong() -> None:
    with PtyBus(Wire(baud=None)) as line:
        for _ in range(2):  # an open port would be in use
            with pytest.raises(ValueError, match="repeats"):
                Bus.open(line.path, repeats="maybe")  # type: ignore[arg-type]
        Bus.open(line.path).close()
