"""What every node of a ring does: blocking and with asyncio, on a virtual clock and in memory."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable, Coroutine, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import pytest

from qlinkgen.errors import NoRoom, NothingCame, PortLost
from qlinkgen.link.events import Frame
from qlinkgen.link.ring_events import Dropped, NetStat, Queued, Taken
from qlinkgen.pytest_plugin import BusPairs
from qlinkgen.sim import FaultPlan, VirtualPort
from qlinkgen.sim.joining_rings import join_ring_at
from qlinkgen.sim.ring import RingWire
from qlinkgen.sim.smallest import required_values
from tests.bus.rig import Script, Setting, flipped, lost, whole
from tests.bus.settings import MEMORY, VIRTUAL
from tests.bus.wires import PACKAGE, bus_of, of_text
from tests.support.memory_line import MemoryLine

CELL = """\
qlinkgen: 1
protocol: {name: cell, title: A cell of robots, revision: "1", source: Manual}
byteorder: big
groups: {bits: 7, first: least}
frame:
  marked:
    marker: 0x80
    header: {address: 3..6, message: 0..2}
    end: 0
    payload: 0..16
    checksum: {type: u16, algorithm: crc-16/ibm-3740, over: [payload], sent: [0..6, 8..14]}
bus: {kind: ring, nodes: 1..7, baud: 38400}
messages:
  move: {id: 1, doc: Move to a place, fields: {place: u14, speed: {type: u7, default: 5}}}
  receive: {id: 2, fields: {parts: u7}}
"""
#: Schemas of rings, and the module of each.
RINGS: dict[str, Callable[[], Any]] = {"trio": lambda: bus_of("trio"), "cell": lambda: of_text(CELL)}
everywhere = pytest.mark.parametrize(
    ("name", "setting"),
    [pytest.param(name, each, id=f"{name}-{each}") for name in RINGS for each in (*VIRTUAL, *MEMORY)],
)
timed = pytest.mark.parametrize(
    ("name", "setting"), [pytest.param(name, each, id=f"{name}-{each}") for name in RINGS for each in VIRTUAL]
)
#: Seconds of waits that must not fail; no time passes in vain.
PATIENCE = 20.0


class Kept:
    """A node that keeps what it takes."""

    def __init__(self) -> None:
        self.taken: list[Any] = []

    def handle(self, message: Any, now: float) -> None:
        """Keep a message."""
        self.taken.append(message)


@dataclass
class Rig:
    """A node of a ring, and two others.

    Attributes:
        codec: the generated module.
        ring: the node.
        nodes: the others.
        engines: their engines.
        script: what happens to messages.
    """

    codec: Any
    ring: Any
    nodes: list[Kept]
    engines: tuple[Any, ...]
    script: Script
    _runner: asyncio.Runner | None

    def wait(self, result: Any) -> Any:
        """Wait for what a call returns."""
        return result if self._runner is None else self._runner.run(result)

    def run(self, task: Callable[[], Coroutine[Any, Any, Any]]) -> Any:
        """Run a coroutine in the event loop of the rig."""
        assert self._runner is not None
        return self._runner.run(task())

    def until(self, condition: Callable[[], object]) -> None:
        """Wait for a condition."""
        self.wait(self.ring.wait_until(condition, PATIENCE))


@contextlib.contextmanager
def make_rig(name: str, setting: Setting, own: Any = None, **options: Any) -> Iterator[Rig]:
    """Make a ring of three nodes."""
    module, script = RINGS[name](), Script()
    prefix = "Async" if setting.client == "asyncio" else ""
    kind = getattr(module, f"{prefix}Ring")
    wire = RingWire(kind.codec, baud=38400 if setting.paced else None, faults=script)
    nodes = [Kept(), Kept()]
    with contextlib.ExitStack() as stack:
        port: Any = (
            stack.enter_context(contextlib.closing(VirtualPort(wire)))
            if setting.paced
            else stack.enter_context(MemoryLine(wire))
        )
        runner = stack.enter_context(asyncio.Runner()) if prefix else None

        def join() -> Any:
            return stack.enter_context(join_ring_at(port, wire, kind, *nodes, own=own, **options))

        async def joined() -> Any:
            return join()

        made = runner.run(joined()) if runner else join()
        rig = Rig(kind.codec, made.master, nodes, made.others, script, runner)
        try:
            yield rig
        finally:
            if runner:
                runner.run(made.master.close())


def messages_of(codec: Any) -> list[tuple[str, dict[str, Any]]]:
    """The method of each message, and its required values."""
    return [
        (f"{name}_" if name == "receive" else name, required_values(kind))
        for name, kind in codec.MESSAGES.items()
    ]


def message_of(codec: Any, **values: Any) -> Any:
    """A message with a check value, to the next node."""
    kind = next(kind for kind in codec.MESSAGES.values() if kind.CHECKED)
    return kind(address=1, **{**required_values(kind), **values})


@everywhere
def test_a_message_arrives_with_its_values_at_its_node_alone(name: str, setting: Setting) -> None:
    events: list[Any] = []
    with make_rig(name, setting, on_event=events.append) as rig:
        for address, node in enumerate(rig.nodes, 1):
            for method, values in messages_of(rig.codec):
                rig.wait(getattr(rig.ring, method)(address, **values))
            rig.until(lambda node=node: len(node.taken) == len(rig.codec.MESSAGES))  # type: ignore[misc]
            told = [each.NAME for each in node.taken]
            assert told == list(rig.codec.MESSAGES)
            for message, (_, values) in zip(node.taken, messages_of(rig.codec), strict=True):
                assert {field: getattr(message, field) for field in values} == values
        assert rig.ring.counters.sent == 2 * len(rig.codec.MESSAGES)
        assert rig.engines[0].counters.passed == len(rig.codec.MESSAGES)
        assert not rig.ring.netstat
        rig.until(lambda: sum(type(each) is Queued for each in events) == rig.ring.counters.sent)


@everywhere
def test_messages_to_the_node_are_received_in_order(name: str, setting: Setting) -> None:
    with make_rig(name, setting) as rig:
        with pytest.raises(NothingCame, match=r"no message in 0\.05 s"):
            rig.wait(rig.ring.receive(0.05))
        sent = [kind(address=3, **required_values(kind)) for kind in rig.codec.MESSAGES.values()]
        for message in sent:  # around the whole ring, to itself
            rig.wait(rig.ring.transmit(message))
        found = [rig.wait(rig.ring.receive(PATIENCE)) for _ in sent]
        assert [each.NAME for each in found] == [each.NAME for each in sent]
        assert [each.FIELDS for each in found] == [each.FIELDS for each in sent]
        assert {each.address for each in found} == {1}
        assert rig.ring.counters.taken == len(sent)


@everywhere
def test_handlers_take_messages_in_place_of_receive(name: str, setting: Setting) -> None:
    own = Kept()
    with make_rig(name, setting, own) as rig:
        method, values = messages_of(rig.codec)[0]
        rig.wait(getattr(rig.ring, method)(3, **values))
        rig.until(lambda: own.taken)
        assert next(iter(rig.codec.MESSAGES)) == own.taken[0].NAME


@everywhere
def test_a_lost_message_is_not_told_and_the_next_one_arrives(name: str, setting: Setting) -> None:
    with make_rig(name, setting) as rig:
        method, values = messages_of(rig.codec)[0]
        rig.script.answers += [lost, whole]
        rig.wait(getattr(rig.ring, method)(1, **values))
        rig.wait(rig.ring.flush(PATIENCE))
        rig.wait(rig.ring.transmit(message_of(rig.codec)))
        rig.until(lambda: rig.nodes[0].taken)
        assert rig.nodes[0].taken == [message_of(rig.codec)]


@timed
def test_a_damaged_message_is_never_taken_for_another(name: str, setting: Setting) -> None:
    """Where a check value covers it: its header has none, so an address may change."""
    with make_rig(name, setting) as rig:
        message = message_of(rig.codec)
        size = 8 * len(message.to_frame())
        for bit in range(8, size - 8):
            rig.script.answers.append(flipped(bit))
            rig.wait(rig.ring.transmit(message))
            rig.wait(rig.ring.sleep(1.0))
        assert all(each == message for each in rig.nodes[0].taken)
        assert len(rig.nodes[0].taken) < size / 8
        assert rig.engines[0].netstat & (NetStat.RX_CRC | NetStat.RX_FRAME)
        taken = len(rig.nodes[0].taken)
        rig.wait(rig.ring.transmit(message))
        rig.until(lambda: len(rig.nodes[0].taken) > taken)


@timed
def test_faults_at_random_change_no_message(name: str, setting: Setting) -> None:
    plan = FaultPlan(drop=0.2, truncate=0.2, flip=(0.2, 1, 1), seed=5)
    with make_rig(name, setting) as rig:
        field = type(message_of(rig.codec)).FIELDS[0]
        sent = [message_of(rig.codec, **{field: number}) for number in range(40)]
        rig.script.drawn = plan
        for message in sent:
            rig.wait(rig.ring.transmit(message))
            rig.wait(rig.ring.sleep(0.6))
        rig.script.drawn = None
        assert all(each in sent for each in rig.nodes[0].taken)
        assert 5 < len(rig.nodes[0].taken) < len(sent)


@timed
def test_a_full_buffer_is_told(name: str, setting: Setting) -> None:
    with make_rig(name, setting, tx_timeout=0.0, room=rig_room(name)) as rig:
        method, values = messages_of(rig.codec)[0]

        def fill() -> None:
            for _ in range(1000):
                rig.wait(getattr(rig.ring, method)(1, **values))

        with pytest.raises(NoRoom, match="the transmit buffer was full for 0 s"):
            fill()
        assert rig.ring.clear_netstat() & NetStat.TX_TIMEOUT
        rig.wait(rig.ring.flush(PATIENCE))
        assert not rig.ring.netstat


def rig_room(name: str) -> int:
    """The smallest transmit buffer."""
    most: int = RINGS[name]().Ring.codec.MARKING.most
    return most + 2


@everywhere
def test_closing_ends_a_call_that_waits(name: str, setting: Setting) -> None:
    with make_rig(name, setting) as rig:
        if setting.client == "asyncio" and not setting.paced:

            async def run() -> None:
                waiting = asyncio.ensure_future(rig.ring.receive(PATIENCE))
                await asyncio.sleep(0)
                await rig.ring.close()
                await waiting

            with pytest.raises(PortLost):
                rig.run(run)
        else:
            rig.wait(rig.ring.close())
            with pytest.raises(PortLost):
                rig.wait(rig.ring.receive(PATIENCE))


@pytest.mark.parametrize("name", RINGS)
def test_a_cancelled_call_leaves_the_node_as_it_was(name: str) -> None:
    with make_rig(name, VIRTUAL[1]) as rig:
        method, values = messages_of(rig.codec)[0]

        async def run() -> Any:
            task = asyncio.ensure_future(rig.ring.receive(PATIENCE))
            await asyncio.sleep(0)
            task.cancel()
            with suppress(asyncio.CancelledError):
                await task
            await getattr(rig.ring, method)(3, **values)
            return await rig.ring.receive(PATIENCE)

        assert next(iter(rig.codec.MESSAGES)) == rig.run(run).NAME


def test_frames_and_events_are_told(bus_pair: BusPairs, caplog: pytest.LogCaptureFixture) -> None:
    cell: Any = RINGS["cell"]()
    codec = cell.Ring.codec
    frames: list[Frame] = []
    taken: list[Any] = []

    class Robot(cell.RingHandlers):  # type: ignore[misc]  # Any: generated at run time
        """A robot that moves."""

        def move(self, message: Any, now: float) -> None:
            taken.append((message.place, message.speed))

    with caplog.at_level(logging.DEBUG, "cell"):
        pair = bus_pair(f"{PACKAGE}.cell", Robot(), on_frame=frames.append, logger=logging.getLogger("cell"))
        pair.master.move(1, place=300)
        pair.master.receive_(1, parts=2)
        pair.master.tell(codec.Move(address=2, place=7))
        assert pair.master.receive(PATIENCE).place == 7
    assert taken == [(300, 5)]
    assert [each.message.NAME for each in frames if each.sent and each.message] == ["move", "receive", "move"]
    assert [each.sent for each in frames] == [True, True, True, False]
    records = [record.__dict__ for record in caplog.records]
    assert [each["event"] for each in records] == ["Queued", "Queued", "Queued", "Taken"]
    assert records[3][Taken.__name__.lower()] == "move"


def test_messages_that_nobody_receives_are_dropped_and_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("qlinkgen.bus.ring_making.INBOX", 2)
    events: list[Any] = []
    with make_rig("cell", VIRTUAL[0], on_event=events.append) as rig:
        for place in range(4):
            rig.ring.move(3, place=place)
        rig.ring.sleep(1.0)
        assert [rig.ring.receive(0).place for _ in range(2)] == [0, 1]
        dropped = [each for each in events if isinstance(each, Dropped)]
        assert [each.message.NAME for each in dropped] == ["move", "move"]
        assert dropped[0].text == "2 messages wait already: call `receive`, or pass handlers"
