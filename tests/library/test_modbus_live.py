"""Modbus over pseudo-terminals: our master with pymodbus's server, its client with our slave."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from qlinkgen.errors import Refused
from qlinkgen.link import MasterEngine, Refusal, SlaveEngine
from qlinkgen.transport import PtyPort, open_pty
from qlinkgen.transport.blocking import BlockingMaster
from qlinkgen.transport.conversation import timing_of
from qlinkgen.transport.serving import serve
from tests.library.protocols import described

pymodbus = pytest.importorskip("pymodbus", reason="needs pymodbus (pip install pymodbus)")

NODE = 17
REGISTERS = [each * 3 for each in range(100)]
COILS = [each % 3 == 0 or each % 7 == 0 for each in range(2400)]


@pytest.fixture(params=["rtu", "ascii"])
def framing(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def codec(framing: str) -> Any:
    return described(f"modbus_{framing}").module


@pytest.fixture
def pty() -> Iterator[PtyPort]:
    with open_pty() as port:
        yield port


@pytest.fixture
def server(pty: PtyPort, framing: str) -> Iterator[None]:
    """The server of pymodbus at the other end."""
    from pymodbus.framer import FramerType
    from pymodbus.server import ModbusSerialServer
    from pymodbus.simulator import DataType, SimData, SimDevice

    ready, loop = threading.Event(), asyncio.new_event_loop()
    registers = SimData(0, values=list(REGISTERS), datatype=DataType.REGISTERS)
    coils = SimData(0, values=list(COILS), datatype=DataType.BITS)
    inputs = SimData(0, values=COILS[::-1], datatype=DataType.BITS)

    async def main() -> None:
        device = SimDevice(NODE, simdata=([coils], [inputs], [registers], [registers]))
        framer = FramerType[framing.upper()]
        made = ModbusSerialServer(context=device, framer=framer, port=pty.path, baudrate=115200)
        stop = asyncio.Event()
        loop.stop_it = stop.set  # type: ignore[attr-defined]
        await made.listen()
        ready.set()
        await stop.wait()
        await made.shutdown()  # type: ignore[no-untyped-call]

    thread = threading.Thread(target=lambda: loop.run_until_complete(main()))
    thread.start()
    assert ready.wait(10)
    yield
    loop.call_soon_threadsafe(loop.stop_it)  # type: ignore[attr-defined]
    thread.join(10)
    loop.close()


@pytest.fixture
def master(pty: PtyPort, server: None, codec: Any) -> BlockingMaster:
    return BlockingMaster(MasterEngine(codec, timing_of(codec, pty, slack=5.0)), pty)


def test_our_master_reads_and_writes(master: BlockingMaster, codec: Any) -> None:
    ask: Callable[[Any], Any] = lambda request: master.transact(request).response  # noqa: E731
    read = codec.ReadHoldingRegistersRequest(node=NODE, start=10, quantity=90)
    assert ask(read).registers == REGISTERS[10:]
    write = codec.WriteMultipleRegistersRequest(node=NODE, start=20, registers=[7, 8, 9])
    assert ask(write).quantity == 3
    assert ask(codec.WriteSingleRegisterRequest(node=NODE, number=11, value=0xFFFF)).value == 0xFFFF
    assert ask(read).registers[:14] == [30, 0xFFFF, *REGISTERS[12:20], 7, 8, 9, REGISTERS[23]]
    both = codec.ReadWriteMultipleRegistersRequest(
        node=NODE, read_start=0, read_quantity=3, write_start=1, registers=[1]
    )
    assert ask(both).registers == [0, 1, REGISTERS[2]]
    assert master.engine.total.requests == master.engine.total.answers == 5


@pytest.mark.parametrize("number", [1, 8, 37, 2000])
def test_our_master_reads_coils_and_inputs(master: BlockingMaster, codec: Any, number: int) -> None:
    coils = master.transact(codec.ReadCoilsRequest(node=NODE, start=0x13, quantity=number)).response
    assert coils.coils == COILS[0x13 : 0x13 + number]
    inputs = master.transact(codec.ReadDiscreteInputsRequest(node=NODE, start=5, quantity=number)).response
    assert inputs.inputs == COILS[::-1][5 : 5 + number]


def test_an_exception_ends_a_call_at_once_with_its_code(master: BlockingMaster, codec: Any) -> None:
    begun = time.monotonic()
    with pytest.raises(Refused) as caught:
        master.transact(codec.ReadHoldingRegistersRequest(node=NODE, start=99, quantity=2))
    assert time.monotonic() - begun < 3, "without the exception it takes six seconds, and as long again"
    reply: Any = caught.value.reply
    assert reply.code == codec.ExceptionCode.ILLEGAL_DATA_ADDRESS
    assert master.engine.total.requests == 1


class Registers:
    """A node with a hundred registers."""

    def __init__(self, codec: Any) -> None:
        self.number = NODE
        self.values = list(REGISTERS)
        self._codec = codec

    def handle(self, request: Any, now: float) -> Any:
        codec = self._codec
        match request:
            case codec.ReadHoldingRegistersRequest(start=start, quantity=quantity):
                if start + quantity > len(self.values):
                    code = codec.ExceptionCode.ILLEGAL_DATA_ADDRESS
                    raise Refusal(codec.ReadHoldingRegistersException(node=NODE, code=code))
                return codec.ReadHoldingRegistersResponse(
                    node=NODE, registers=self.values[start : start + quantity]
                )
            case codec.ReadCoilsRequest(start=start, quantity=quantity):
                return codec.ReadCoilsResponse(node=NODE, coils=COILS[start : start + quantity])
            case codec.ReadDiscreteInputsRequest(start=start, quantity=quantity):
                return codec.ReadDiscreteInputsResponse(node=NODE, inputs=COILS[start : start + quantity])
            case codec.WriteSingleRegisterRequest(number=number, value=value):
                self.values[number] = value
                return codec.WriteSingleRegisterResponse(node=NODE, number=number, value=value)
            case codec.WriteMultipleRegistersRequest(start=start, registers=registers):
                self.values[start : start + len(registers)] = registers
                return codec.WriteMultipleRegistersResponse(node=NODE, start=start, quantity=len(registers))
        return None


@pytest.fixture
def slave(pty: PtyPort, codec: Any) -> Iterator[Registers]:
    node, stopped = Registers(codec), threading.Event()
    engine = SlaveEngine(codec, node)
    thread = threading.Thread(target=serve, args=(pty, engine), kwargs={"stop": stopped.is_set})
    thread.start()
    yield node
    stopped.set()
    thread.join(10)


def test_our_slave_answers_its_client(pty: PtyPort, slave: Registers, framing: str) -> None:
    from pymodbus.client import ModbusSerialClient
    from pymodbus.framer import FramerType
    from pymodbus.pdu import ModbusPDU

    unknown_request = type("Unknown", (ModbusPDU,), {"function_code": 0x41, "encode": lambda _: b""})
    framer = FramerType[framing.upper()]
    client = ModbusSerialClient(pty.path, framer=framer, baudrate=115200, timeout=10, retries=0)
    assert client.connect()
    try:
        found = client.read_holding_registers(10, count=90, device_id=NODE)
        assert found.registers == REGISTERS[10:]
        coils = client.read_coils(0x13, count=37, device_id=NODE)
        assert coils.bits == [*COILS[0x13 : 0x13 + 37], False, False, False]
        inputs = client.read_discrete_inputs(7, count=2000, device_id=NODE)
        assert inputs.bits == COILS[7:2007]
        assert not client.write_register(11, 0xABCD, device_id=NODE).isError()
        assert client.write_registers(20, [7, 8, 9], device_id=NODE).count == 3
        assert slave.values[11] == 0xABCD
        refused = client.read_holding_registers(99, count=2, device_id=NODE)
        assert (refused.isError(), refused.exception_code) == (True, 2)
        unknown = client.execute(False, unknown_request(dev_id=NODE))
        assert (unknown.isError(), unknown.exception_code) == (True, 1)
        assert client.read_holding_registers(20, count=3, device_id=NODE).registers == [7, 8, 9]
    finally:
        client.close()  # type: ignore[no-untyped-call]
