"""Stations and listeners for the tests of the line."""

from __future__ import annotations

from collections.abc import Callable

from qlinkgen.sim import OUTSIDE, FaultPlan, VirtualPort, Wire

REQUEST = b"\x01request"
ANSWER = b"answer of 1"


class Answerer:
    """Answers a request that begins with its number; a request is complete with its last byte."""

    def __init__(self, number: int = 1, *, answer: bytes = ANSWER, turnaround: float = 0.0) -> None:
        self.number = number
        self.answer = answer
        self.turnaround = turnaround
        self.heard: list[tuple[float, bytes]] = []
        self.requests = 0
        self._due: float | None = None
        self._collected = b""

    @property
    def request(self) -> bytes:
        return bytes([self.number]) + REQUEST[1:]

    def receive(self, data: bytes, now: float) -> None:
        self.heard.append((now, data))
        self._collected = (self._collected + data)[-len(REQUEST) :]
        if self._collected == self.request:
            self.requests += 1
            self._due = now + self.turnaround

    def bytes_to_send(self, now: float) -> bytes:
        if self._due is None or now < self._due:
            return b""
        self._due = None
        return self.answer

    def next_timer(self) -> float | None:
        return self._due

    @property
    def everything(self) -> bytes:
        return b"".join(data for _, data in self.heard)


class Talker:
    """Sends at given times, regardless of the traffic."""

    def __init__(self, *sending: tuple[float, bytes]) -> None:
        self.sending = list(sending)
        self.heard: list[tuple[float, bytes]] = []

    def receive(self, data: bytes, now: float) -> None:
        self.heard.append((now, data))

    def bytes_to_send(self, now: float) -> bytes:
        return self.sending.pop(0)[1] if self.sending and self.sending[0][0] <= now else b""

    def next_timer(self) -> float | None:
        return self.sending[0][0] if self.sending else None


Heard = list[tuple[float, str, bytes]]


def listen(wire: Wire) -> Heard:
    """Return a list that collects all traffic of the line."""
    heard: Heard = []
    wire.taps.append(lambda at, source, data: heard.append((at, source, data)))
    return heard


def sources(heard: Heard, source: str) -> list[bytes]:
    return [data for _, who, data in heard if who == source]


def ask(port: VirtualPort, request: bytes = REQUEST, *, within: float = 0.02) -> list[tuple[float, bytes]]:
    """Send a request, and return the bytes received within a time."""
    port.write(request)
    end = port.now() + within
    heard = []
    while port.now() < end:
        data = port.read(end - port.now())
        if data:
            heard.append((port.now(), data))
    return heard


class Run:
    """Transactions on a line with faults, as seen by the plan, a tap, the station and the outside."""

    def __init__(
        self,
        plan: FaultPlan,
        count: int = 1000,
        *,
        baud: int | None = None,
        within: float = 0.02,
        setup: Callable[[Wire], object] = lambda _: None,
    ) -> None:
        self.plan = plan
        self.count = count
        self.wire = Wire(baud=baud, faults=plan)
        self.station = Answerer()
        self.wire.attach(self.station, "node")
        setup(self.wire)
        self.tap = listen(self.wire)
        port = VirtualPort(self.wire)
        self.answers = [ask(port, within=within) for _ in range(count)]
        # Late and separate bytes arrive before anything is counted.
        port.sleep(10.0)
        self.rest = port.read(0)

    @property
    def outside(self) -> bytes:
        return b"".join(data for heard in self.answers for _, data in heard) + self.rest

    def on_line(self, source: str) -> list[bytes]:
        return sources(self.tap, source)

    def log(self) -> str:
        """All events with exact times."""
        rows = [f"{at.hex()} {source} {data.hex()}" for at, source, data in self.tap]
        return "\n".join([*rows, self.outside.hex(), repr(self.plan.counts.as_dict()), repr(self.plan.log)])


__all__ = ["ANSWER", "OUTSIDE", "REQUEST", "Answerer", "Run", "Talker", "ask", "listen", "sources"]
