"""Calls and handlers of a protocol with answers of every kind: their types, and a simulated line."""

from __future__ import annotations

import importlib
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from qlinkgen.backends.base import Options
from qlinkgen.backends.python import bus
from qlinkgen.backends.python import generate as generate_codec
from qlinkgen.errors import NoReply, Refused
from qlinkgen.link import Dialogue, MasterEngine, Refusal, SlaveEngine, Timing
from qlinkgen.schema import load
from qlinkgen.sim import VirtualPort, Wire
from qlinkgen.transport.blocking import BlockingMaster

SCHEMA = Path(__file__).parent.parent / "schemas/answers.yaml"
PACKAGE = "answers_of_the_tests"
PROGRAM = f"""
from __future__ import annotations

from collections.abc import AsyncGenerator, Generator, Iterator
from typing import Any, assert_type

from {PACKAGE} import answers as codec
from {PACKAGE} import answers_bus as bus


class Slave(bus.SlaveHandlers):
    def read(
        self, request: codec.ReadRequest, now: float
    ) -> codec.ReadResponse | codec.ReadFault | codec.Busy | codec.ReadPartly | None:
        return codec.ReadPartly(node=self.number, values=[1])

    def log(
        self, request: codec.LogRequest, now: float
    ) -> list[codec.LogResponse | codec.LogFault | codec.Busy | codec.LogEnd]:
        return [codec.LogResponse(node=self.number, entry=1), codec.LogEnd(node=self.number)]

    def observe(
        self, request: codec.ObserveRequest, now: float
    ) -> Iterator[codec.ObserveResponse]:
        return (codec.ObserveResponse(node=self.number, value=value) for value in range(9))

    def transfer(
        self, request: codec.TransferRequest, now: float
    ) -> Generator[codec.Ack, Any, codec.TransferWritten]:
        place: codec.TransferPlace = yield codec.Ack(node=self.number)
        block: codec.TransferBlock = yield codec.Ack(node=self.number)
        size = place.start + len(block.data)
        return codec.TransferWritten(node=self.number, number=request.number, size=size)


def sync(calls: bus.MasterCalls, node: bus.NodeCalls) -> None:
    assert_type(calls.read(3, number=1, quantity=2), codec.ReadResponse | codec.ReadPartly)
    assert_type(node.log(number=1), list[codec.LogResponse])
    assert_type(node.clear(number=1), codec.Ack)
    assert_type(calls.gather(0, number=1, nodes=[3, 4]), dict[int, codec.GatherResponse | None])
    assert_type(calls.observe(3, number=1), Generator[codec.ObserveResponse])
    for each in node.observe(number=1):
        assert_type(each, codec.ObserveResponse)
    place = codec.TransferPlace(node=3, start=1)
    told = calls.transfer(3, number=1, place=place, block=lambda _: codec.TransferBlock(node=3, data=b"1"))
    assert_type(told, tuple[codec.Ack, codec.Ack, codec.TransferWritten])


async def asynchronous(calls: bus.AsyncMasterCalls) -> None:
    assert_type(await calls.find(0, number=1), list[codec.FindResponse])
    assert_type(calls.observe(3, number=1), AsyncGenerator[codec.ObserveResponse])
"""


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the package of the protocol."""
    folder = tmp_path_factory.mktemp("answers")
    protocol, options = load(SCHEMA), Options(package=PACKAGE)
    for path, text in {**generate_codec(protocol, options), **bus.generate(protocol, options)}.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, "utf-8")
    return folder


@pytest.fixture
def modules(written: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Any, Any]:
    monkeypatch.syspath_prepend(written)
    return importlib.import_module(f"{PACKAGE}.answers"), importlib.import_module(f"{PACKAGE}.answers_bus")


def test_mypy_strict_is_content(written: Path) -> None:
    (written / "program.py").write_text(PROGRAM)
    command = [sys.executable, "-m", "mypy", "--strict", "-p", PACKAGE, "-m", "program"]
    done = subprocess.run(command, cwd=written, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def transferring(codec: Any, request: Any) -> Any:
    """A dialogue, refused at its second frame if that begins at 0."""
    place = yield codec.Ack(node=3)
    if place.start == 0:
        raise Refusal(codec.TransferFault(node=3, number=request.number, reason=1))
    block = yield codec.Ack(node=3)
    return codec.TransferWritten(node=3, number=request.number, size=place.start + len(block.data))


def measured(codec: Any) -> Iterator[Any]:
    return (codec.ObserveResponse(node=3, value=value) for value in range(1000))


def slave_of(codec: Any, calls: Any) -> Any:
    """A slave that answers in every way."""

    class Slave(calls.SlaveHandlers):  # type: ignore[misc]
        def __init__(self, number: int) -> None:
            super().__init__(number)
            self.asked = 0

        def read(self, request: Any, now: float) -> Any:
            if request.number == 9:
                return codec.ReadFault(node=self.number, number=9, reason=codec.Reason.UNKNOWN)
            if request.number == 8:
                return codec.ReadPartly(node=self.number, values=[5])
            values = [request.number] * request.quantity
            return codec.ReadResponse(node=self.number, number=request.number, values=values)

        def lock(self, request: Any, now: float) -> Any:
            self.asked += 1
            busy = request.number == 1 and self.asked == 1
            status = codec.Status.BUSY if busy else codec.Status(2 if request.number == 2 else 0)
            return codec.LockResponse(node=self.number, status=status)

        def write(self, request: Any, now: float) -> Any:
            return codec.Ack(node=self.number)

        def clear(self, request: Any, now: float) -> Any:
            raise Refusal(codec.ClearFault(node=self.number, number=request.number, reason=1))

        def log(self, request: Any, now: float) -> Any:
            entries = (codec.LogResponse(node=self.number, entry=each) for each in range(request.number))
            return [*entries, codec.LogEnd(node=self.number)]

        def find(self, request: Any, now: float) -> Any:
            return [codec.FindResponse(node=self.number, serial=1000 + self.number)]

        gather = staticmethod(lambda request, now: codec.GatherResponse(node=3, value=7))
        observe = staticmethod(lambda request, now: measured(codec))
        cease = staticmethod(lambda request, now: codec.Ack(node=3 if request.number == 4 else 9))
        transfer = staticmethod(lambda request, now: transferring(codec, request))

    return Slave(3)


def test_a_slave_refuses_what_it_does_not_support(modules: tuple[Any, Any]) -> None:
    codec, calls = modules
    slave, busy = calls.SlaveHandlers(3), codec.Busy(node=3)
    assert slave.handle(codec.ReadRequest(node=3, number=1), 0.0) == busy
    assert slave.handle(codec.LogRequest(node=3, number=1), 0.0) == [busy]


def test_calls_and_handlers(modules: tuple[Any, Any]) -> None:
    codec, calls = modules
    wire = Wire(baud=19200, collisions=False)
    slave = slave_of(codec, calls)
    wire.attach(SlaveEngine(codec, slave, turnaround=0.001), "node 3")
    master = BlockingMaster(MasterEngine(codec, Timing.of(codec, host_slack=0.002)), VirtualPort(wire))

    class Master(calls.MasterCalls):  # type: ignore[misc, name-defined]
        def ask(self, request: Any, *_: Any) -> Any:
            return master.transact(request).response

        ask_each = ask_many = ask_any = ask

        def ask_stream(self, request: Any, _: Any) -> Any:
            return master.stream(request)

        def ask_steps(self, request: Any, further: Any) -> Any:
            return master.transact(Dialogue(request, further)).response

        def tell(self, request: Any) -> None:
            master.transact(request)

    pump = Master()
    assert pump.read(3, number=4, quantity=2).values == [4, 4]
    assert pump.read(3, number=8) == codec.ReadPartly(node=3, values=[5])
    assert pump.lock(3, number=1).status == codec.Status.FINE
    assert slave.asked == 2
    assert pump.write(3, number=1, value=2) == codec.Ack(node=3)
    assert pump.write(0, number=1, value=2) is None
    assert [each.entry for each in pump.log(3, number=3)] == [0, 1, 2]
    assert [each.serial for each in pump.find(0, number=1)] == [1003]
    assert pump.gather(0, number=1, nodes=[5, 3]) == {5: None, 3: codec.GatherResponse(node=3, value=7)}
    values = pump.observe(3, number=4)
    assert [next(values).value for _ in range(5)] == [0, 1, 2, 3, 4]
    values.close()
    assert not master.engine.streams  # type: ignore[attr-defined]
    block = codec.TransferBlock(node=3, data=b"123")
    told = pump.transfer(3, number=1, place=codec.TransferPlace(node=3, start=5), block=lambda _: block)
    assert told == (codec.Ack(node=3), codec.Ack(node=3), codec.TransferWritten(node=3, number=1, size=8))
    with pytest.raises(Refused, match="number 1, reason unknown"):
        pump.transfer(3, number=1, place=codec.TransferPlace(node=3, start=0), block=block)
    refusals = {"read": "number 9, reason unknown", "clear": "number 9, reason unknown"}
    for name, reason in refusals.items():
        with pytest.raises(Refused) as caught:
            getattr(pump, name)(3, number=9)
        assert caught.value.reason == reason
    with pytest.raises(Refused, match="refused by node 3: locked"):
        pump.lock(3, number=2)
    with pytest.raises(NoReply):
        pump.clear(4, number=1)
