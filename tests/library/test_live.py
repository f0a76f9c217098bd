"""Masters of other people talk to our slaves over pseudo-terminals."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator
from typing import Any

import pytest

from qlinkgen.transport import PtyPort, open_pty
from tests.bus.wires import bus_of, codec_of
from tests.library.protocols import peer

#: Seconds, on a busy machine.
PATIENCE = 10


@contextlib.contextmanager
def serving(name: str, *devices: Any) -> Iterator[PtyPort]:
    """Serve devices of a protocol on a pseudo-terminal."""
    with open_pty() as port, bus_of(name).Slave(port, *devices).running():
        yield port


def handlers(name: str) -> tuple[Any, Any]:
    """The codec of a protocol, and the class of the handlers of its slaves."""
    return codec_of(name), bus_of(name).SlaveHandlers


def test_dynamixel_sdk_reads_and_writes_a_servo() -> None:
    peer("dynamixel_2")
    from dynamixel_sdk import COMM_SUCCESS, PortHandler, Protocol2PacketHandler

    codec, base = handlers("dynamixel_2")
    table = bytearray(range(200))

    class Servo(base):  # type: ignore[misc,valid-type]  # Any: generated at run time, as below
        def ping(self, request: Any, now: float) -> Any:
            return codec.PingResponse(node=3, model=0x0406, firmware=0x26)

        def read(self, request: Any, now: float) -> Any:
            if request.start + request.size > len(table):
                return codec.ReadFailed(node=3, error=codec.Error.DATA_RANGE)
            return codec.ReadResponse(node=3, data=bytes(table[request.start : request.start + request.size]))

        def write(self, request: Any, now: float) -> Any:
            if request.start + len(request.data) > len(table):
                return codec.WriteResponse(node=3, error=codec.Error.DATA_RANGE)
            table[request.start : request.start + len(request.data)] = request.data
            return codec.WriteResponse(node=3)

    with serving("dynamixel_2", Servo(3)) as pty:
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

    codec, base = handlers("dynamixel_1")
    table = bytearray(range(50))

    class Servo(base):  # type: ignore[misc,valid-type]
        def ping(self, request: Any, now: float) -> Any:
            return codec.PingResponse(node=3)

        def read(self, request: Any, now: float) -> Any:
            if request.start + request.size > len(table):
                return codec.Range(node=3)
            return codec.ReadResponse(node=3, data=bytes(table[request.start : request.start + request.size]))

        def write(self, request: Any, now: float) -> Any:
            table[request.start : request.start + len(request.data)] = request.data
            return codec.WriteResponse(node=3)

    with serving("dynamixel_1", Servo(3)) as pty:
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

    codec, base = handlers("dynamixel_2")

    class Servo(base):  # type: ignore[misc,valid-type]
        def sync_read(self, request: Any, now: float) -> Any:
            return codec.SyncReadResponse(node=self.number, data=bytes((self.number, 1)))

    with serving("dynamixel_2", Servo(7), Servo(3)) as pty:
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

    codec, base = handlers("pelco_d")
    seen = []

    class Camera(base):  # type: ignore[misc,valid-type]
        def handle(self, request: Any, now: float) -> Any:
            seen.append(type(request).NAME)
            return super().handle(request, now)

        def query_pan(self, request: Any, now: float) -> Any:
            return codec.QueryPanResponse(node=5, angle=123.45)

        def query_tilt(self, request: Any, now: float) -> Any:
            return codec.QueryTiltResponse(node=5, angle=17.5)

    with serving("pelco_d", Camera(5)) as pty, contextlib.redirect_stdout(io.StringIO()):
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

    codec, base = handlers("msp")
    outputs: list[int] = []

    class Board(base):  # type: ignore[misc,valid-type]
        def attitude(self, request: Any, now: float) -> Any:
            return codec.AttitudeResponse(roll=-12.5, pitch=3.0, yaw=271)

        def set_motors(self, request: Any, now: float) -> Any:
            outputs.extend(request.motors)
            return codec.SetMotorsResponse()

        def save(self, request: Any, now: float) -> Any:
            return codec.SaveUnsupported()

    with serving("msp", Board(0)) as pty:
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

    codec, base = handlers("shdlc")

    class Sensor(base):  # type: ignore[misc,valid-type]
        def information(self, request: Any, now: float) -> Any:
            assert request.kind == 3
            return codec.InformationResponse(node=0, error=0, device=False, text="0123456789ABCDEF\0")

        def reset(self, request: Any, now: float) -> Any:
            return codec.ResetResponse(node=0, error=67, device=False)

    with serving("shdlc", Sensor(0)) as pty, ShdlcSerialPort(pty.path, 115200, PATIENCE) as port:
        device = ShdlcDevice(ShdlcConnection(port), 0)
        assert device.get_serial_number() == "0123456789ABCDEF"
        with pytest.raises(ShdlcDeviceError):
            device.device_reset()


def test_pyvesc_drives_a_motor() -> None:
    peer("vesc")
    import pyvesc
    import serial
    from pyvesc.packet.codec import unframe

    codec, base = handlers("vesc")
    values = codec.GetValuesResponse(fet=31.5, motor=40.0, speed=-1200, voltage=48.1, fault=3)
    seen = []

    class Motor(base):  # type: ignore[misc,valid-type]
        def handle(self, request: Any, now: float) -> Any:
            seen.append(request)
            return super().handle(request, now)

        def get_values(self, request: Any, now: float) -> Any:
            return values

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

    with serving("vesc", Motor(0)) as pty, serial.Serial(pty.path, timeout=PATIENCE) as line:
        for message in (pyvesc.SetDutyCycle(25_000), pyvesc.SetRPM(-1200), pyvesc.SetCurrent(1500)):
            line.write(pyvesc.encode(message))
            # Its fields are those of an older firmware, so it cannot name them.
            assert measured(line) == bytes((codec.GetValuesRequest.ID,)) + values.to_bytes()
    asked = codec.GetValuesRequest()
    assert seen == [
        codec.SetDutyRequest(duty=0.25), asked, codec.SetSpeedRequest(speed=-1200), asked,
        codec.SetCurrentRequest(current=1.5), asked,
    ]  # fmt: skip
