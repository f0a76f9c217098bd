"""Masters of other people talk to our slaves over pseudo-terminals."""

from __future__ import annotations

import contextlib
import io
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from qlinkgen.link import SlaveEngine
from qlinkgen.transport import PtyPort, open_pty
from qlinkgen.transport.serving import serve
from tests.library.protocols import described, peer

#: Seconds, on a busy machine.
PATIENCE = 10

Handle = Callable[[Any], Any]


class Device:
    """A node whose handler is a function of the request."""

    def __init__(self, number: int, handle: Handle) -> None:
        self.number = number
        self._handle = handle

    def handle(self, request: Any, now: float) -> Any:
        return self._handle(request)


@contextlib.contextmanager
def serving(name: str, number: int, handle: Handle, *others: int) -> Iterator[PtyPort]:
    """Serve a device of a protocol on a pseudo-terminal, and others like it."""
    stopped = threading.Event()
    with open_pty() as port:
        codec = described(name).module
        engines = [SlaveEngine(codec, Device(each, handle)) for each in (number, *others)]
        thread = threading.Thread(target=serve, args=(port, *engines), kwargs={"stop": stopped.is_set})
        thread.start()
        try:
            yield port
        finally:
            stopped.set()
            thread.join(10)


def test_dynamixel_sdk_reads_and_writes_a_servo() -> None:
    peer("dynamixel_2")
    from dynamixel_sdk import COMM_SUCCESS, PortHandler, Protocol2PacketHandler

    codec: Any = described("dynamixel_2").module
    table = bytearray(range(200))

    def servo(request: Any) -> Any:
        match request:
            case codec.PingRequest():
                return codec.PingResponse(node=3, model=0x0406, firmware=0x26)
            case codec.ReadRequest(start=start, size=size) if start + size <= len(table):
                return codec.ReadResponse(node=3, data=bytes(table[start : start + size]))
            case codec.ReadRequest():
                return codec.ReadFailed(node=3, error=codec.Error.DATA_RANGE)
            case codec.WriteRequest(start=start, data=written) if start + len(written) <= len(table):
                table[start : start + len(written)] = written
                return codec.WriteResponse(node=3)
            case _:
                return codec.WriteResponse(node=3, error=codec.Error.DATA_RANGE)

    with serving("dynamixel_2", 3, servo) as pty:
        port, packets = PortHandler(pty.path), Protocol2PacketHandler()
        assert port.openPort()
        port.setPacketTimeout = lambda length: port.setPacketTimeoutMillis(1000 * PATIENCE)
        try:
            assert packets.ping(port, 3) == (0x0406, COMM_SUCCESS, 0)
            assert packets.read4ByteTxRx(port, 3, 132) == (0x87868584, COMM_SUCCESS, 0)
            assert packets.write2ByteTxRx(port, 3, 10, 0x1234) == (COMM_SUCCESS, 0)
            assert table[10:12] == bytes((0x34, 0x12))
            assert packets.read1ByteTxRx(port, 3, 250)[1:] == (COMM_SUCCESS, codec.Error.DATA_RANGE)
            assert packets.write2ByteTxRx(port, 3, 199, 1) == (COMM_SUCCESS, codec.Error.DATA_RANGE)
        finally:
            port.closePort()


def test_dynamixel_sdk_reads_and_writes_an_older_servo() -> None:
    peer("dynamixel_1")
    from dynamixel_sdk import COMM_SUCCESS, PortHandler, Protocol1PacketHandler

    codec: Any = described("dynamixel_1").module
    table = bytearray(range(50))

    def servo(request: Any) -> Any:
        match request:
            case codec.PingRequest():
                return codec.PingResponse(node=3)
            case codec.ReadRequest(start=start, size=size) if start + size <= len(table):
                return codec.ReadResponse(node=3, data=bytes(table[start : start + size]))
            case codec.WriteRequest(start=start, data=data):
                table[start : start + len(data)] = data
                return codec.WriteResponse(node=3)
        return codec.Range(node=3)

    with serving("dynamixel_1", 3, servo) as pty:
        port, packets = PortHandler(pty.path), Protocol1PacketHandler()
        assert port.openPort()
        port.setPacketTimeout = lambda _: port.setPacketTimeoutMillis(1000 * PATIENCE)
        try:
            assert packets.ping(port, 3) == (0x0100, COMM_SUCCESS, 0)
            assert packets.write2ByteTxRx(port, 3, 30, 0x1234) == (COMM_SUCCESS, 0)
            assert packets.read2ByteTxRx(port, 3, 30) == (0x1234, COMM_SUCCESS, 0)
            assert packets.read1ByteTxRx(port, 3, 200)[1:] == (COMM_SUCCESS, 8)
        finally:
            port.closePort()


def test_dynamixel_sdk_reads_several_servos_at_once() -> None:
    peer("dynamixel_2")
    from dynamixel_sdk import COMM_SUCCESS, GroupSyncRead, PortHandler, Protocol2PacketHandler

    codec: Any = described("dynamixel_2").module
    numbers = iter((7, 3))  # in the order of the request

    def servo(request: Any) -> Any:
        number = next(numbers)
        return codec.SyncReadResponse(node=number, data=bytes((number, 1)))

    with serving("dynamixel_2", 7, servo, 3) as pty:
        port = PortHandler(pty.path)
        assert port.openPort()
        group = GroupSyncRead(port, Protocol2PacketHandler(), 132, 2)
        port.setPacketTimeout = lambda _: port.setPacketTimeoutMillis(1000 * PATIENCE)
        try:
            assert [group.addParam(number) for number in (7, 3)] == [True, True]
            assert group.txRxPacket() == COMM_SUCCESS
            assert [group.getData(number, 132, 2) for number in (3, 7)] == [0x0103, 0x0107]
        finally:
            port.closePort()


def test_pyptzcontroller_asks_for_the_position() -> None:
    peer("pelco_d")
    from ptz_control_lib.ptz_controller import PtzControl

    codec: Any = described("pelco_d").module
    seen = []

    def camera(request: Any) -> Any:
        seen.append(type(request).NAME)
        match request:
            case codec.QueryPanRequest():
                return codec.QueryPanResponse(node=5, angle=123.45)
            case codec.QueryTiltRequest():
                return codec.QueryTiltResponse(node=5, angle=17.5)
        return None

    with serving("pelco_d", 5, camera) as pty, contextlib.redirect_stdout(io.StringIO()):
        controller = PtzControl(pty.path, 5, 9600)
        assert controller.connect()
        controller.serial_port.timeout = PATIENCE
        try:
            controller.move("left", 20)
            controller.go_to_preset(7)
            assert controller.get_position() == (123.45, -17.5)
        finally:
            controller.disconnect()
    assert seen == ["left.request", "go_to_preset.request", "query_pan.request", "query_tilt.request"]


def test_yamspy_reads_a_flight_controller() -> None:
    peer("msp")
    from yamspy import MSPy

    codec: Any = described("msp").module

    def board(request: Any) -> Any:
        match request:
            case codec.AttitudeRequest():
                return codec.AttitudeResponse(roll=-12.5, pitch=3.0, yaw=271)
            case codec.SetMotorsRequest(motors=motors):
                outputs.extend(motors)
                return codec.SetMotorsResponse()
            case codec.SaveRequest():
                return codec.SaveUnsupported()
        return None

    outputs: list[int] = []
    with serving("msp", 0, board) as pty:
        master = MSPy(pty.path, loglevel="CRITICAL", logfilename=None)
        master.INAV = False
        master.conn.timeout = PATIENCE
        master.conn.open()
        try:
            assert master.send_RAW_msg(MSPy.MSPCodes["MSP_ATTITUDE"]) > 0
            assert master.process_recv_data(master.receive_msg()) == 0
            assert master.SENSOR_DATA["kinematics"] == [-12.5, 3.0, 271]
            master.send_RAW_MOTORS([*range(1000, 1800, 100)])
            assert master.receive_msg()["code"] == MSPy.MSPCodes["MSP_SET_MOTOR"]
            master.send_RAW_msg(MSPy.MSPCodes["MSP_EEPROM_WRITE"])
            assert master.receive_msg()["unsupported"]
        finally:
            master.conn.close()
    assert outputs == [*range(1000, 1800, 100)]


def test_sensirion_driver_reads_a_sensor() -> None:
    peer("shdlc")
    from sensirion_shdlc_driver import ShdlcConnection, ShdlcDevice, ShdlcSerialPort
    from sensirion_shdlc_driver.errors import ShdlcDeviceError

    codec: Any = described("shdlc").module

    def sensor(request: Any) -> Any:
        match request:
            case codec.InformationRequest(kind=3):
                return codec.InformationResponse(node=0, error=0, device=False, text="0123456789ABCDEF\0")
            case codec.ResetRequest():
                return codec.ResetResponse(node=0, error=67, device=False)
        return None

    with serving("shdlc", 0, sensor) as pty, ShdlcSerialPort(pty.path, 115200, PATIENCE) as port:
        device = ShdlcDevice(ShdlcConnection(port), 0)
        assert device.get_serial_number() == "0123456789ABCDEF"
        with pytest.raises(ShdlcDeviceError):
            device.device_reset()


def test_pyvesc_drives_a_motor() -> None:
    peer("vesc")
    import pyvesc
    import serial
    from pyvesc.packet.codec import unframe

    codec: Any = described("vesc").module
    values = codec.GetValuesResponse(fet=31.5, motor=40.0, speed=-1200, voltage=48.1, fault=3)
    seen = []

    def motor(request: Any) -> Any:
        seen.append(request)
        return values if type(request) is codec.GetValuesRequest else None

    def measured(line: serial.Serial) -> Any:
        """Ask until the whole answer is there; what was sent before it has been received then."""
        line.write(pyvesc.encode_request(pyvesc.GetValues))
        answer, payload = b"", None
        while payload is None:
            received = line.read(1)
            assert received, "no answer"
            answer += received
            payload, _ = unframe(answer)
        return payload

    with serving("vesc", 0, motor) as pty, serial.Serial(pty.path, timeout=PATIENCE) as line:
        for message in (pyvesc.SetDutyCycle(25_000), pyvesc.SetRPM(-1200), pyvesc.SetCurrent(1500)):
            line.write(pyvesc.encode(message))
            # Its fields are those of an older firmware, so it cannot name them.
            assert measured(line) == bytes((codec.GetValuesRequest.ID,)) + values.to_bytes()
    asked = codec.GetValuesRequest()
    assert seen == [
        codec.SetDutyRequest(duty=0.25), asked, codec.SetSpeedRequest(speed=-1200), asked,
        codec.SetCurrentRequest(current=1.5), asked,
    ]  # fmt: skip
