"""Drivers of a node: thread, event loop, or program; and their behaviour when a port fails."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest

from qlinkgen.codecs import trio
from qlinkgen.errors import LinkError, PortLost
from qlinkgen.link.ring import RingNode
from qlinkgen.link.ring_events import Broken, Passed, RingEvent, Taken
from qlinkgen.protocols.trio import (
    AsyncMotionCoordinator,
    CommsError,
    CoordinatorNode,
    MembraneKeypad,
    MotionCoordinator,
    NetStat,
    NoRoom,
    PassiveNode,
)
from qlinkgen.sim import VirtualPort
from qlinkgen.sim.ring import RingWire
from qlinkgen.transport import MemoryPort, PtyPort, memory_pair, memory_ring, open_port, open_pty
from qlinkgen.transport.port import Ability, Capabilities
from qlinkgen.transport.ring import NodeThread, PumpedNode, drive

PATIENCE = 20.0


@pytest.fixture(autouse=True)
def no_thread_is_left() -> Iterator[None]:
    before = set(threading.enumerate())
    yield
    left = [thread for thread in set(threading.enumerate()) - before if thread.name.startswith("ring")]
    assert left == []


def text(address: int, characters: str = "AB") -> bytes:
    return trio.CharacterTransfer(address=address, characters=characters).to_frame()


def read_all(port: MemoryPort | PtyPort, size: int) -> bytes:
    data, limit = b"", time.monotonic() + PATIENCE
    while len(data) < size and time.monotonic() < limit:
        data += port.read(0.1)
    return data


def test_a_node_sends_on_while_the_program_does_nothing() -> None:
    far, near = memory_pair()
    with MotionCoordinator(near):
        far.write(text(5))
        assert read_all(far, 4) == text(4)


def test_a_node_sends_on_while_the_program_is_busy() -> None:
    with open_pty() as far, MotionCoordinator.open(far.path) as mc:
        far.write(text(5))
        while not mc.counters.passed:
            pass
        assert read_all(far, 4) == text(4)


def test_head_first_over_a_pty() -> None:
    with open_pty() as far, MotionCoordinator.open(far.path, patience=PATIENCE):
        far.write(text(5)[:1])
        assert read_all(far, 1) == text(4)[:1]
        far.write(text(5)[1:])
        assert read_all(far, 3) == text(4)[1:]


def test_a_program_that_asks_again_and_again_lets_the_node_work() -> None:
    far, near = memory_pair()
    with MotionCoordinator(near) as mc:
        far.write(text(1, "k"))
        limit = time.monotonic() + PATIENCE
        while not mc.key(4):
            assert time.monotonic() < limit
        assert mc.get(4) == ord("k")


def test_many_threads_use_one_node() -> None:
    ports = memory_ring(2)
    with MotionCoordinator(ports[0]) as first, MotionCoordinator(ports[1]) as second:

        def sends() -> None:
            for _ in range(20):
                first.print_(10, "x", end="")

        senders = [threading.Thread(target=sends, name="sender") for _ in range(5)]
        for sender in senders:
            sender.start()
        assert [second.get(4, PATIENCE) for _ in range(100)] == [ord("x")] * 100
        for sender in senders:
            sender.join()


def test_a_lost_port_is_told_to_who_waits_and_to_who_sends() -> None:
    far, near = memory_pair()
    mc = MotionCoordinator(near)
    failures: list[BaseException] = []

    def waits() -> None:
        try:
            mc.get(4)
        except PortLost as lost:
            failures.append(lost)

    waiting = threading.Thread(target=waits, name="waiting")
    waiting.start()
    far.close()
    waiting.join(PATIENCE)
    assert len(failures) == 1
    assert mc.netstat == 0, "nothing failed to be sent"
    with pytest.raises(PortLost):
        mc.print_(10, "x")
    with pytest.raises(PortLost):
        mc.key(4) or mc.get(4)
    mc.close()


def test_a_port_that_takes_nothing_sets_the_status() -> None:
    far, near = memory_pair()
    mc = MotionCoordinator(near)
    broken = MonkeyWrite(near)
    with pytest.raises(PortLost):
        mc.print_(10, "x")
    assert (mc.netstat, mc.commserror) == (NetStat.TX_BUFFER, 0)
    mc.engine.receive(trio.CharacterTransfer(address=2, characters="on").to_frame(), mc.now())
    with pytest.raises(PortLost):
        mc.flush()
    assert mc.commserror == CommsError.RETRANSMIT_BUFFER
    mc.commserror = 0
    assert mc.commserror == 0
    broken.undo()
    mc.close()
    far.close()


class MonkeyWrite:
    """Makes a port refuse to send."""

    def __init__(self, port: Any) -> None:
        self._port = port
        port.write = self._refuse

    def _refuse(self, _data: bytes) -> None:
        raise PortLost("it takes nothing", port="x")

    def undo(self) -> None:
        del self._port.write


def test_a_closed_node_says_so() -> None:
    _far, near = memory_pair()
    mc = MotionCoordinator(near)
    mc.close()
    mc.close()
    with pytest.raises(PortLost):
        mc.print_(10, "x")


def test_closing_sends_what_still_waits() -> None:
    far, near = memory_pair()
    near.capabilities = Capabilities(paced=Ability.YES)
    near.baud = 1000
    mc = MotionCoordinator(near)
    assert isinstance(mc.driver, NodeThread)
    for name in "abc":
        mc.print_(10, name, end="")
    assert mc.counters.sent < 3, "the line is too slow for all of them at once"
    mc.close()
    assert far.read(0) == text(1, "a") + text(1, "b") + text(1, "c")


def test_a_paced_port_gets_one_own_message_at_a_time() -> None:
    with open_pty(baud=1000) as far:
        port = open_port(far.path, baud=1000)
        port.capabilities = Capabilities(paced=Ability.YES)
        with MotionCoordinator(port) as mc:
            start = time.monotonic()
            for _ in range(3):
                mc.print_(10, "a", end="")
            mc.flush(PATIENCE)
            assert time.monotonic() - start >= 0.06, "two messages of 30 ms go before the last one"
            assert read_all(far, 9) == text(1, "a") * 3


def test_no_room_is_told_and_sets_the_status() -> None:
    far, near = memory_pair()
    with MotionCoordinator(near, tx_timeout=0.05, patience=PATIENCE) as mc:
        far.write(text(5)[:1])  # an incomplete message delays all others
        assert read_all(far, 1)
        for _ in range(4):
            mc.print_(10, "x" * 250, end="")
        with pytest.raises(NoRoom, match=r"NETSTAT bit 0") as caught:
            mc.print_(10, "x" * 250, end="")
        assert isinstance(caught.value, LinkError)
        assert isinstance(caught.value, TimeoutError)
        assert mc.netstat == NetStat.TX_TIMEOUT
        assert mc.counters.refused == 1
        far.write(text(5)[1:])
        mc.flush(PATIENCE)
        mc.print_(10, "room again")


def test_a_sender_waits_for_room() -> None:
    far, near = memory_pair()
    with MotionCoordinator(near, tx_timeout=PATIENCE, patience=PATIENCE) as mc:
        far.write(text(5)[:1])
        assert read_all(far, 1)
        release = threading.Timer(0.1, far.write, (text(5)[1:],))
        release.start()
        for _ in range(6):
            mc.print_(10, "x" * 250, end="")
        release.join()
        assert mc.netstat == 0


def test_keys_without_room_are_counted() -> None:
    far, near = memory_pair()
    with MembraneKeypad(near, room=300, patience=PATIENCE) as keypad:
        far.write(trio.KeypadOffset(address=1, offset=1).to_frame())
        keypad.wait_until(lambda: keypad.node.offset, PATIENCE)
        far.write(text(5)[:1])
        keypad.wait_until(lambda: not keypad.engine.idle, PATIENCE)
        sent = sum(keypad.key_down("1") for _ in range(110))
        assert (sent, keypad.node.counters.lost_keys) == (100, 10)
        assert keypad.netstat == NetStat.TX_TIMEOUT
        far.write(text(5)[1:])


@pytest.mark.parametrize("kind", ["memory", "pty"])
def test_events_are_told(kind: str) -> None:
    far: Any
    far, near = memory_pair() if kind == "memory" else (pty := open_pty(), open_port(pty.path))
    seen: list[RingEvent] = []
    with PassiveNode(near, on_event=seen.append) as node:
        far.write(text(1) + text(3) + b"A")
        node.wait_until(lambda: len(seen) >= 4, PATIENCE)
    assert [type(event) for event in seen[:3]] == [Taken, Passed, Broken]
    assert [getattr(event, "frame", None) for event in seen[:2]] == [text(1), text(3)]
    far.close()


def test_a_passive_node_may_send() -> None:
    far, near = memory_pair()
    with PassiveNode(near) as node:
        node.transmit(trio.KeypadOffset(address=2, offset=1))
        assert read_all(far, 3) == trio.KeypadOffset(address=2, offset=1).to_frame()


def test_what_fails_in_the_nodes_thread_is_raised_where_it_is_used() -> None:
    def fails(_event: RingEvent) -> None:
        raise RuntimeError("on_event has failed")

    far, near = memory_pair()
    mc = MotionCoordinator(near, on_event=fails)
    far.write(b"A")
    with pytest.raises(RuntimeError, match="on_event has failed"):
        mc.get(4, PATIENCE)
    with pytest.raises(RuntimeError, match="on_event has failed"):
        mc.close()
    mc.close()


# ports with a clock of their own


def test_a_virtual_port_is_read_by_the_program_itself() -> None:
    wire = RingWire(trio, baud=1000)
    other = CoordinatorNode(baud=1000)
    wire.attach(other.link)
    with MotionCoordinator(VirtualPort(wire)) as mc:
        assert isinstance(mc.driver, PumpedNode)
        mc.send(10, 1, 9, 0.5)
        mc.print_(11, "me", end="")
        assert [mc.get(4, 5.0), mc.get(4, 5.0)] == [ord("m"), ord("e")]
        assert other.vr[9] == 0.5
        assert mc.now() == pytest.approx(0.16 + 0.01 + 0.04)  # a variable, then the text one byte later
        mc.sleep(2.0)
        assert mc.now() == pytest.approx(2.21)
        assert not mc.key(4)
        assert isinstance(drive(VirtualPort(wire), RingNode(trio)), PumpedNode)


def test_a_virtual_port_for_asyncio() -> None:
    async def main() -> tuple[float, list[int]]:
        wire = RingWire(trio, baud=1000)
        wire.attach(CoordinatorNode(baud=1000).link)
        async with AsyncMotionCoordinator(VirtualPort(wire)) as mc:
            await mc.print_(11, "me", end="")
            got = [await mc.get(4, 5.0), await mc.get(4, 5.0)]
            assert not await mc.key(4)
            await mc.sleep(1.0)
            return mc.now(), got

    now, got = asyncio.run(main())
    assert got == list(b"me")
    assert 1.0 < now < 1.1


# asyncio


def test_a_loop_keeps_a_node_at_work_while_tasks_wait() -> None:
    async def main() -> bytes:
        with open_pty() as far:
            async with AsyncMotionCoordinator(open_port(far.path)):
                far.write(text(5))
                for _ in range(1000):
                    await asyncio.sleep(0.002)
                    if data := far.read(0):
                        return data
        return b""

    assert asyncio.run(main()) == text(4)


@pytest.mark.parametrize("kind", ["memory", "pty"])
def test_tasks_wait_at_the_same_time(kind: str) -> None:
    async def main() -> list[int]:
        far: Any
        far, near = memory_pair() if kind == "memory" else (pty := open_pty(), open_port(pty.path))
        async with AsyncMotionCoordinator(near) as mc:
            waiting = [asyncio.create_task(mc.get(4, PATIENCE)) for _ in range(3)]
            given_up = asyncio.create_task(mc.get(4, PATIENCE))
            await asyncio.sleep(0.02)
            given_up.cancel()
            far.write(text(1, "abc"))
            got = [await each for each in waiting]
        far.close()
        return got

    assert asyncio.run(main()) == list(b"abc")


@pytest.mark.parametrize("kind", ["memory", "pty"])
def test_a_lost_port_is_told_to_tasks(kind: str) -> None:
    async def main() -> None:
        far: Any
        far, near = memory_pair() if kind == "memory" else (pty := open_pty(), open_port(pty.path))
        mc = AsyncMotionCoordinator(near)
        waiting = asyncio.create_task(mc.get(4, PATIENCE))
        await asyncio.sleep(0.01)
        far.close()
        with pytest.raises(PortLost):
            await waiting
        with pytest.raises(PortLost):
            await mc.print_(10, "x")
        await mc.close()
        await mc.close()

    asyncio.run(main())


def test_silence_inside_a_message_ends_in_a_loop_too() -> None:
    async def main() -> dict[str, int]:
        with open_pty() as far:
            async with AsyncMotionCoordinator(open_port(far.path), patience=0.05) as mc:
                far.write(text(5)[:2])
                await mc.wait_until(lambda: mc.counters.total_faults, PATIENCE)
                assert read_all(far, 3) == text(4)[:2] + b"\x80"
                return mc.counters.faults

    assert asyncio.run(main()) == {"truncated": 1}


def test_silence_inside_a_message_ends_in_a_thread_too() -> None:
    with open_pty() as far, MotionCoordinator.open(far.path, patience=0.05) as mc:
        far.write(text(5)[:2])
        mc.wait_until(lambda: mc.counters.total_faults, PATIENCE)
        assert read_all(far, 3) == text(4)[:2] + b"\x80"


def test_it_needs_a_running_loop() -> None:
    _far, near = memory_pair()
    with pytest.raises(RuntimeError, match="no running event loop"):
        AsyncMotionCoordinator(near)
