"""Modbus over pseudo-terminals: our bus with pymodbus's server, its client with our slave."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest

from qlinkgen.errors import Refused
from qlinkgen.link import Refusal
from qlinkgen.transport import PtyPort, open_pty
from tests.bus.wires import bus_of, codec_of

pymodbus = pytest.importorskip("pymodbus", reason="needs pymodbus (pip install pymodbus)")

NODE = 17
REGISTERS = [each * 3 for each in range(100)]
COILS = [each % 3 == 0 or each % 7 == 0 for each in range(2400)]


@pytest.fixture(params=["rtu", "ascii"])
def framing(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def codec(framing: str) -> Any:
    return codec_of(f"modbus_{framing}")


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
def node(pty: PtyPort, server: None, framing: str) -> Any:
    return bus_of(f"modbus_{framing}").Bus(pty, slack=5.0, echo="none").node(NODE)


def test_our_bus_reads_and_writes(node: Any) -> None:
    assert node.read_holding_registers(start=10, quantity=90).registers == REGISTERS[10:]
    assert node.write_multiple_registers(start=20, registers=[7, 8, 9]).quantity == 3
    assert node.write_single_register(number=11, value=0xFFFF).value == 0xFFFF
    read = node.read_holding_registers(start=10, quantity=90).registers
    assert read[:14] == [30, 0xFFFF, *REGISTERS[12:20], 7, 8, 9, REGISTERS[23]]
    both = node.read_write_multiple_registers(read_start=0, read_quantity=3, write_start=1, registers=[1])
    assert both.registers == [0, 1, REGISTERS[2]]
    assert node.bus.engine.total.requests == node.bus.engine.total.answers == 5


def test_our_bus_for_asyncio_reads(pty: PtyPort, server: None, framing: str) -> None:
    async def run() -> list[Any]:
        node = bus_of(f"modbus_{framing}").AsyncBus(pty, slack=5.0, echo="none").node(NODE)
        asked = [node.read_holding_registers(start=start, quantity=2) for start in (3, 30)]
        return [answer.registers for answer in await asyncio.gather(*asked)]

    assert asyncio.run(run()) == [REGISTERS[3:5], REGISTERS[30:32]]


@pytest.mark.parametrize("number", [1, 8, 37, 2000])
def test_our_bus_reads_coils_and_inputs(node: Any, number: int) -> None:
    assert node.read_coils(start=0x13, quantity=number).coils == COILS[0x13 : 0x13 + number]
    inputs = node.read_discrete_inputs(start=5, quantity=number).inputs
    assert inputs == COILS[::-1][5 : 5 + number]


def test_an_exception_ends_a_call_at_once_with_its_code(node: Any, codec: Any) -> None:
    begun = time.monotonic()
    with pytest.raises(Refused) as caught:
        node.read_holding_registers(start=99, quantity=2)
    assert time.monotonic() - begun < 3, "without the exception it takes six seconds, and as long again"
    reply: Any = caught.value.reply
    assert reply.code == codec.ExceptionCode.ILLEGAL_DATA_ADDRESS
    assert node.bus.engine.total.requests == 1


def registers(framing: str) -> Any:
    """A slave with a hundred registers."""
    codec: Any = codec_of(f"modbus_{framing}")
    handlers: Any = bus_of(f"modbus_{framing}").SlaveHandlers

    class Registers(handlers):  # type: ignore[misc]  # Any: generated at run time
        def __init__(self) -> None:
            super().__init__(NODE)
            self.values = list(REGISTERS)

        def read_holding_registers(self, request: Any, now: float) -> Any:
            if request.start + request.quantity > len(self.values):
                code = codec.ExceptionCode.ILLEGAL_DATA_ADDRESS
                raise Refusal(codec.ReadHoldingRegistersException(node=NODE, code=code))
            read = self.values[request.start : request.start + request.quantity]
            return codec.ReadHoldingRegistersResponse(node=NODE, registers=read)

        def read_coils(self, request: Any, now: float) -> Any:
            read = COILS[request.start : request.start + request.quantity]
            return codec.ReadCoilsResponse(node=NODE, coils=read)

        def read_discrete_inputs(self, request: Any, now: float) -> Any:
            read = COILS[request.start : request.start + request.quantity]
            return codec.ReadDiscreteInputsResponse(node=NODE, inputs=read)

        def write_single_register(self, request: Any, now: float) -> Any:
            self.values[request.number] = request.value
            return codec.WriteSingleRegisterResponse(node=NODE)

        def write_multiple_registers(self, request: Any, now: float) -> Any:
            self.values[request.start : request.start + len(request.registers)] = request.registers
            return codec.WriteMultipleRegistersResponse(node=NODE, quantity=len(request.registers))

    return Registers()


@pytest.fixture
def slave(pty: PtyPort, framing: str) -> Iterator[Any]:
    made = registers(framing)
    with bus_of(f"modbus_{framing}").Slave(pty, made).running():
        yield made


def test_our_slave_answers_its_client(pty: PtyPort, slave: Any, framing: str) -> None:
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
