"""A port that others reach over TCP, as `socket://HOST:PORT`."""

from __future__ import annotations

import errno
import select
import socket
import threading
import time
from contextlib import suppress

from qlinkgen.errors import PortBusy, PortError
from qlinkgen.transport.port import Ability, Capabilities, Port, closed_here
from qlinkgen.transport.stream import CHUNK

_CAPABILITIES = Capabilities(
    exclusive=Ability.YES,
    low_latency=Ability.YES,
    rs485=Ability.NO,
    paced=Ability.NO,
    latency=None,
    latency_source="a network has no longest delay",
)

#: Seconds without room for another byte after which bytes are discarded.
_STALL = 0.05
#: Longest wait in one piece, in seconds; a port may be closed by another thread meanwhile.
_SLICE = 0.1


class ListeningPort(Port):
    """A TCP server with one client at a time; the next one is served when that has left.

    Like a line, it does not wait for a reader: without a client, bytes are discarded.

    Attributes:
        name: the URL for clients, with the number of the port.
        dropped: number of discarded bytes.
    """

    def __init__(self, host: str = "127.0.0.1", port: int = 0, *, baud: int = 115200) -> None:
        """Listen.

        Args:
            host: name or address of an interface of this machine.
            port: 0 for one that is free.
            baud: nominal speed, used only in arithmetic.

        Raises:
            PortBusy: another program listens there.
            PortError: the address is not one of this machine, or is not allowed.
        """
        url = f"socket://{_bracketed(host)}:{port}"
        try:
            family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
            self._server = socket.create_server((host, port), family=family, backlog=1)
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                raise PortBusy(
                    f"{url} is in use; choose another port, or 0 for a free one", port=url
                ) from error
            raise PortError(f"cannot listen on {url}: {error.strerror or error}", port=url) from error
        self.name = f"socket://{_bracketed(host)}:{self._server.getsockname()[1]}"
        self.baud = baud
        self.capabilities = _CAPABILITIES
        self.dropped = 0
        self._server.setblocking(False)
        self._client: socket.socket | None = None
        self._closed = False
        self._using = threading.RLock()

    def read(self, timeout: float) -> bytes:
        """See `Port.read`. Clients come and leave meanwhile."""
        limit = time.monotonic() + timeout
        while True:
            with self._using:
                if self._closed:
                    raise closed_here(self.name)
                left = limit - time.monotonic()
                source = self._client or self._server
                ready = select.select((source,), (), (), max(0.0, min(left, _SLICE)))[0]
                if ready and (data := self._receive()):
                    return data
            if left <= 0:
                return b""

    def _receive(self) -> bytes:
        """Return bytes of the client, or accept one."""
        try:
            if self._client is None:
                self._client, _ = self._server.accept()
                self._client.setblocking(False)
                self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                return b""
            data = self._client.recv(CHUNK)
        except BlockingIOError:
            return b""
        except OSError:  # it has left without a word
            data = b""
        if not data:
            self._leave()
        return data

    def _leave(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None

    def write(self, data: bytes) -> None:
        """See `Port.write`."""
        with self._using:
            if self._closed:
                raise closed_here(self.name)
            rest = memoryview(data)
            while rest and self._client is not None:
                try:
                    rest = rest[self._client.send(rest) :]
                except BlockingIOError:
                    if not select.select((), (self._client,), (), _STALL)[1]:
                        break
                except OSError:
                    self._leave()
            self.dropped += len(rest)

    def fileno(self) -> int | None:
        """Return the descriptor of the client, else that of the server; `read` changes it."""
        return None if self._closed else (self._client or self._server).fileno()

    def close(self) -> None:
        """Close the port; a waiting call of another thread ends within 0.1 s."""
        self._closed = True
        with self._using, suppress(OSError):
            self._leave()
            self._server.close()


def _bracketed(host: str) -> str:
    return f"[{host}]" if ":" in host else host
