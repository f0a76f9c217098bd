"""A port that others reach over TCP."""

from __future__ import annotations

import socket
import threading
from contextlib import closing

import pytest

from qlinkgen.errors import PortBusy, PortError, PortLost
from qlinkgen.transport import open_port
from qlinkgen.transport.listening import ListeningPort
from tests.transport.conftest import PATIENCE


def test_one_client_after_the_other() -> None:
    with ListeningPort() as port:
        assert port.name.startswith("socket://127.0.0.1:")
        port.write(b"unread")
        assert (port.read(0), port.dropped) == (b"", 6)
        for number in range(2):
            before = port.fileno()
            with open_port(port.name) as client:
                client.write(b"request")
                assert port.read(PATIENCE) == b"request"
                assert port.fileno() != before
                port.write(b"answer %d" % number)
                assert client.read(PATIENCE) == b"answer %d" % number
            assert port.read(0.001) == b""
        assert port.dropped == 6


def test_a_client_that_does_not_read() -> None:
    with ListeningPort() as port, open_port(port.name):
        port.read(0)
        while not port.dropped:
            port.write(bytes(1 << 20))


def test_a_client_that_leaves_without_a_word() -> None:
    with ListeningPort() as port:
        with closing(socket.create_connection(("127.0.0.1", int(port.name.rpartition(":")[2])))) as client:
            port.read(0)
            client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
        assert port.read(0.001) == b""
        port.write(b"gone")
        assert port.dropped == 4


def test_addresses() -> None:
    with ListeningPort() as port, pytest.raises(PortBusy, match=r"is in use; choose another port, or 0"):
        ListeningPort(port=int(port.name.rpartition(":")[2]))
    with pytest.raises(PortError, match=r"cannot listen on socket://192\.0\.2\.1:0"):
        ListeningPort("192.0.2.1")


def test_closing_while_another_thread_reads() -> None:
    port = ListeningPort()
    lost = []

    def read() -> None:
        with pytest.raises(PortLost, match="closed here") as caught:
            port.read(PATIENCE)
        lost.append(caught.value)

    thread = threading.Thread(target=read)
    thread.start()
    port.close()
    port.close()
    thread.join(PATIENCE)
    assert lost
    assert port.fileno() is None
    with pytest.raises(PortLost):
        port.write(b"")
