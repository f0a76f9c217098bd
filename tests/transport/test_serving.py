"""Slaves on a port, blocking and in an event loop, with a master on the other end."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable

import pytest

from qlinkgen.codecs import qlink
from qlinkgen.errors import NoReply, PortLost
from qlinkgen.link import SlaveEngine
from qlinkgen.protocols.qlink import AsyncBus, Bus, VirtualNode
from qlinkgen.transport.memory import memory_pair
from qlinkgen.transport.serving import serve, serve_async

SLACK = 5.0


def slaves(*numbers: int, turnaround: float = 0.0) -> list[SlaveEngine]:
    return [SlaveEngine(qlink, VirtualNode(number), turnaround=turnaround) for number in numbers]


@pytest.mark.parametrize("turnaround", [0.0, 0.002])
def test_several_slaves_answer_in_a_thread(turnaround: float) -> None:
    ours, theirs = memory_pair()
    done = threading.Event()
    engines = slaves(3, 5, turnaround=turnaround)
    server = threading.Thread(target=serve, args=(theirs, *engines), kwargs={"stop": done.is_set})
    server.start()
    with Bus(ours, echo="none", slack=SLACK) as bus:
        try:
            assert [each.node for each in bus.scan([3, 5])] == [3, 5]
            reply = bus.transact(qlink.LoopBackRequest(node=5, data=b"\xa5\x00"))
            assert reply.response.data == b"\xa5\x00"
            assert reply.elapsed >= turnaround
        finally:
            done.set()
            server.join(30)
    assert not server.is_alive()


def test_a_port_that_goes_away_ends_the_server() -> None:
    ours, theirs = memory_pair()
    ours.close()
    with pytest.raises(PortLost):
        serve(theirs, *slaves(3))


def test_in_an_event_loop() -> None:
    ours, theirs = memory_pair()
    stop: Callable[[], bool] = lambda: stopped  # noqa: E731  # reads the variable below each time
    stopped = False

    async def scenario() -> None:
        nonlocal stopped
        server = asyncio.create_task(serve_async(theirs, *slaves(3), stop=stop))
        async with AsyncBus(ours, echo="none", slack=SLACK) as bus:
            assert (await bus.node(3).loop_back(data=b"x")).data == b"x"
            stopped = True
            await server
        with pytest.raises(PortLost):
            await bus.node(3).loop_back(data=b"x")

    asyncio.run(scenario())


def test_nobody_else_is_answered() -> None:
    ours, theirs = memory_pair()
    done = threading.Event()
    server = threading.Thread(target=serve, args=(theirs, *slaves(3)), kwargs={"stop": done.is_set})
    server.start()
    with Bus(ours, echo="none", slack=0.05, attempts=1) as bus:
        try:
            with pytest.raises(NoReply):
                bus.node(4).loop_back(data=b"x")
        finally:
            done.set()
            server.join(30)
