"""Network ports, with servers on this machine."""

from __future__ import annotations

import os
import socket
import threading
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import pytest
import serial
from serial.rfc2217 import PortManager

from qlinkgen.errors import CapabilityMissing, PortError, PortLost, PortMissing
from qlinkgen.transport import Ability, Port, SerialPort, open_port
from qlinkgen.transport.serial_port import PyserialChannel
from tests.transport.conftest import PATIENCE


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(PATIENCE)
        yield server


def url(server: socket.socket, scheme: str = "socket") -> str:
    host, number = server.getsockname()
    return f"{scheme}://{host}:{number}"


def test_socket(listener: socket.socket) -> None:
    with open_port(url(listener), baud=9600) as port:
        far, _ = listener.accept()
        far.settimeout(PATIENCE)
        with far:
            assert port.read(0) == b""
            port.write(b"request")
            assert far.recv(100) == b"request"
            far.sendall(b"answer")
            assert port.read(PATIENCE) == b"answer"
            assert port.read(0.001) == b""
            number = port.fileno()
            assert number is not None
            with socket.socket(fileno=os.dup(number)) as own:
                assert own.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
        found = port.capabilities
        assert (found.paced, found.latency, found.low_latency) == (Ability.NO, None, Ability.UNKNOWN)
        with pytest.raises(PortLost, match=r"was lost .*other side closed"):
            port.read(PATIENCE)
    with pytest.raises(PortLost, match="was closed here"):
        port.write(b"x")


def test_nobody_listens() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        name = url(server)
    with pytest.raises(PortMissing, match="cannot be reached: Connection refused; check host and port"):
        open_port(name)


@pytest.mark.parametrize("scheme", ["socket", "rfc2217", "SOCKET"])
@pytest.mark.parametrize("rest", ["", "host", "host:", "host:x", ":1", "host:99999"])
def test_incomplete_urls(scheme: str, rest: str) -> None:
    with pytest.raises(PortError, match=r"has no host and port .*write socket://HOST:PORT"):
        open_port(f"{scheme}://{rest}")


def test_unknown_urls() -> None:
    with pytest.raises(PortError, match="protocol 'tcp' not known; write socket://HOST:PORT"):
        open_port("tcp://host:1")
    with pytest.raises(PortMissing, match="no port matches hwgrep://no-such-adapter; "):
        open_port("hwgrep://no-such-adapter")


def test_direction_is_for_ports_of_this_machine(listener: socket.socket) -> None:
    for options in ({"rs485": True}, {"direction": lambda sending: None}):
        arguments: dict[str, Any] = options
        with pytest.raises(CapabilityMissing, match="only a local port can switch"):
            open_port(url(listener), **arguments)


def test_through_pyserial() -> None:
    with SerialPort("loop://") as port:
        assert port.fileno() is None
        assert port.capabilities.latency is None
        assert port.read(0) == b""
        before = port.now()
        assert port.read(0.025) == b""
        assert port.now() - before >= 0.025
        port.write(b"round")
        assert port.read(PATIENCE) == b"round"
        data = bytes(range(256)) * 8
        port.write(data)
        got = port.read(0)
        while len(got) < len(data):
            got += port.read(PATIENCE)
        assert got == data
        timer = threading.Timer(0.02, port.write, [b"late"])
        timer.start()
        assert port.read(PATIENCE).startswith(b"l")
        timer.join(PATIENCE)


class Server:
    """A serial device server whose line is looped back."""

    def __init__(self, listener: socket.socket) -> None:
        self.listener = listener
        self.line = serial.serial_for_url("loop://", timeout=0)
        self.thread = threading.Thread(target=self.serve)
        self.thread.start()

    def serve(self) -> None:
        far, _ = self.listener.accept()
        with far, closing(self.line):
            far.settimeout(PATIENCE)

            class Connection:
                write = staticmethod(far.sendall)

            manager = PortManager(self.line, Connection())
            while data := far.recv(1024):
                self.line.write(b"".join(manager.filter(data)))
                if waiting := self.line.read(self.line.in_waiting):
                    far.sendall(b"".join(manager.escape(waiting)))
                if waiting.endswith(b"hang up"):
                    return


def read_to_the_end(port: Port) -> None:
    while port.read(PATIENCE):
        pass


class Failing:
    """Like pyserial's object when a connection ends after some bytes."""

    def __init__(self, *results: bytes) -> None:
        self.results = list(results)

    @property
    def in_waiting(self) -> int:
        return 1

    def read(self, size: int) -> bytes:
        if self.results:
            return self.results.pop(0)
        raise serial.SerialException("connection failed")

    def write(self, data: bytes) -> int:
        raise serial.SerialException(f"{len(data)} bytes were not to be written")

    def flush(self) -> None:
        raise serial.SerialException("nothing is to be sent")


def test_what_came_before_a_loss_is_read_first() -> None:
    channel = PyserialChannel(Failing(b"last ", b"words"))
    assert channel.read(PATIENCE) == b"last words"
    with pytest.raises(serial.SerialException):
        channel.read(PATIENCE)


@pytest.mark.filterwarnings("ignore:set(Daemon|Name).. is deprecated:DeprecationWarning")
def test_rfc2217(listener: socket.socket) -> None:
    server = Server(listener)
    with open_port(url(listener, "rfc2217"), baud=19200) as port:
        assert server.line.baudrate == 19200
        port.write(b"\xff\xa5\xa5")
        got = b""
        while len(got) < 3:
            got += port.read(PATIENCE)
        assert got == b"\xff\xa5\xa5"
        assert port.capabilities.paced is Ability.UNKNOWN
        port.write(b"hang up")
        # pyserial may lose the last bytes when the connection ends after them.
        with pytest.raises(PortLost, match=r"was lost .connection failed"):
            read_to_the_end(port)
    server.thread.join(PATIENCE)
    assert not server.thread.is_alive()
