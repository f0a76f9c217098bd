"""The clients of a host beside single calls: threads, tasks, cancelling, raw packets, opening, events."""

from __future__ import annotations

import asyncio
import threading
from typing import Any

import pytest

from qlinkgen.codecs import mc1231a
from qlinkgen.errors import PortLost, PortMissing
from qlinkgen.link.host_events import InStep, OutOfStep
from qlinkgen.link.procedure import Ask, Pause, Procedure
from qlinkgen.link.transaction import Packet
from qlinkgen.protocols.mc1231a import AsyncHost, ChipEngine, ChipSet, Host
from qlinkgen.protocols.mc1231a.facts import SELECT
from qlinkgen.sim import VirtualPort
from qlinkgen.sim.chip_bus import chip_wire
from qlinkgen.sim.pty_bus import PtyBus
from qlinkgen.transport import open_port
from tests.mc1231a.conftest import MakeRig
from tests.mc1231a.rig import Rig, Setting, lose, make_rig, virtual

CALLS = 60


def test_threads_share_a_host_and_never_an_axis() -> None:
    """Each selects its axis and uses it atomically, without packets of others in between."""
    with make_rig(Setting("blocking", "memory")) as rig:
        wrong: list[Any] = []

        def use(number: int) -> None:
            axis = rig.host.axis(number)
            for value in range(CALLS):
                axis.set_kp(value=100 * number + value)
                if axis.get_kp().value != 100 * number + value:
                    wrong.append((number, value))

        threads = [threading.Thread(target=use, args=(number,)) for number in (1, 2)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert wrong == []
        assert rig.host.engine.total.out_of_step == 0


def test_tasks_share_a_host_and_never_an_axis() -> None:
    async def use(host: AsyncHost, number: int) -> list[int]:
        axis, seen = host.axis(number), []
        for value in range(CALLS):
            await axis.set_ki(value=1000 * number + value)
            seen.append((await axis.get_ki()).value - 1000 * number)
        return seen

    async def main() -> None:
        host = AsyncHost(VirtualPort(chip_wire(ChipSet())), slack=0.01)
        for seen in await asyncio.gather(use(host, 1), use(host, 2)):
            assert seen == [*range(CALLS)]

    asyncio.run(main())


def test_a_task_that_is_cancelled_leaves_a_host_that_works() -> None:
    async def main(name: str) -> None:
        async with AsyncHost(open_port(name), slack=0.5) as host:
            call = asyncio.create_task(host.axis(2).get_kp())
            await asyncio.sleep(0.02)
            call.cancel()
            with pytest.raises(asyncio.CancelledError):
                await call
            assert not host.engine.busy
            assert not host.engine.in_step
            engine._turnaround = 0.0
            assert (await host.axis(1).get_kp()).value == 1
            assert (await host.axis(2).get_kp()).value == 2

    engine = ChipEngine(ChipSet(), turnaround=0.1)
    for number, axis in engine.chip.axes.items():
        axis.write("kp", number)
    with PtyBus(chip_wire(engine, baud=None)) as line:
        asyncio.run(asyncio.wait_for(main(line.path), 60))


def test_raw_packets_and_policies_of_one_packet(rig: Rig) -> None:
    reply = rig.host.transact(Packet(mc1231a.SetKpRequest(value=4), SELECT[2], check=False))
    assert reply.response == mc1231a.SetKpResponse()
    reply = rig.host.transact(mc1231a.GetKpRequest())  # of whatever axis is current
    assert reply.response.value == 4
    assert reply.attempts == 1


def test_procedures_of_ones_own(rig: Rig) -> None:
    def sum_of_gains() -> Procedure[int]:
        total = 0
        for axis, context in SELECT.items():
            yield Ask(Packet(mc1231a.SetKpRequest(value=axis * 10), context))
            yield Pause(0.001)
            reply = yield Ask(Packet(mc1231a.GetKpRequest(), context))
            total += reply.response.value
        return total

    assert rig.host.run(sum_of_gains()) == 30


def test_events_come_to_who_wants_them(make: MakeRig) -> None:
    seen: list[Any] = []
    rig = make(on_event=seen.append)
    rig.host.axis(1).get_status()
    names = [type(event).__name__ for event in seen]
    assert names == ["Sent", "Sent", "Answered"]
    seen.clear()
    rig.port.inward.append(lose(0))
    rig.host.axis(1).get_status()
    assert [type(event) for event in seen if isinstance(event, OutOfStep | InStep)] == [OutOfStep, InStep]


def test_opening() -> None:
    with pytest.raises(PortMissing):
        Host.open("/dev/there-is-no-such-port", baud=9600)
    with pytest.raises(PortMissing):
        AsyncHost.open("/dev/there-is-no-such-port", baud=9600)
    with PtyBus(chip_wire(ChipSet(), baud=None)) as line:
        with Host.open(line.path, baud=9600, slack=1.0) as host:
            assert host.port.baud == 9600
            host.axis(1).set_pos(value=-5)
            assert host.axis(1).get_pos().value == -5
        with pytest.raises(PortLost):
            host.axis(1).get_pos()


def test_arguments_that_make_no_sense() -> None:
    for wrong, text in (
        ({"attempts": 0}, "attempts"),
        ({"slack": -1.0}, "host_slack"),
        ({"forgets": -0.1}, "forgets"),
    ):
        with pytest.raises(ValueError, match=text):
            virtual(**wrong).__enter__()


@pytest.mark.parametrize("chunks", ["byte", "random"])
@pytest.mark.parametrize("baud", [None, 9600])
def test_answers_in_pieces(chunks: Any, baud: int | None) -> None:
    host = Host(VirtualPort(chip_wire(ChipSet(), chunks=chunks, baud=baud)))
    for value in range(-50, 50):
        host.axis(1 + value % 2).set_pos(value=value)
        assert host.axis(1 + value % 2).get_pos().value == value
    assert host.engine.total.out_of_step == 0
