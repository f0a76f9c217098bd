"""The error of an unanswered motion states what happens to its words."""

from __future__ import annotations

import pytest

from qlinkgen.codecs import qlink
from qlinkgen.errors import NoReply
from qlinkgen.link import SlaveEngine
from qlinkgen.protocols.qlink import Bus, VirtualNode
from qlinkgen.sim import FaultPlan, VirtualPort, Wire


def test_the_error_says_what_is_pending() -> None:
    wire = Wire(baud=115200, faults=FaultPlan(drop=1.0, to="master"))
    node = VirtualNode(3)
    wire.attach(SlaveEngine(qlink, node))
    bus = Bus(VirtualPort(wire), slack=0.002, echo="none", health=None)
    with pytest.raises(NoReply) as first:
        bus.node(3).motion(segments=[1, 2])
    assert "motion 0 with 0 words is pending" in first.value.__notes__[0], "the one that finds the number"
    wire.faults = None
    assert bus.node(3).motion(segments=[1, 2]).counter == 1
    wire.faults = FaultPlan(drop=1.0, to="master")
    with pytest.raises(NoReply) as second:
        bus.node(3).motion(segments=[3, 4])
    (note,) = second.value.__notes__
    assert note.startswith("motion 2 with 2 words is pending: it is sent again before the next motion")
    assert node.statistics.words == 4


def test_what_was_never_sent_is_not_pending() -> None:
    wire = Wire(baud=115200)
    bus = Bus(VirtualPort(wire), slack=0.002, echo="none")
    for _ in range(2):
        with pytest.raises(NoReply):
            bus.node(3).motor_position()
    with pytest.raises(NoReply, match="not sent") as refused:
        bus.node(3).motion(segments=[1])
    assert not hasattr(refused.value, "__notes__")
    assert bus.state.motions[3].pending is None
