"""A host engine and a device that is a script: what answers, when, and how wrong."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from qlinkgen.codecs import mc1231a
from qlinkgen.errors import LinkError
from qlinkgen.link.host import HostEngine
from qlinkgen.link.host_timing import HostTiming
from qlinkgen.link.transaction import Packet, Reply
from qlinkgen.protocols.mc1231a import ChipEngine
from qlinkgen.protocols.mc1231a.facts import RULES, SELECT

SLACK = 0.002
BAUD = 115200
BYTE = 10 / BAUD

#: Takes a piece that was sent and the time; gives pieces that come, each with its time.
Device = Callable[[bytes, float], list[tuple[float, bytes]]]


def make(*, attempts: int = 3, forgets: float = 0.0, **options: Any) -> HostEngine:
    """A host engine for a paced line."""
    timing = HostTiming.for_host(
        mc1231a, baud=BAUD, host_slack=SLACK, paced=True, attempts=attempts, forgets=forgets
    )
    return HostEngine(mc1231a, timing, RULES, **options)


def _value(rule: Any) -> Any:
    return rule.scale.value(129) if hasattr(rule, "scale") else 129


def sample(command: Any) -> Any:
    """A request whose words are 129, a value that every command takes."""
    rules = [(rule, rule.name) for rule in command.request.RULES]
    return command.request(**{name: _value(rule) for rule, name in rules})


def on_axis(request: Any, axis: int = 1) -> Packet:
    return Packet(request, SELECT[axis])


def chip_device(engine: ChipEngine) -> Device:
    """A simulated chip set; its answer is sent when all bytes have taken their line time."""

    def device(data: bytes, now: float) -> list[tuple[float, bytes]]:
        there = now + len(data) * BYTE
        engine.receive(data, there)
        answer = engine.bytes_to_send(there)
        return [(there + len(answer) * BYTE, answer)] if answer else []

    return device


class Line:
    """Runs transactions of an engine with a device, on a clock of its own.

    Attributes:
        now: the time.
        sent: pieces that were written.
        coming: pieces on their way to the host.
    """

    def __init__(self, engine: HostEngine, device: Device) -> None:
        self.engine = engine
        self.device = device
        self.now = 0.0
        self.sent: list[bytes] = []
        self.coming: list[tuple[float, bytes]] = []

    def ask(self, request: Any, **options: Any) -> Reply:
        """Do one transaction, as a driver does."""
        engine = self.engine
        for at, data in self._due(self.now):
            del at
            engine.receive(data, self.now)
        engine.start(request, self.now, **options)
        for _ in range(10_000):
            if frame := engine.bytes_to_send(self.now):
                self.sent.append(frame)
                self.coming += self.device(frame, self.now)
            timer = engine.next_timer()
            if timer is None:
                return engine.take()
            self._wait(timer)
        raise AssertionError("the transaction does not end")

    def fails(self, request: Any, **options: Any) -> LinkError:
        """Do one transaction that fails, and return its error."""
        try:
            reply = self.ask(request, **options)
        except LinkError as error:
            return error
        raise AssertionError(f"it did not fail: {reply}")

    def _wait(self, timer: float) -> None:
        first = min((at for at, _ in self.coming), default=timer)
        self.now = max(self.now, min(first, timer))
        data = b"".join(data for _, data in self._due(self.now))
        if data:
            self.engine.receive(data, self.now)
        if self.now >= timer:
            self.engine.handle_timer(self.now)

    def _due(self, now: float) -> list[tuple[float, bytes]]:
        due = sorted((item for item in self.coming if item[0] <= now), key=lambda item: item[0])
        self.coming = [item for item in self.coming if item[0] > now]
        return due
