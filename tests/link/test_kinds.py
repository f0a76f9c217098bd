"""Answers in frames of another kind than their requests, some of them without an address."""

from __future__ import annotations

from types import ModuleType

import pytest

from qlinkgen.backends.python import load as load_codec
from qlinkgen.link import MasterEngine, Monitor, SlaveEngine, Timing
from qlinkgen.link.monitor import Asked, Replied
from qlinkgen.schema import find, load
from qlinkgen.sim import VirtualPort, Wire
from qlinkgen.sim.generic import GenericNode
from qlinkgen.transport.blocking import BlockingMaster
from tests.link.line import drive

SLACK = 0.002


@pytest.fixture(scope="module")
def mbus() -> ModuleType:
    return load_codec(load(find("mbus")))


def bus(mbus: ModuleType) -> BlockingMaster:
    wire = Wire(baud=2400)
    wire.attach(SlaveEngine(mbus, GenericNode(mbus, 3), turnaround=3 * wire.byte_time), "node 3")
    return BlockingMaster(MasterEngine(mbus, Timing.of(mbus, host_slack=SLACK)), VirtualPort(wire))


def test_a_master_takes_answers_of_each_kind(mbus: ModuleType) -> None:
    master = bus(mbus)
    assert master.transact(mbus.InitialiseRequest(node=3)).response == mbus.Ack()
    assert master.transact(mbus.ReadRequest(node=3)).response.node == 3


def test_an_answer_without_an_address_is_that_of_the_node_asked(mbus: ModuleType) -> None:
    engine = MasterEngine(mbus, Timing.of(mbus, host_slack=SLACK))
    run = drive(engine, mbus.InitialiseRequest(node=7), [(0.05, b"\xe5")])
    assert run.response == mbus.Ack()
    wrong = drive(engine, mbus.ReadRequest(node=7), [(1.05, b"\xe5")], 1.0, attempts=1)
    assert wrong.error is not None


def test_a_monitor_pairs_them(mbus: ModuleType) -> None:
    monitor = Monitor(mbus, Timing.of(mbus, host_slack=SLACK))
    monitor.receive(mbus.InitialiseRequest(node=7).to_frame(), 0.0)
    monitor.receive(b"\xe5", 0.05)
    asked, replied = monitor.heard
    assert isinstance(asked, Asked)
    assert isinstance(replied, Replied)
    assert replied.response == mbus.Ack()
