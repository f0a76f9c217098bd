"""What buses of every protocol have: options, hooks, transactions of several calls, slaves on a port."""

from __future__ import annotations

import asyncio
import logging
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from itertools import pairwise, takewhile
from pathlib import Path
from typing import Any

import pytest

from qlinkgen.errors import NoReply, PortLost, Refused
from qlinkgen.link import Refusal, SlaveEngine
from qlinkgen.link.events import Frame, Sent
from qlinkgen.link.poll import Key, Poller
from qlinkgen.protocols.mc1231a import Host
from qlinkgen.pytest_plugin import BusPairs, bus_pair
from qlinkgen.sim import FaultPlan
from qlinkgen.transport import Ability, memory_pair, open_pty
from tests.bus.wires import PACKAGE, bus_of, codec_of, of_text, write
from tests.library.protocols import described

__all__ = ["bus_pair"]  # the fixture, where the plugin is not installed

modbus: Any = bus_of("modbus_rtu")
codec: Any = codec_of("modbus_rtu")
NODE = 17


class Registers(modbus.SlaveHandlers):  # type: ignore[misc]  # Any: generated at run time
    """A slave that answers in several ways."""

    def __init__(self, number: int = NODE) -> None:
        super().__init__(number)
        self.values = list(range(100))

    def read_holding_registers(self, request: Any, now: float) -> Any:
        if request.start + request.quantity > len(self.values):
            code = codec.ExceptionCode.ILLEGAL_DATA_ADDRESS
            raise Refusal(codec.ReadHoldingRegistersException(node=self.number, code=code))
        registers = self.values[request.start : request.start + request.quantity]
        return codec.ReadHoldingRegistersResponse(node=self.number, registers=registers)

    def write_single_register(self, request: Any, now: float) -> Any:
        self.values[request.number] = request.value
        return codec.WriteSingleRegisterResponse(node=self.number, number=request.number, value=request.value)


def read(node: Any, start: int, quantity: int = 1) -> Any:
    return node.read_holding_registers(start=start, quantity=quantity)


def test_values_go_both_ways_and_refusals_have_their_reply(bus_pair: BusPairs) -> None:
    pair = bus_pair(f"{PACKAGE}.modbus_rtu", Registers(), Registers(18))
    first, second = pair.master.node(NODE), pair.master.node(18)
    first.write_single_register(number=3, value=0xABCD)
    assert read(first, 2, 3).registers == [2, 0xABCD, 4]
    assert read(second, 3).registers == [3]
    with pytest.raises(Refused) as caught:
        read(first, 99, 2)
    reply: Any = caught.value.reply
    assert reply.code == codec.ExceptionCode.ILLEGAL_DATA_ADDRESS
    # What is not overridden refuses, as the schema says.
    with pytest.raises(Refused, match="illegal_function"):
        first.read_coils(start=0, quantity=1)
    assert pair.others[0].counters.answers == 4


def test_the_answer_of_another_node_does_not_deafen_a_slave() -> None:
    """Read as a request, its third byte from the end says that 62 bytes follow: the silence tells better."""
    slave = SlaveEngine(codec, Registers(), host_slack=0.001)
    answer = codec.WriteMultipleCoilsResponse(node=1, start=36632, quantity=0x11D).to_frame()
    request = codec.ReadHoldingRegistersRequest(node=NODE, start=4, quantity=1).to_frame()
    for slave_time, heard in ((0.0, answer), (0.05, request)):
        slave.receive(heard, slave_time)
    assert slave.bytes_to_send(0.1) == codec.ReadHoldingRegistersResponse(node=NODE, registers=[4]).to_frame()


def test_frames_have_the_silence_between_them_that_the_schema_requires(bus_pair: BusPairs) -> None:
    pair = bus_pair(modbus.Bus, Registers(), turnaround=0.01)
    bus, byte_time = pair.master, pair.wire.byte_time
    heard: list[tuple[float, float]] = []
    pair.wire.taps.append(lambda at, _, data: heard.append((at - len(data) * byte_time, at)))
    for start in (1, 2):
        read(bus.node(NODE), start)
    bus.write_single_register(0, number=1, value=1)
    read(bus.node(NODE), 1)
    silences = [begin - end for (_, end), (begin, _) in pairwise(heard)]
    assert len(silences) == 6
    assert min(silences) >= 3.5 * byte_time
    # So has the answer of a slave on a paced port.
    _, far = memory_pair()
    far.capabilities = replace(far.capabilities, paced=Ability.YES)
    (paced,) = modbus.Slave(far, Registers(), slack=0.0).engines
    paced.receive(codec.ReadHoldingRegistersRequest(node=NODE, start=4, quantity=1).to_frame(), 1.0)
    assert not paced.bytes_to_send(1.0 + 0.00174)
    assert paced.bytes_to_send(1.0 + 0.00176)


def test_faults_are_repeated_and_a_silent_node_goes_offline(bus_pair: BusPairs) -> None:
    pair = bus_pair(modbus.Bus, Registers(), faults=FaultPlan(drop=0.3, seed=3), attempts=10)
    for number in range(50):
        pair.master.write_single_register(NODE, number=5, value=number)
        assert read(pair.master.node(NODE), 5).registers == [number]
    assert pair.master.engine.total.repeats > 10
    for _ in range(2):
        with pytest.raises(NoReply, match="sent 10 times"):
            read(pair.master.node(99), 1)
    with pytest.raises(NoReply, match="not sent"):
        read(pair.master.node(99), 1)


def test_polling(bus_pair: BusPairs) -> None:
    """Each request has its own period; a refusal is an outcome; a silent node does not delay the others."""
    periods: dict[Key, float] = {
        (NODE, "read_holding_registers"): 0.1,
        (NODE, "read_coils"): 0.5,
        (99, "read_holding_registers"): 0.1,
    }
    requests = {
        (node, name): codec.COMMANDS[name].request(node=node, start=0, quantity=1) for node, name in periods
    }
    pair = bus_pair(modbus.Bus, Registers(), attempts=1)
    poller = Poller(codec, periods, requests=requests)
    start = pair.master.port.now()
    with closing(pair.master.poll(poller)) as outcomes:
        found = list(takewhile(lambda each: each.time - start < 10, outcomes))
    good = [each for each in found if each.node == NODE and not each.error]
    assert [each.outcome.registers for each in good] == [[0]] * len(good)
    assert len(good) > 60
    assert all(isinstance(each.error, Refused) for each in found if each.command == "read_coils")
    assert sum(each.node == 99 for each in found) < 10
    with closing(pair.master.poll({(NODE, "read_holding_registers"): 1.0}, requests=requests)) as outcomes:
        time, node, command, outcome = next(outcomes)
    assert (node, command, outcome.registers) == (NODE, "read_holding_registers", [0])
    assert time > start + 10
    with pytest.raises(ValueError, match="unknown command 'nonsense'"):
        pair.master.poll({(NODE, "nonsense"): 1.0})


def test_frames_are_told_on_both_sides() -> None:
    near, far = memory_pair()
    heard: dict[str, list[Frame]] = {"master": [], "slave": []}
    slave = modbus.Slave(far, Registers(), on_frame=heard["slave"].append)
    with modbus.Bus(near, on_frame=heard["master"].append, slack=5.0) as bus, slave.running():
        answer = read(bus.node(NODE), 4)
        bus.on_frame = None
        read(bus.node(NODE), 5)
    request = codec.ReadHoldingRegistersRequest(node=NODE, start=4, quantity=1)
    for side, sent in (("master", [True, False]), ("slave", [False, True])):
        first = heard[side][:2]
        assert [each.sent for each in first] == sent
        assert [each.message for each in first] == [request, answer]
        assert [each.data for each in first] == [request.to_frame(), answer.to_frame()]
    assert len(heard["master"]) == 2
    assert len(heard["slave"]) == 4


def test_events_are_logged_with_their_values(bus_pair: BusPairs, caplog: pytest.LogCaptureFixture) -> None:
    logger = logging.getLogger("test.modbus")
    plan = FaultPlan(flip=1.0, seed=1)
    pair = bus_pair(modbus.Bus, Registers(), faults=plan, logger=logger, attempts=1)
    with caplog.at_level(logging.DEBUG, "test.modbus"), pytest.raises(NoReply):
        read(pair.master.node(NODE), 4)
    records: dict[str, Any] = {record.event: record for record in caplog.records}  # type: ignore[attr-defined]
    assert list(records) == ["Sent", "TimedOut", "Failed", "HealthChanged"]
    sent = records["Sent"]
    assert (sent.node, sent.request, sent.attempt) == (NODE, "read_holding_registers.request", 1)
    assert sent.frame == codec.ReadHoldingRegistersRequest(node=NODE, start=4, quantity=1).to_frame().hex()
    assert [records[each].levelname for each in records] == ["DEBUG", "INFO", "WARNING", "WARNING"]
    assert "no answer" in records["Failed"].getMessage()


def test_nothing_is_logged_by_default(bus_pair: BusPairs, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.DEBUG):
        read(bus_pair(modbus.Bus, Registers()).master.node(NODE), 4)
    assert not caplog.records


def starts(events: list[object]) -> list[int]:
    """Register numbers in the order in which they were asked for."""
    return [event.request.start for event in events if isinstance(event, Sent)]  # type: ignore[attr-defined]


def test_other_threads_wait_for_a_transaction(bus_pair: BusPairs) -> None:
    events: list[object] = []
    bus = bus_pair(modbus.Bus, Registers(), on_event=events.append).master
    inside = threading.Event()

    def other() -> None:
        inside.wait()
        read(bus.node(NODE), 50)

    thread = threading.Thread(target=other)
    thread.start()
    with bus.transaction(), bus.transaction():
        for start in range(5):
            read(bus.node(NODE), start)
            inside.set()
            thread.join(0.005)
    thread.join()
    assert starts(events) == [0, 1, 2, 3, 4, 50]


@pytest.mark.parametrize("within", [False, True], ids=["task", "tasks of the block"])
def test_other_tasks_wait_for_a_transaction(bus_pair: BusPairs, within: bool) -> None:
    events: list[object] = []

    async def run() -> None:
        bus = bus_pair(f"{PACKAGE}.modbus_rtu", Registers(), asynchronous=True, on_event=events.append).master
        node = bus.node(NODE)
        inside = asyncio.Event()

        async def other() -> None:
            await inside.wait()
            await read(node, 50)

        waiting = asyncio.create_task(other())
        async with bus.transaction(), bus.transaction():
            for start in range(5):
                called = read(node, start)
                await (asyncio.wait_for(called, 10) if within else called)
                inside.set()
        await waiting

    asyncio.run(run())
    assert starts(events) == [0, 1, 2, 3, 4, 50]


def test_a_transaction_ends_with_an_error(bus_pair: BusPairs) -> None:
    async def run() -> None:
        bus = bus_pair(modbus.AsyncBus, Registers()).master
        for _ in range(2):
            with pytest.raises(KeyError):
                async with bus.transaction():
                    raise KeyError
        await asyncio.gather(*(read(bus.node(NODE), start) for start in range(3)))
        assert bus.engine.total.answers == 3

    asyncio.run(run())


@pytest.mark.pty
def test_a_slave_serves_a_port_that_a_bus_opens() -> None:
    with open_pty() as far:
        slave = modbus.Slave(far, Registers())
        with slave.running(), modbus.Bus.open(far.path, baud=115200, slack=5.0) as bus:
            assert read(bus.node(NODE), 7, 2).registers == [7, 8]

            async def ask() -> Any:
                return await read(modbus.AsyncBus(bus.port, slack=5.0).node(NODE), 9)

            assert asyncio.run(ask()).registers == [9]
    assert slave.engines[0].counters.requests == 2


@pytest.mark.pty
def test_serve_opens_the_port_itself() -> None:
    opened, stopped = threading.Event(), threading.Event()

    def stop() -> bool:
        opened.set()
        return stopped.is_set()

    with open_pty() as near:
        served = threading.Thread(target=lambda: modbus.Slave.serve(near.path, Registers(), stop=stop))
        served.start()
        assert opened.wait(10)
        with modbus.Bus(near, slack=5.0) as bus:
            assert read(bus.node(NODE), 7).registers == [7]
            stopped.set()
            served.join()


def test_a_slave_answers_in_an_event_loop() -> None:
    near, far = memory_pair()

    async def run() -> Any:
        with modbus.Slave(far, Registers()) as slave:
            serving = asyncio.create_task(slave.run_async())
            answer = await read(modbus.AsyncBus(near, slack=5.0).node(NODE), 6)
            serving.cancel()
            await asyncio.wait([serving])
            assert serving.cancelled()
        return answer.registers

    assert asyncio.run(run()) == [6]


def test_an_error_of_a_handler_is_not_lost_with_its_thread() -> None:
    class Broken(Registers):
        def write_single_register(self, request: Any, now: float) -> Any:
            raise KeyError(request.number)

    near, far = memory_pair()
    slave = modbus.Slave(far, Broken())
    with pytest.raises(KeyError, match="7") as caught, slave.running(), modbus.Bus(near, attempts=1) as bus:
        bus.write_single_register(NODE, number=7, value=1)
    assert isinstance(caught.value.__context__, NoReply)


def test_a_port_that_is_lost_ends_a_running_slave() -> None:
    near, far = memory_pair()
    with pytest.raises(PortLost), modbus.Slave(far, Registers()).running():
        near.close()


@pytest.mark.pty
@pytest.mark.parametrize(
    "make",
    [
        lambda name: modbus.Bus.open(name, attempts=0),
        modbus.Slave.open,
        lambda name: Host.open(name, baud=57600, attempts=0),
    ],
    ids=["bus", "slave", "host"],
)
def test_a_port_is_closed_again_if_its_user_cannot_be_made(make: Callable[[str], object]) -> None:
    with open_pty() as port:
        for _ in range(2):  # an open port would be in use
            with pytest.raises(ValueError, match=r"attempts|handlers"):
                make(port.path)


@pytest.mark.pty
def test_a_pair_over_a_pty(bus_pair: BusPairs) -> None:
    pair = bus_pair(modbus.Bus, Registers(), transport="pty", slack=5.0)
    assert read(pair.master.node(NODE), 4).registers == [4]


WRONG: list[tuple[str, Callable[[], object], type[Exception], str]] = [
    ("node", lambda: modbus.Bus(memory_pair()[0]).node(248), ValueError, r"node must be 1\.\.247, not 248"),
    ("option", lambda: modbus.Bus(memory_pair()[0], atempts=3), TypeError, "atempts"),
    ("stop bits", lambda: modbus.Bus.open("loop://", stop_bits=3), ValueError, "3"),
    ("parity", lambda: modbus.Bus.open("loop://", parity="evn"), ValueError, "evn"),
    ("attempts", lambda: modbus.Bus(memory_pair()[0], attempts=0), ValueError, "attempts must be 1 or more"),
    ("handlers", lambda: modbus.Slave(memory_pair()[0]), ValueError, "SlaveHandlers"),
    ("name", lambda: modbus.Buss, AttributeError, "has no attribute 'Buss'"),
]


@pytest.mark.parametrize(("call", "error", "text"), [row[1:] for row in WRONG], ids=[row[0] for row in WRONG])
def test_what_is_wrong_is_told(call: Callable[[], object], error: type[Exception], text: str) -> None:
    with pytest.raises(error, match=text):
        call()


OWN = """\
qlinkgen: 1
protocol: {name: own, title: Own, revision: "1", source: Manual}
frame:
  parts:
    start: AA
    length: {type: u8, counts: [data]}
    code: {role: message, type: u8}
    data: {role: payload, size: 0..8}
    crc: {type: u16, algorithm: crc-16/modbus, over: [length, code, data]}
bus: {kind: link, sides: [host, sensor], response_within: 5 ms}
defaults: {addressing: none, repeat: safe, response: {id: request.id + 0x80}}
commands:
  open: {id: 1, from: host, request: {number: u32}, response: {number: {type: u32, echo: true}}}
  fetch: {id: 3, from: sensor, request: {block: u8}, response: {block: {type: u8, echo: true}}}
"""


def test_each_side_of_a_link_has_a_class(bus_pair: BusPairs) -> None:
    own = of_text(OWN)

    class Sensor(own.SensorHandlers):  # type: ignore[misc,name-defined]
        def open_(self, request: Any, now: float) -> Any:
            return codec_own.OpenResponse()

    class Host(own.HostHandlers):  # type: ignore[misc,name-defined]
        def fetch(self, request: Any, now: float) -> Any:
            return codec_own.FetchResponse()

    codec_own = sys.modules[f"{PACKAGE}.own"]
    pair = bus_pair(own.Host, Sensor(0), own=Host(0))
    assert pair.master.open_(number=7).number == 7
    sensor = bus_pair(own.Sensor, Host(0), own=Sensor(0)).master
    assert sensor.fetch(block=9).block == 9
    assert not hasattr(own, "Slave")
    with pytest.raises(ValueError, match=r"pass the class that asks, such as wire_of_buses\.own_bus\.Host"):
        bus_pair(f"{PACKAGE}.own")
    with pytest.raises(ValueError, match="the schema states no speed; pass baud"):
        own.Host.open("loop://", Host(0))


TEST = """
from mine.wire import modbus_rtu
from mine.wire.modbus_rtu_bus import SlaveHandlers


class Meter(SlaveHandlers):
    def read_holding_registers(self, request, now):
        return modbus_rtu.ReadHoldingRegistersResponse(node=self.number, registers=[42] * request.quantity)


def test_a_meter(bus_pair):
    bus = bus_pair("mine.wire.modbus_rtu", Meter(5)).master
    assert bus.node(5).read_holding_registers(start=1, quantity=2).registers == [42, 42]
"""


@pytest.mark.program
def test_the_plugin_gives_the_fixture_to_other_projects(tmp_path: Path) -> None:
    write(described("modbus_rtu").model, tmp_path, "mine/wire")
    (tmp_path / "test_meter.py").write_text(TEST)
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "qlinkgen.pytest_plugin",
        "-p",
        "no:cacheprovider",
        ".",
    ]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert "1 passed" in done.stdout


@pytest.mark.program
def test_a_bus_module_imports_qlinkgen_only_to_open_a_port(tmp_path: Path) -> None:
    write(described("modbus_rtu").model, tmp_path, "wire")
    code = (
        "import sys; from wire import modbus_rtu_bus as bus; print('qlinkgen' in sys.modules);"
        "bus.Bus; bus.Slave; print('qlinkgen.bus' in sys.modules, 'asyncio' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout == "False\nTrue False\n"
