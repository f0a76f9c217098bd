"""Local ports: real ptys, and a simulated driver for abilities that ptys lack."""

from __future__ import annotations

import fcntl
import os
import re
import resource
import subprocess
import sys
import termios
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from qlinkgen.errors import CapabilityMissing, PortBusy, PortError, PortLost, PortMissing
from qlinkgen.transport import Ability, PtyPort, RS485Settings, SerialPort, failures, open_port, open_pty
from qlinkgen.transport.stream import DescriptorChannel
from tests.transport.conftest import (
    GET_RS485,
    GET_SERIAL,
    GET_TERMIOS2,
    LOW_LATENCY,
    PATIENCE,
    SET_RS485,
    SET_SERIAL,
    Disguise,
    Driver,
    descriptors,
)


def test_reads_what_is_there(pty: PtyPort) -> None:
    with SerialPort(pty.path) as port:
        assert port.read(0) == b""
        assert port.read(-1) == b""
        pty.write(b"answer")
        assert port.read(PATIENCE) == b"answer"
        before = port.now()
        assert port.read(0.0123) == b""
        assert port.now() - before >= 0.0123


def test_raw_settings(pty: PtyPort) -> None:
    descriptor = os.open(pty.path, os.O_RDWR | os.O_NOCTTY)
    state = termios.tcgetattr(descriptor)
    state[0] |= termios.BRKINT | termios.ICRNL | termios.IXON
    state[3] |= termios.ECHO | termios.ICANON
    termios.tcsetattr(descriptor, termios.TCSANOW, state)
    os.close(descriptor)
    with SerialPort(pty.path, 9600) as port:
        number = port.fileno()
        assert number is not None
        flags_in, flags_out, _, local, speed_in, speed_out, characters = termios.tcgetattr(number)
        assert not flags_in & (termios.BRKINT | termios.ICRNL | termios.IXON | termios.IXOFF)
        assert not flags_out & termios.OPOST
        assert not local & (termios.ECHO | termios.ICANON | termios.ISIG)
        assert speed_in == speed_out == termios.B9600
        assert characters[termios.VMIN] == 1
        assert not os.get_blocking(number)


@pytest.mark.parametrize(
    ("parity", "stop_bits", "flags"),
    [
        ("none", 1, 0),
        ("even", 1, termios.PARENB),
        ("odd", 2, termios.PARENB | termios.PARODD | termios.CSTOPB),
    ],
)
def test_parity_and_stop_bits(
    pty: PtyPort, monkeypatch: pytest.MonkeyPatch, parity: str, stop_bits: int, flags: int
) -> None:
    # The requested settings: a pty does not keep the parity.
    asked: list[int] = []
    to_kernel = termios.tcsetattr

    def record(descriptor: int, when: int, state: list[Any]) -> None:
        asked.append(state[2])
        to_kernel(descriptor, when, state)

    monkeypatch.setattr(termios, "tcsetattr", record)
    options: dict[str, Any] = {"parity": parity, "stop_bits": stop_bits}
    with open_port(pty.path, **options):
        every = termios.PARENB | termios.PARODD | termios.CSTOPB | termios.CRTSCTS
        assert asked[0] & every == flags
        assert asked[0] & termios.CSIZE == termios.CS8


def test_a_baud_rate_without_a_name(pty: PtyPort) -> None:
    with SerialPort(pty.path, 250_000) as port:
        assert port.baud == 250_000


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ({"baud": 0}, "baud: 0 was given"),
        ({"baud": "fast"}, "baud: 'fast' was given"),
        ({"baud": 10**9}, "baud: 1000000000 was given"),
        ({"parity": "mark"}, "parity: 'mark' was given; it is one of none, even, odd"),
        ({"stop_bits": 3}, "stop_bits: 3 was given; it is 1 or 2"),
        ({"rs485": True, "direction": print}, "rs485 and direction"),
        ({"name": " "}, "name: ' ' was given; give a device"),
        ({"name": None}, "name: None was given"),
    ],
)
def test_wrong_arguments(pty: PtyPort, arguments: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ValueError, match=re.escape(complaint)):
        open_port(**{"name": pty.path, **arguments})


def test_missing() -> None:
    with pytest.raises(
        PortMissing, match=r"port '/dev/ttyNONE0' does not exist; (available ports|no serial port)"
    ) as e:
        open_port("/dev/ttyNONE0")
    assert e.value.port == "/dev/ttyNONE0"
    assert isinstance(e.value, FileNotFoundError)


def test_the_ports_that_there_are(monkeypatch: pytest.MonkeyPatch) -> None:
    from serial.tools import list_ports
    from serial.tools.list_ports_common import ListPortInfo

    adapter = ListPortInfo("/dev/ttyUSB0")
    adapter.description = "FT232R USB UART"
    monkeypatch.setattr(list_ports, "comports", lambda: [adapter, ListPortInfo("/dev/ttyS0")])
    with pytest.raises(
        PortMissing, match=r"; available ports: /dev/ttyS0, /dev/ttyUSB0 \(FT232R USB UART\)$"
    ):
        open_port("/dev/ttyUSB1")
    monkeypatch.setattr(list_ports, "comports", list)
    with pytest.raises(PortMissing, match="no serial ports found: connect the adapter"):
        open_port("/dev/ttyUSB1")


def test_a_link_that_leads_nowhere(tmp_path: Path) -> None:
    link = tmp_path / "by-id"
    link.symlink_to("ttyUSB9")
    with pytest.raises(PortMissing, match=r"by-id is a link to ttyUSB9, which does not exist"):
        open_port(str(link))


@pytest.mark.parametrize("name", ["/dev/null", "/tmp", __file__])
def test_no_serial_port(name: str) -> None:
    with pytest.raises(PortError, match="is not a serial port") as caught:
        open_port(name)
    assert type(caught.value) is PortError


def test_a_device_file_without_hardware(pty: PtyPort, monkeypatch: pytest.MonkeyPatch) -> None:
    # As most of /dev/ttyS* are; not every machine has such a one.
    def fail(*arguments: object) -> None:
        raise termios.error(5, "Input/output error")

    monkeypatch.setattr(termios, "tcgetattr", fail)
    before = descriptors()
    with pytest.raises(PortMissing, match=f"{pty.path} has no hardware"):
        open_port(pty.path)
    assert descriptors() == before


def test_opened_twice(pty: PtyPort) -> None:
    with SerialPort(pty.path) as port:
        assert port.capabilities.exclusive is Ability.YES
        with pytest.raises(PortBusy, match=rf"in use by .* \(process {os.getpid()}\); end it"):
            open_port(pty.path)
        port.write(b"still works")
        assert pty.read(PATIENCE) == b"still works"
    with SerialPort(pty.path):
        pass


def test_busy_for_the_driver(pty: PtyPort, monkeypatch: pytest.MonkeyPatch) -> None:
    # What a port says to others once a program has set TIOCEXCL, unless they are root.
    def refuse(path: str, *arguments: object) -> int:
        raise OSError(16, "Device or resource busy", path)

    monkeypatch.setattr(os, "open", refuse)
    # Without a lock, the process is found by its descriptor: here the one of our own end of the pty.
    with pytest.raises(PortBusy, match=rf"\(process {os.getpid()}\)"):
        open_port(pty.path)


#: Opens a port as any program does that locks it, says so, and waits for the end of its input.
HOLDER = """\
import fcntl, os, sys
descriptor = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
fcntl.flock(descriptor, fcntl.LOCK_EX)
print("locked", flush=True)
sys.stdin.read()
"""


def test_locked_by_another_program(pty: PtyPort) -> None:
    # This process has the pty open too, at its other end, but the lock decides.
    command = [sys.executable, "-c", HOLDER, pty.path]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "locked\n"
        with pytest.raises(PortBusy, match=rf"in use by \S+ \(process {holder.pid}\); end it"):
            open_port(pty.path)
        holder.communicate(timeout=PATIENCE)
    open_port(pty.path).close()


def test_a_lock_from_another_container(pty: PtyPort, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    state = Path(pty.path).stat()
    device = f"{os.major(state.st_dev):02x}:{os.minor(state.st_dev):02x}"
    rows = ["1: FLOCK  ADVISORY  WRITE", "", f"2: FLOCK ADVISORY WRITE 1 {device}:{state.st_ino + 1} 0 EOF"]
    rows.append(f"3: FLOCK  ADVISORY  WRITE -1 {device}:{state.st_ino} 0 EOF")
    (tmp_path / "locks").write_text("\n".join(rows))
    monkeypatch.setattr(failures, "PROC", tmp_path)
    assert failures.holders(pty.path) == []
    rows.append(f"4: FLOCK  ADVISORY  WRITE 812 {device}:{state.st_ino} 0 EOF")
    (tmp_path / "locks").write_text("\n".join(rows))
    assert failures.holders(pty.path) == ["a program (process 812)"]


def test_busy_by_someone_who_cannot_be_seen(
    pty: PtyPort, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(failures, "PROC", tmp_path)
    with (
        SerialPort(pty.path),
        pytest.raises(PortBusy, match=f"another program; find it with `sudo fuser -v {pty.path}`"),
    ):
        open_port(pty.path)


@pytest.fixture
def as_nobody() -> Iterator[None]:
    """Without root privileges."""
    if os.geteuid() != 0:
        yield
        return
    os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(0)


@pytest.mark.parametrize(
    ("mode", "fix"), [(0o000, 'a udev rule with GROUP="dialout"'), (0o060, r"sudo usermod -aG \w+ \$USER")]
)
def test_forbidden(pty: PtyPort, mode: int, fix: str, request: pytest.FixtureRequest) -> None:
    if os.geteuid() == 0:
        os.chown(pty.path, 0, 20)
    os.chmod(pty.path, mode)  # noqa: PTH101
    request.getfixturevalue("as_nobody")
    with pytest.raises(PortBusy, match=rf"no permission to open {pty.path} \(c.*, group \w+\); .*{fix}"):
        open_port(pty.path)


@pytest.mark.parametrize("symlink", [False, True])
def test_unplugged(tmp_path: Path, symlink: bool) -> None:
    pty = open_pty(tmp_path / "bus")
    port = SerialPort(str(pty.link) if symlink else pty.path)
    pty.close()
    with pytest.raises(PortLost, match=r"was lost .*unplugged, or its other side closed") as caught:
        port.read(PATIENCE)
    assert caught.value.port == port.name
    assert isinstance(caught.value, ConnectionError)
    for use in (lambda: port.read(0), lambda: port.write(b"x")):
        with pytest.raises(PortLost, match="was lost"):
            use()
    assert port.fileno() is None
    port.close()
    with pytest.raises(PortLost, match="was closed here"):
        port.read(0)


def test_unplugged_while_writing(pty: PtyPort) -> None:
    with SerialPort(pty.path) as port:
        pty.close()
        with pytest.raises(PortLost, match="Input/output error"):
            port.write(b"x")


@pytest.mark.parametrize("number", [5, 6, 9, 19])
def test_errors_of_drivers(pty: PtyPort, number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*arguments: object) -> bytes:
        raise OSError(number, os.strerror(number))

    with SerialPort(pty.path) as port:
        pty.write(b"x")
        monkeypatch.setattr(os, "read", fail)
        with pytest.raises(PortLost, match=os.strerror(number)):
            port.read(PATIENCE)


def test_another_reader_was_quicker(pty: PtyPort, monkeypatch: pytest.MonkeyPatch) -> None:
    read, calls = os.read, []

    def late(descriptor: int, size: int) -> bytes:
        calls.append(size)
        if len(calls) == 1:
            raise BlockingIOError
        return read(descriptor, size)

    with SerialPort(pty.path) as port:
        pty.write(b"x")
        monkeypatch.setattr(os, "read", late)
        assert port.read(PATIENCE) == b"x"
        calls.clear()
        pty.write(b"y")
        assert port.read(0) == b""


def test_closed_here(pty: PtyPort) -> None:
    before = descriptors()
    port = SerialPort(pty.path)
    assert port.fileno() is not None
    port.close()
    port.close()
    assert descriptors() == before
    assert port.fileno() is None
    for use in (lambda: port.read(0), lambda: port.write(b"")):
        with pytest.raises(PortLost, match=f"{pty.path} was closed here; open it again"):
            use()


def test_long_write_to_a_slow_reader(pty: PtyPort) -> None:
    data = os.urandom(100_000)
    with SerialPort(pty.path) as port:
        writer = threading.Thread(target=port.write, args=[data])
        writer.start()
        got = b""
        while len(got) < len(data):
            piece = pty.read(PATIENCE)
            assert piece
            got += piece
        writer.join(PATIENCE)
    assert got == data


def test_a_port_that_takes_nothing(pty: PtyPort) -> None:
    with SerialPort(pty.path) as port:
        number = port.fileno()
        assert number is not None
        channel = DescriptorChannel(number, stall=0.01)
        with pytest.raises(OSError, match=r"no byte accepted for 0\.0 s, \d+ bytes unsent"):
            channel.write(bytes(100_000))
        channel.close()


def test_descriptors_beyond_those_of_select(pty: PtyPort) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, min(hard, 2048)), hard))
    with SerialPort(pty.path) as port:
        number = port.fileno()
        assert number is not None
        high = fcntl.fcntl(number, fcntl.F_DUPFD, 1100)
        try:
            channel = DescriptorChannel(high, stall=PATIENCE)
            assert channel.read(0) == b""
            assert channel.read(0.001) == b""
            pty.write(b"high")
            assert channel.read(PATIENCE) == b"high"
            channel.write(b"up")
            assert pty.read(PATIENCE) == b"up"
            channel.close()
        finally:
            os.close(high)
            resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def test_capabilities_of_a_pty(pty: PtyPort) -> None:
    with open_port(pty.path) as port:
        found = port.capabilities
    assert (found.driver, found.latency, found.paced, found.rs485) == ("pty", 0.0, Ability.NO, Ability.NO)
    assert found.low_latency is Ability.YES


def test_low_latency_brings_the_timer_down(pty: PtyPort, driver: Driver, disguise: Disguise) -> None:
    device = disguise(pty.path, "ftdi_sio", "16\n")
    driver.register(GET_SERIAL, SET_SERIAL, [0] * 32)

    def store(number: int, words: list[int]) -> None:
        if words[4] & LOW_LATENCY:
            (device / "latency_timer").write_text("1\n")

    driver.on_store = store
    with open_port(pty.path, low_latency=False) as port:
        assert port.capabilities.latency == 0.016
        assert port.capabilities.low_latency is Ability.NO
    with open_port(pty.path) as port:
        found = port.capabilities
    assert found.latency == 0.001
    assert found.low_latency is Ability.YES
    assert found.paced is Ability.YES
    assert found.driver == "ftdi_sio"
    assert found.latency_source == "latency_timer of ftdi_sio (/sys/class/tty/ttyUSB7/device/latency_timer)"


def test_low_latency_refused(pty: PtyPort, disguise: Disguise) -> None:
    disguise(pty.path, "cp210x")
    with open_port(pty.path) as port:
        found = port.capabilities
    assert found.low_latency is Ability.UNKNOWN
    assert found.latency is None
    assert found.latency_source == "the driver cp210x does not report it"


def test_a_timer_that_was_low_before(pty: PtyPort, disguise: Disguise) -> None:
    disguise(pty.path, "ftdi_sio", "1\n")
    with open_port(pty.path, low_latency=False) as port:
        assert port.capabilities.low_latency is Ability.YES


def test_low_latency_without_a_timer(pty: PtyPort, driver: Driver, disguise: Disguise) -> None:
    disguise(pty.path, "serial8250")
    driver.register(GET_SERIAL, SET_SERIAL, [0] * 32)
    with open_port(pty.path) as port:
        assert port.capabilities.low_latency is Ability.YES
        assert port.capabilities.latency is None
        assert driver.words[GET_SERIAL][4] == LOW_LATENCY


def test_a_real_port_shuts_others_out(pty: PtyPort, driver: Driver, disguise: Disguise) -> None:
    with open_port(pty.path):
        assert (
            termios.TIOCEXCL not in driver.asked
        )  # it would outlive us: the pty stays open at its other end
    disguise(pty.path, "cp210x")
    with open_port(pty.path):
        assert termios.TIOCEXCL in driver.asked
        assert termios.TIOCNXCL not in driver.asked
    assert termios.TIOCNXCL in driver.asked


def test_the_driver_sets_another_baud_rate(pty: PtyPort, driver: Driver) -> None:
    driver.register(GET_TERMIOS2, None, [0] * 9 + [9600, 9600])
    before = descriptors()
    with pytest.raises(
        CapabilityMissing, match=r"does not support 250000 baud: its driver has set 9600 instead"
    ):
        open_port(pty.path, baud=250_000)
    assert descriptors() == before
    driver.register(GET_TERMIOS2, None, [0] * 9 + [117_647, 117_647])  # 2.1 % off still works
    open_port(pty.path, baud=115_200).close()


def test_rs485_of_the_driver(pty: PtyPort, driver: Driver) -> None:
    driver.register(GET_RS485, SET_RS485, [0] * 8)
    with open_port(pty.path) as port:
        assert port.capabilities.rs485 is Ability.NO
    with open_port(pty.path, rs485=RS485Settings(loopback=True, delay_before_tx=0.002)) as port:
        assert port.capabilities.rs485 is Ability.YES
        assert driver.words[GET_RS485][:3] == [0b10011, 2, 0]
        number = port.fileno()
        assert number is not None
        assert termios.tcgetattr(number)[6][termios.VMIN] == 1
    with open_port(pty.path, rs485=True):
        assert driver.words[GET_RS485][0] == 0b00011


def test_rs485_missing(pty: PtyPort) -> None:
    before = descriptors()
    with pytest.raises(
        CapabilityMissing, match=r"cannot switch an RS485 transceiver; .* a function as direction="
    ):
        open_port(pty.path, rs485=True)
    assert descriptors() == before
    open_port(pty.path, rs485=False).close()


def test_direction_by_the_caller(pty: PtyPort) -> None:
    switched: list[bool] = []
    with open_port(pty.path, direction=switched.append) as port:
        assert switched == [False]
        port.write(b"request")
        assert switched == [False, True, False]
    assert pty.read(PATIENCE) == b"request"


def test_direction_is_given_back_when_the_port_is_lost(pty: PtyPort) -> None:
    switched: list[bool] = []
    with open_port(pty.path, direction=switched.append) as port:
        pty.close()
        with pytest.raises(PortLost):
            port.write(b"request")
        assert switched == [False, True, False]
        with pytest.raises(PortLost):
            port.write(b"request")
        assert switched == [False, True, False]


def test_lost_while_draining(pty: PtyPort, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(descriptor: int) -> None:
        raise termios.error(5, "Input/output error")

    monkeypatch.setattr(termios, "tcdrain", fail)
    switched: list[bool] = []
    with (
        open_port(pty.path, direction=switched.append) as port,
        pytest.raises(PortLost, match=r"was lost .Input/output error"),
    ):
        port.write(b"request")
    assert switched == [False, True, False]


def test_errors_of_the_callers_function_are_his(pty: PtyPort) -> None:
    def broken(sending: bool) -> None:
        raise KeyError("GPIO17")

    with pytest.raises(KeyError, match="GPIO17"):
        open_port(pty.path, direction=broken)


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("could not open port 'COM3': PermissionError(13, 'Access is denied.', None, 5)", PortBusy),
        ("could not open port 'COM3': FileNotFoundError(2, 'The system ...', None, 2)", PortMissing),
    ],
)
def test_what_pyserial_says_on_windows(
    text: str, kind: type[PortError], monkeypatch: pytest.MonkeyPatch
) -> None:
    import serial

    def fail(*arguments: object, **options: object) -> None:
        raise serial.SerialException(text)

    monkeypatch.setattr(serial, "serial_for_url", fail)
    with pytest.raises(kind):
        open_port("COM3")


def test_any_other_refusal(pty: PtyPort, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(path: str, *arguments: object) -> int:
        raise OSError(24, "Too many open files", path)

    monkeypatch.setattr(os, "open", fail)
    with pytest.raises(PortError, match="cannot be opened: Too many open files"):
        open_port(pty.path)
