"""The blocking driver and the asyncio driver: one engine, the same outcomes."""

from __future__ import annotations

import asyncio
import gc
import select
import socket
import threading
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from qlinkgen.codecs import qlink
from qlinkgen.errors import LinkError, NoReply, PortLost
from qlinkgen.link import Ask, MasterEngine, Pause, Procedure, Reply, SlaveEngine, Tell
from qlinkgen.link.events import Answered, Event, Sent, Stray, TimedOut
from qlinkgen.protocols.qlink.matching import ACCEPTS
from qlinkgen.transport import MemoryPort, Port, memory_pair
from qlinkgen.transport.aio import AsyncMaster
from qlinkgen.transport.blocking import BlockingMaster
from qlinkgen.transport.conversation import ASSUMED_LATENCY, OTHER_PROGRAM, WAKE_UP, host_slack, timing_of
from qlinkgen.transport.port import Ability, Capabilities
from qlinkgen.transport.serving import serve
from tests.link.line import Node, bus
from tests.transport.conftest import PATIENCE

ASK = qlink.MotorPositionRequest(node=3)
SILENT = qlink.MotorPositionRequest(node=9)
ANSWER = qlink.MotorPositionResponse(node=3, position=3000)
#: Seconds of slack with an answer, and without one.
AMPLE, SCANT = 10.0, 0.01


def engine_for(port: Port, slack: float = AMPLE, attempts: int = 3) -> MasterEngine:
    return MasterEngine(qlink, timing_of(qlink, port, slack=slack, attempts=attempts), accepts=ACCEPTS)


class SocketPort(Port):
    """A port with a descriptor, as devices have."""

    def __init__(self, end: socket.socket) -> None:
        self.name, self.baud, self.capabilities = "socket", 115200, Capabilities()
        self._end = end

    def read(self, timeout: float) -> bytes:
        if not select.select([self._end], [], [], timeout)[0]:
            return b""
        if data := self._end.recv(4096):
            return data
        raise PortLost("the other end was closed", port=self.name)

    def write(self, data: bytes) -> None:
        self._end.sendall(data)

    def close(self) -> None:
        self._end.close()

    def fileno(self) -> int:
        return self._end.fileno()


def socket_pair() -> tuple[SocketPort, SocketPort]:
    here, there = socket.socketpair()
    return SocketPort(here), SocketPort(there)


Pair = Callable[[], tuple[Port, Port]]
PAIRS: list[Pair] = [memory_pair, socket_pair]
over_both = pytest.mark.parametrize("pair", PAIRS, ids=["memory", "descriptor"])


@contextmanager
def line(pair: Pair, *nodes: int) -> Iterator[tuple[Port, list[Node]]]:
    """The master's end of a line on which some nodes answer."""
    here, there = pair()
    served = [Node(number) for number in nodes]
    done = threading.Event()
    slaves = [SlaveEngine(qlink, node) for node in served]
    thread = threading.Thread(target=serve, args=(there, *slaves), kwargs={"stop": done.is_set})
    thread.start()
    try:
        yield here, served
    finally:
        done.set()
        thread.join(PATIENCE)
        here.close()
        there.close()
        assert not thread.is_alive()


class Client:
    """A driver, called from a synchronous test."""

    def __init__(self, kind: str, port: Port, engine: MasterEngine, on_event: Any = None) -> None:
        self.asynchronous = kind == "asyncio"
        self.engine = engine
        maker = AsyncMaster if self.asynchronous else BlockingMaster
        self.master: Any = maker(engine, port, on_event=on_event)

    def call(self, what: Callable[[Any], Any]) -> Any:
        if not self.asynchronous:
            return what(self.master)

        async def run() -> Any:
            return await what(self.master)

        return asyncio.run(run())

    def transact(self, request: Any, **options: Any) -> Reply:
        reply: Reply = self.call(lambda master: master.transact(request, **options))
        return reply

    def run(self, procedure: Procedure[Any], *rest: Any) -> Any:
        return self.call(lambda master: master.run(procedure, *rest))

    def reports(self, procedure: Procedure[Any], count: int | None = None) -> list[Any]:
        """The reports of a procedure, closed after a number of them."""
        if self.asynchronous:
            return self.call(lambda master: _reports_async(master, procedure, count))  # type: ignore[no-any-return]
        reports = []
        steps = self.master.iterate(procedure)
        for report in steps:
            reports.append(report)
            if len(reports) == count:
                steps.close()
        return reports


async def _reports_async(master: AsyncMaster, procedure: Procedure[Any], count: int | None) -> list[Any]:
    reports = []
    steps = master.iterate(procedure)
    async for report in steps:
        reports.append(report)
        if len(reports) == count:
            await steps.aclose()
            break
    return reports


clients = pytest.mark.parametrize("kind", ["blocking", "asyncio"])


@clients
@over_both
def test_the_same_outcomes(kind: str, pair: Pair) -> None:
    requests = [
        ASK,
        qlink.LoopBackRequest(node=5, offset=2, data=b"\xa5" * 25),
        qlink.NodeSyncRequest(node=0, counter=7),
        qlink.MotionRequest(node=5, counter=4, segments=[1, 2, 3]),
        qlink.ReadRequest(node=3, size=26),
        qlink.NodeStartRequest(node=3),
        qlink.NodeResetRequest(node=5),
    ]
    with line(pair, 3, 5) as (port, nodes):
        events: list[Event] = []
        client = Client(kind, port, engine_for(port), events.append)
        replies = [client.transact(request) for request in requests]
        assert [reply.response for reply in replies] == [
            ANSWER,
            qlink.LoopBackResponse(node=5, offset=2, data=b"\xa5" * 25),
            None,
            qlink.MotionResponse(node=5, counter=4, fifo_space=200),
            qlink.ReadResponse(node=3, data=bytes(26)),
            None,
            qlink.NodeResetResponse(node=5),
        ]
        assert [reply.attempts for reply in replies] == [1] * 7
        assert [event.request for event in events if isinstance(event, Sent)] == requests
        assert sum(isinstance(event, Answered) for event in events) == 5
        with pytest.raises(qlink.EncodeError):
            client.transact(qlink.MotorPositionRequest(node=40))
        with pytest.raises(TypeError):
            client.transact(ANSWER)
        with pytest.raises(ValueError, match="attempts"):
            client.transact(ASK, attempts=0)
        assert client.transact(ASK).response == ANSWER
    assert [type(request) for request in nodes[0].heard] == [
        qlink.MotorPositionRequest, qlink.NodeSyncRequest, qlink.ReadRequest,
        qlink.NodeStartRequest, qlink.MotorPositionRequest,
    ]  # fmt: skip


@clients
@over_both
def test_no_answer(kind: str, pair: Pair) -> None:
    with line(pair) as (port, _):
        events: list[Event] = []
        client = Client(kind, port, engine_for(port, SCANT), events.append)
        begun = port.now()
        with pytest.raises(NoReply) as seen:
            client.transact(SILENT, attempts=2)
        assert seen.value.attempts == 2
        assert port.now() - begun >= 2 * SCANT
        assert [event.attempt for event in events if isinstance(event, TimedOut)] == [1, 2]


@clients
def test_on_the_virtual_clock_they_do_the_same_to_the_bit(kind: str) -> None:
    outcomes = []
    for each in ("blocking", kind):
        _, port, _ = bus(3, 5)
        events: list[Event] = []
        client = Client(each, port, engine_for(port, 0.002), events.append)
        for request in (ASK, SILENT, qlink.NodeSyncRequest(node=0), qlink.NodeResetRequest(node=5)):
            try:
                client.transact(request)
            except LinkError as error:
                outcomes.append(str(error))
        outcomes.append(str([(type(event).__name__, event.at) for event in events]))
    assert outcomes[: len(outcomes) // 2] == outcomes[len(outcomes) // 2 :]


@clients
def test_what_came_before_is_no_answer(kind: str) -> None:
    with line(memory_pair, 3) as (port, _):
        there = _other_end(port)
        old = qlink.MotorPositionResponse(node=3, position=1)
        there.write(old.to_frame() * 3)
        events: list[Event] = []
        client = Client(kind, port, engine_for(port), events.append)
        assert client.transact(ASK).response == ANSWER
        assert sum(isinstance(event, Stray) for event in events) == 3


def _other_end(port: Port) -> MemoryPort:
    """A port that writes what `port` reads."""
    assert isinstance(port, MemoryPort)
    return MemoryPort("tap", port.baud, port._outgoing, port._incoming)


class TestOneTransactionAtATime:
    def test_threads(self) -> None:
        with line(memory_pair, 3, 5) as (port, _):
            master = BlockingMaster(engine_for(port), port)
            wrong: list[Any] = []

            def ask(number: int) -> None:
                for count in range(25):
                    request = qlink.LoopBackRequest(node=3 if number % 2 else 5, data=bytes((number, count)))
                    response = master.transact(request).response
                    if (response.node, response.data) != (request.node, request.data):
                        wrong.append((request, response))

            threads = [threading.Thread(target=ask, args=(number,)) for number in range(4)]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join(PATIENCE)
            assert wrong == []
            assert master.engine.total.answers == 100
            assert master.engine.total.repeats == 0

    def test_tasks(self) -> None:
        with line(memory_pair, 3, 5) as (port, _):

            async def ask(master: AsyncMaster, number: int) -> list[bytes]:
                requests = [qlink.LoopBackRequest(node=3, data=bytes((number, count))) for count in range(10)]
                return [(await master.transact(request)).response.data for request in requests]

            async def all_of_them() -> list[list[bytes]]:
                master = AsyncMaster(engine_for(port), port)
                return await asyncio.gather(*(ask(master, number) for number in range(4)))

            expected = [[bytes((number, count)) for count in range(10)] for number in range(4)]
            assert asyncio.run(all_of_them()) == expected

    def test_two_buses_do_not_wait_for_one_another(self) -> None:
        here, there = memory_pair()
        lost: list[BaseException] = []
        waiting = BlockingMaster(engine_for(here, PATIENCE), here)

        def ask() -> None:
            try:
                waiting.transact(SILENT)
            except PortLost as error:
                lost.append(error)

        thread = threading.Thread(target=ask)
        thread.start()
        assert there.read(PATIENCE) != b""  # now it waits for an answer
        with line(memory_pair, 3) as (port, _):
            assert BlockingMaster(engine_for(port), port).transact(ASK).response == ANSWER
        assert thread.is_alive()
        there.close()
        thread.join(PATIENCE)
        assert len(lost) == 1
        assert not waiting.engine.busy


class Interrupted(BaseException):
    """Ctrl-C, or an exception of a signal handler."""


class TestGivingUp:
    @pytest.mark.parametrize("error", [KeyboardInterrupt, Interrupted])
    def test_an_interrupt_leaves_a_usable_bus(
        self, error: type[BaseException], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        _, port, nodes = bus(3)
        engine = engine_for(port, 0.002)
        master = BlockingMaster(engine, port)
        read = port.read

        def interrupted(timeout: float) -> bytes:
            if timeout:
                monkeypatch.setattr(port, "read", read)
                raise error
            return read(timeout)

        monkeypatch.setattr(port, "read", interrupted)
        with pytest.raises(error):
            master.transact(ASK)
        assert not master.engine.busy
        old = engine.counters[3]
        assert (old.requests, old.answers) == (1, 0)
        reply = master.transact(qlink.LoopBackRequest(node=3, data=b"x"))
        assert reply.response.data == b"x"
        assert old.late == 1  # the answer to the aborted transaction
        assert len(nodes[0].heard) == 2

    @over_both
    def test_a_cancelled_task_leaves_a_usable_bus(self, pair: Pair) -> None:
        with line(pair, 3) as (port, _):

            async def scenario() -> None:
                master = AsyncMaster(engine_for(port, 0.25), port)
                task = asyncio.create_task(master.transact(SILENT))
                while not master.engine.total.requests:
                    await asyncio.sleep(0.001)
                task.cancel()
                with pytest.raises(asyncio.CancelledError):
                    await task
                assert not master.engine.busy
                assert (await master.transact(ASK)).response == ANSWER
                if (descriptor := port.fileno()) is not None:
                    assert not asyncio.get_running_loop().remove_reader(descriptor)

            asyncio.run(scenario())

    def test_a_task_that_waits_for_its_turn_can_be_cancelled(self) -> None:
        with line(memory_pair, 3) as (port, _):

            async def scenario() -> None:
                master = AsyncMaster(engine_for(port, 0.25), port)
                first = asyncio.create_task(master.transact(SILENT, attempts=1))
                await asyncio.sleep(0)
                second = asyncio.create_task(master.transact(SILENT, attempts=1))
                await asyncio.sleep(0)
                second.cancel()
                with pytest.raises(asyncio.CancelledError):
                    await second
                with pytest.raises(NoReply):
                    await first
                assert master.engine.total.requests == 1
                assert (await master.transact(ASK)).response == ANSWER

            asyncio.run(scenario())

    def test_cancelled_twice_the_port_is_still_read_by_one_at_a_time(self) -> None:
        with line(memory_pair, 3) as (port, _):
            reading = 0
            read = port.read

            def counted(timeout: float) -> bytes:
                nonlocal reading
                assert reading == 0
                reading += 1
                try:
                    return read(timeout)
                finally:
                    reading -= 1

            port.read = counted  # type: ignore[method-assign]

            async def scenario() -> None:
                master = AsyncMaster(engine_for(port, 0.25), port)
                task = asyncio.create_task(master.transact(SILENT))
                while not reading:
                    await asyncio.sleep(0.001)
                for _ in range(3):
                    task.cancel()
                    await asyncio.sleep(0.001)
                with pytest.raises(asyncio.CancelledError):
                    await task
                assert (await master.transact(ASK)).response == ANSWER

            asyncio.run(scenario())

    def test_a_port_that_is_lost_while_its_task_is_cancelled(self) -> None:
        complaints: list[Any] = []
        here, there = memory_pair()

        async def scenario() -> None:
            asyncio.get_running_loop().set_exception_handler(lambda loop, context: complaints.append(context))
            master = AsyncMaster(engine_for(here), here)
            task = asyncio.create_task(master.transact(SILENT))
            while not master.engine.total.requests:
                await asyncio.sleep(0.001)
            await asyncio.sleep(0.01)
            task.cancel()
            await asyncio.sleep(0)
            there.close()
            with pytest.raises((asyncio.CancelledError, PortLost)):
                await task
            assert not master.engine.busy

        asyncio.run(scenario())
        gc.collect()
        assert complaints == []


class TestPortLost:
    @clients
    @over_both
    def test_while_an_answer_is_waited_for(self, kind: str, pair: Pair) -> None:
        here, there = pair()
        client = Client(kind, here, engine_for(here))

        def close() -> None:
            there.read(PATIENCE)
            there.close()

        closer = threading.Thread(target=close)
        closer.start()
        with pytest.raises(PortLost):
            client.transact(ASK)
        closer.join(PATIENCE)
        assert not client.engine.busy
        with pytest.raises(PortLost):
            client.transact(ASK)
        here.close()

    @clients
    def test_while_a_request_is_sent(self, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
        _, port, _ = bus(3)
        client = Client(kind, port, engine_for(port, 0.002))
        for request in (ASK, qlink.NodeSyncRequest(node=0)):
            with monkeypatch.context() as patch:

                def lost(data: bytes) -> None:
                    raise PortLost("unplugged", port="virtual")

                patch.setattr(port, "write", lost)
                with pytest.raises(PortLost, match="unplugged"):
                    client.transact(request)
            assert not client.engine.busy
        assert client.transact(ASK).response == ANSWER  # reopened, say


class Cleaner:
    """Procedures that record how they ended."""

    def __init__(self) -> None:
        self.closed = 0

    def counting(self, count: int) -> Procedure[int]:
        try:
            for number in range(count):
                reply = yield Ask(ASK)
                assert reply.response == ANSWER
                yield Tell(number)
            return count
        finally:
            self.closed += 1


@clients
class TestProcedures:
    def virtual(self, kind: str) -> tuple[Client, Port]:
        _, port, _ = bus(3)
        return Client(kind, port, engine_for(port, 0.002)), port

    def test_run(self, kind: str) -> None:
        client, _ = self.virtual(kind)
        cleaner, told = Cleaner(), list[int]()
        assert client.run(cleaner.counting(3), told.append) == 3
        assert client.run(cleaner.counting(2)) == 2
        assert (told, cleaner.closed) == ([0, 1, 2], 2)

    def test_iterate(self, kind: str) -> None:
        client, _ = self.virtual(kind)
        cleaner = Cleaner()
        assert client.reports(cleaner.counting(3)) == [0, 1, 2]
        assert cleaner.closed == 1

    def test_closed_in_the_middle(self, kind: str) -> None:
        client, _ = self.virtual(kind)
        cleaner = Cleaner()
        assert client.reports(cleaner.counting(100), 2) == [0, 1]
        assert cleaner.closed == 1
        assert client.engine.total.requests == 2
        assert client.transact(ASK).response == ANSWER

    def test_progress_that_fails_ends_the_procedure_at_once(self, kind: str) -> None:
        client, _ = self.virtual(kind)
        cleaner = Cleaner()
        seen: list[int] = []

        def fail(report: int) -> None:
            raise ZeroDivisionError

        def run(master: Any) -> Any:
            if not client.asynchronous:
                try:
                    return master.run(cleaner.counting(9), fail)
                finally:
                    seen.append(cleaner.closed)
            return _run_and_look(master, cleaner, fail, seen)

        with pytest.raises(ZeroDivisionError):
            client.call(run)
        assert seen == [1]

    def test_failures_are_thrown_where_it_was_asked(self, kind: str) -> None:
        client, _ = self.virtual(kind)

        def brave() -> Procedure[list[str]]:
            seen = []
            for request in (SILENT, qlink.MotorPositionRequest(node=99), ANSWER, ASK):
                try:
                    yield Ask(request, attempts=1)
                except (LinkError, ValueError, TypeError) as error:
                    seen.append(type(error).__name__)
            return seen

        assert client.run(brave()) == ["NoReply", "EncodeError", "TypeError"]

    def test_failures_that_it_does_not_expect_reach_the_caller(self, kind: str) -> None:
        client, _ = self.virtual(kind)

        def plain() -> Procedure[None]:
            yield Ask(SILENT, attempts=1)

        with pytest.raises(NoReply):
            client.run(plain())
        assert client.transact(ASK).response == ANSWER

    def test_arguments_of_ask(self, kind: str) -> None:
        client, _ = self.virtual(kind)

        def once() -> Procedure[int]:
            try:
                yield Ask(SILENT, attempts=2)
            except NoReply as error:
                return error.attempts
            return 0

        assert client.run(once()) == 2

    def test_pause(self, kind: str) -> None:
        client, port = self.virtual(kind)

        def sleeper() -> Procedure[float]:
            begun: float = yield Pause(0)
            ended: float = yield Pause(1.5)
            assert ended == port.now()
            return ended - begun

        assert client.run(sleeper()) == pytest.approx(1.5)

    def test_a_procedure_that_does_nothing(self, kind: str) -> None:
        client, _ = self.virtual(kind)

        def nothing() -> Procedure[str]:
            return "done"
            yield  # type: ignore[unreachable]

        assert client.run(nothing()) == "done"
        assert client.reports(nothing()) == []


async def _run_and_look(master: AsyncMaster, cleaner: Cleaner, fail: Any, seen: list[int]) -> None:
    try:
        await master.run(cleaner.counting(9), fail)
    finally:
        seen.append(cleaner.closed)


def test_the_result_of_an_iterator() -> None:
    _, port, _ = bus(3)
    master = BlockingMaster(engine_for(port, 0.002), port)
    steps: Generator[Any, None, int] = master.iterate(Cleaner().counting(1))
    assert next(steps) == 0
    with pytest.raises(StopIteration) as end:
        next(steps)
    assert end.value.value == 1


class TestEvents:
    @clients
    def test_none_are_kept_that_nobody_wants(self, kind: str) -> None:
        _, port, _ = bus(3)
        client = Client(kind, port, engine_for(port, 0.002))
        with pytest.raises(NoReply):
            client.transact(SILENT)
        assert len(client.engine.events) == 0

    @clients
    def test_a_listener_that_comes_later(self, kind: str) -> None:
        _, port, _ = bus(3)
        client = Client(kind, port, engine_for(port, 0.002))
        client.transact(ASK)
        events: list[Event] = []
        client.master.on_event = events.append
        client.transact(ASK)
        assert [type(event) for event in events] == [Sent, Answered]
        client.master.on_event = None
        client.transact(ASK)
        assert len(events) == 2

    @clients
    def test_one_that_fails_leaves_a_usable_bus(self, kind: str) -> None:
        _, port, _ = bus(3)
        calls = 0

        def fail(event: Event) -> None:
            nonlocal calls
            calls += 1
            if calls == 1:
                raise ZeroDivisionError

        client = Client(kind, port, engine_for(port, 0.002), fail)
        with pytest.raises(ZeroDivisionError):
            client.transact(ASK)
        assert client.transact(ASK).response == ANSWER
        assert calls == 4  # each event is passed once

    def test_one_may_ask_in_its_turn(self) -> None:
        _, port, _ = bus(3)
        responses: list[Any] = []

        def look(event: Event) -> None:
            if isinstance(event, TimedOut):
                responses.append(master.transact(ASK).response)

        master = BlockingMaster(engine_for(port, 0.002), port, on_event=look)
        with pytest.raises(NoReply):
            master.transact(SILENT, attempts=1)
        assert responses == [ANSWER]


@clients
def test_leaving_it_closes_the_port(kind: str) -> None:
    _, port, _ = bus(3)
    client = Client(kind, port, engine_for(port, 0.002))
    if kind == "blocking":
        with client.master as master:
            assert master.transact(ASK).response == ANSWER
    else:

        async def use() -> None:
            async with client.master as master:
                assert (await master.transact(ASK)).response == ANSWER

        asyncio.run(use())
    with pytest.raises(PortLost):
        port.read(0)


def test_slack_is_that_of_the_port() -> None:
    _, port, _ = bus()
    for latency, expected in ((None, ASSUMED_LATENCY + WAKE_UP), (0.001, WAKE_UP + 0.001), (0.0, WAKE_UP)):
        port.capabilities = Capabilities(latency=latency)
        assert host_slack(port) == pytest.approx(expected)
        assert timing_of(qlink, port).host_slack == pytest.approx(expected)
    assert timing_of(qlink, port, slack=0.5).host_slack == 0.5


def test_behind_a_pty_another_program_has_to_be_woken_too() -> None:
    _, port, _ = bus()
    port.capabilities = Capabilities(latency=0.0, paced=Ability.NO)
    assert host_slack(port) == pytest.approx(WAKE_UP + OTHER_PROGRAM)
    assert not timing_of(qlink, port).paced  # unknown, so assumed not to be paced
