"""Frames of dialogues that only their turn tells: their bytes go to their message, whatever they are."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import pytest

from qlinkgen.backends.python import load as load_codec
from qlinkgen.errors import BadReply, NoReply
from qlinkgen.link import Dialogue, MasterEngine, Monitor, SlaveEngine, Timing
from qlinkgen.link.events import Damaged
from qlinkgen.link.monitor import Asked, Replied
from qlinkgen.schema import find, load, loads
from qlinkgen.sim import VirtualPort, Wire
from qlinkgen.sim.generic import GenericNode
from qlinkgen.transport.blocking import BlockingMaster
from tests.link.line import drive

SLACK = 0.002
READ, ACK = bytes.fromhex("11 EE"), b"\x79"
PLACE, AMOUNT = bytes.fromhex("11 EE 79 1F 99"), bytes.fromhex("03 FC")
CONTENT = bytes.fromhex("79 1F 11 EE")


@pytest.fixture(scope="module")
def boot() -> ModuleType:
    return load_codec(load(find("stm32")))


@pytest.fixture
def master(boot: ModuleType) -> MasterEngine:
    return MasterEngine(boot, Timing.of(boot, host_slack=SLACK))


def reading(boot: ModuleType) -> Dialogue:
    place = boot.ReadMemoryPlace(start=0x11EE791F)
    return Dialogue(boot.ReadMemoryRequest(), [place, boot.ReadMemoryAmount(count=4)])


class Memory:
    """A node that gives what looks like frames."""

    number = 0

    def __init__(self, boot: ModuleType) -> None:
        self._boot = boot
        self.places: list[int] = []

    def handle(self, request: Any, now: float) -> Any:
        if isinstance(request, self._boot.ReadMemoryRequest):
            return self._read()
        return [self._boot.Ack(), self._boot.GetIdProduct(product=0x1F79), self._boot.Ack()]

    def _read(self) -> Any:
        place = yield self._boot.Ack()
        self.places.append(place.start)
        amount = yield self._boot.Ack()
        data = (CONTENT * 64)[: amount.count]
        return [self._boot.Ack(), self._boot.ReadMemoryContent(data=data)]


def test_master_and_slave_talk(boot: ModuleType) -> None:
    wire, node = Wire(baud=115200), Memory(boot)
    wire.attach(SlaveEngine(boot, node), "device")
    port = VirtualPort(wire)
    master = BlockingMaster(MasterEngine(boot, Timing.of(boot, host_slack=SLACK)), port)
    ack = boot.Ack()
    content = boot.ReadMemoryContent(data=CONTENT)
    assert master.transact(reading(boot)).response == (ack, ack, ack, content)
    assert node.places == [0x11EE791F]
    asked = Dialogue(boot.GetIdRequest(), [])
    assert master.transact(asked).response == (ack, boot.GetIdProduct(product=0x1F79), ack)


def test_a_simulated_node_answers(boot: ModuleType) -> None:
    wire = Wire(baud=115200)
    wire.attach(SlaveEngine(boot, GenericNode(boot)), "device")
    master = BlockingMaster(MasterEngine(boot, Timing.of(boot, host_slack=SLACK)), VirtualPort(wire))
    assert master.transact(reading(boot)).response[-1] == boot.ReadMemoryContent(data=bytes(4))


@pytest.mark.parametrize("split", range(1, 6))
def test_an_acknowledgement_and_what_follows_may_arrive_at_once(
    boot: ModuleType, master: MasterEngine, split: int
) -> None:
    last = ACK + CONTENT
    run = drive(master, reading(boot), [(0.01, ACK), (0.02, ACK), (0.03, last[:split]), (0.04, last[split:])])
    assert run.response[-1] == boot.ReadMemoryContent(data=CONTENT)


def test_a_wrong_frame_is_a_fault_and_the_wait_goes_on(boot: ModuleType, master: MasterEngine) -> None:
    wrong = bytes.fromhex("02 04 10")  # its number of bytes is constant
    asked = Dialogue(boot.GetIdRequest(), [])
    run = drive(master, asked, [(0.01, ACK + wrong + ACK)], attempts=1)
    assert isinstance(run.error, BadReply)
    assert "range" in str(run.error)


def test_a_dialogue_is_repeated_from_its_request(boot: ModuleType, master: MasterEngine) -> None:
    again = [(1.5, ACK), (1.51, ACK), (1.52, ACK + CONTENT)]
    run = drive(master, reading(boot), [(0.01, ACK), (0.02, ACK), (0.03, ACK + CONTENT[:3]), *again])
    assert run.response[-1] == boot.ReadMemoryContent(data=CONTENT)


def test_only_the_time_limit_ends_the_wait(boot: ModuleType, master: MasterEngine) -> None:
    run = drive(master, reading(boot), [(0.01, ACK), (0.02, ACK), (0.03, ACK + b"\x1f")], attempts=1)
    assert isinstance(run.error, NoReply)


def talk(slave: SlaveEngine, data: bytes, now: float) -> bytes:
    """What a slave sends after these bytes."""
    slave.receive(data, now)
    sent = b""
    while (at := slave.next_timer()) is not None:
        sent += slave.bytes_to_send(max(at, now))
    return sent


def test_a_slave_collects_byte_by_byte(boot: ModuleType) -> None:
    slave = SlaveEngine(boot, Memory(boot))
    sent = b"".join(talk(slave, bytes((byte,)), 0.0) for byte in READ + PLACE + AMOUNT)
    assert sent == ACK * 3 + CONTENT


def test_a_damaged_frame_ends_the_dialogue_of_a_slave(boot: ModuleType) -> None:
    slave = SlaveEngine(boot, Memory(boot))
    assert talk(slave, READ, 0.0) == ACK
    assert talk(slave, PLACE[:-1] + b"\0", 0.1) == b""
    assert slave.counters.damaged == {"crc": 1}
    assert talk(slave, READ + PLACE, 0.2) == ACK  # the first one was replaced
    assert talk(slave, AMOUNT, 0.3) == ACK + CONTENT


def test_a_slave_waits_for_the_time_of_the_step(boot: ModuleType) -> None:
    slave = SlaveEngine(boot, Memory(boot))
    assert talk(slave, READ, 0.0) == ACK
    assert talk(slave, PLACE[:4], 0.1) == b""
    assert talk(slave, READ, 5.0) == ACK  # not the last byte of the place
    assert talk(slave, PLACE, 5.1) == ACK


def test_a_monitor_pairs_them(boot: ModuleType) -> None:
    monitor = Monitor(boot, Timing.of(boot, host_slack=SLACK))
    for number, data in enumerate((READ, ACK, PLACE, ACK, AMOUNT, ACK + CONTENT, READ, ACK)):
        monitor.receive(data, 0.01 * number)
    asked = [each.request for each in monitor.heard if isinstance(each, Asked)]
    answers = [each.response for each in monitor.heard if isinstance(each, Replied)]
    ack, request = boot.Ack(), boot.ReadMemoryRequest()
    assert asked == [
        request, boot.ReadMemoryPlace(start=0x11EE791F), boot.ReadMemoryAmount(count=4), request,
    ]  # fmt: skip
    assert answers == [ack, ack, ack, boot.ReadMemoryContent(data=CONTENT), ack]
    assert len(monitor.heard) == len(asked) + len(answers)


def test_a_monitor_tells_of_damaged_ones_and_goes_on(boot: ModuleType) -> None:
    monitor = Monitor(boot, Timing.of(boot, host_slack=SLACK))
    for number, data in enumerate((READ, ACK, PLACE[:-1] + b"\0", READ, ACK)):
        monitor.receive(data, 0.01 * number)
    monitor.receive(READ + ACK, 9.0)  # the place did not come
    kinds = [type(each) for each in monitor.heard]
    assert kinds == [Asked, Replied, Damaged, Asked, Replied, Asked, Replied]


def test_an_acknowledgement_without_an_address_is_that_of_the_node() -> None:
    text = """\
qlinkgen: 1
protocol: {name: loader, title: Loader, revision: "1", source: Manual}
byteorder: big
frames:
  ask:
    parts:
      start: 7E
      node: {role: address, type: u8}
      code: {role: message, type: u8}
      crc: {type: u8, algorithm: sum8, over: [node, code]}
  plain: {parts: {data: {role: payload, size: 1..8}}}
  ack: {parts: {byte: 79}}
bus: {kind: master_slave, nodes: 1..9, baud: 9600, response_within: 10 ms}
defaults: {frame: ask, addressing: node, repeat: safe}
messages: {ack: {frame: ack, direction: response, fields: {}}}
commands:
  get:
    id: 1
    request: {}
    steps: [{receive: ack}, {name: value, receive: {frame: plain, fields: {value: u16}}}, {receive: ack}]
"""
    protocol, faults = loads(text, "loader.yaml")
    assert protocol is not None, faults
    codec = load_codec(protocol)
    engine = MasterEngine(codec, Timing.of(codec, host_slack=SLACK))
    run = drive(engine, Dialogue(codec.GetRequest(node=3), []), [(0.012, bytes.fromhex("79 79 79 79"))])
    assert run.response == (codec.Ack(), codec.GetValue(value=0x7979), codec.Ack())
