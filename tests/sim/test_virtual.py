"""The port with a virtual clock."""

from __future__ import annotations

import math
import time

import pytest

from qlinkgen.errors import PortLost
from qlinkgen.sim import SimulationError, VirtualPort, Wire
from qlinkgen.transport.port import Ability
from tests.sim.lines import ANSWER, REQUEST, Answerer, Talker

BAUD = 115200
BYTE = 10 / BAUD


def test_a_transaction_takes_exactly_its_time() -> None:
    wire = Wire(baud=BAUD)
    wire.attach(Answerer(turnaround=0.001))
    port = VirtualPort(wire)
    port.write(REQUEST)
    assert port.now() == 0.0  # the bytes are in transit
    assert port.read(1.0) == ANSWER
    assert port.now() == len(REQUEST) * BYTE + 0.001 + len(ANSWER) * BYTE


def test_a_timeout_takes_exactly_its_time() -> None:
    for baud in (None, BAUD):
        port = VirtualPort(Wire(baud=baud), start=7.0)
        assert port.read(0.25) == b""
        assert port.now() == 7.25
        port.write(b"no answer")
        assert port.read(0.5) == b""
        assert port.now() == 7.75


def test_a_look_takes_no_time() -> None:
    wire = Wire(baud=BAUD)
    wire.attach(Talker((0.0, b"x"), (3.0, b"y")))
    port = VirtualPort(wire)
    assert port.read(0) == port.read(-1.0) == b""
    assert port.now() == 0.0
    port.sleep(1.0)
    assert port.now() == 1.0
    assert port.read(0) == b"x"
    assert port.now() == 1.0
    assert port.read(10.0) == b"y"


def test_the_line_goes_on_during_a_sleep() -> None:
    wire = Wire(baud=BAUD)
    station = Answerer()
    wire.attach(station)
    port = VirtualPort(wire)
    port.write(REQUEST)
    port.sleep(1.0)
    assert station.requests == 1


def test_what_came_during_a_sleep_is_there_at_once() -> None:
    wire = Wire(baud=None)
    wire.attach(Talker((1.0, b"a"), (2.0, b"b"), (4.0, b"c")))
    port = VirtualPort(wire)
    port.sleep(3.0)
    assert port.read(100.0) == b"ab"
    assert port.now() == 3.0


def test_bytes_at_the_very_end_of_the_timeout_are_in_time() -> None:
    wire = Wire(baud=None)
    wire.attach(Talker((1.0, b"a")))
    port = VirtualPort(wire)
    assert port.read(1.0) == b"a"


def test_a_host_needs_time_to_react() -> None:
    wire = Wire(baud=None, chunks="byte")
    wire.attach(Talker((1.0, b"a"), (1.05, b"b"), (2.0, b"c")))
    port = VirtualPort(wire, reaction=0.1)
    assert port.read(5.0) == b"a"
    assert port.now() == 1.1
    assert port.read(5.0) == b"b"  # received meanwhile
    assert port.now() == 1.1
    assert port.read(5.0) == b"c"
    assert port.now() == 2.1
    assert port.capabilities.latency == 0.1


def test_a_drawn_reaction_keeps_its_bounds_and_comes_again() -> None:
    def times(seed: int) -> list[float]:
        wire = Wire(baud=None)
        wire.attach(Talker(*((float(second), b"x") for second in range(1, 50))))
        port = VirtualPort(wire, reaction=(0.01, 0.2), seed=seed)
        found: list[float] = []
        while len(found) < 49:
            port.read(2.0)
            found.append(port.now())
        return found

    first = times(1)
    needed = [at - second for second, at in enumerate(first, 1)]
    assert 0.01 <= min(needed) < 0.05
    assert 0.15 < max(needed) <= 0.2000001
    assert first == times(1) != times(2)


def test_an_endless_read_ends_or_says_that_it_cannot() -> None:
    wire = Wire(baud=BAUD)
    wire.attach(Talker((1e6, b"x")))
    port = VirtualPort(wire)
    assert port.read(math.inf) == b"x"
    for timeout in (math.inf, math.nan):
        with pytest.raises(SimulationError, match="would never return"):
            port.read(timeout)
    assert port.read(1.0) == b""  # still usable


def test_pieces_come_one_by_one() -> None:
    wire = Wire(baud=None, chunks="byte")
    wire.attach(Answerer())
    port = VirtualPort(wire)
    port.write(REQUEST)
    assert [port.read(1.0) for _ in ANSWER] == [bytes([byte]) for byte in ANSWER]


def test_capabilities() -> None:
    paced = VirtualPort(Wire(baud=9600))
    assert (paced.baud, paced.capabilities.paced, paced.capabilities.latency) == (9600, Ability.YES, 0.0)
    free = VirtualPort(Wire(baud=None), baud=19200)
    assert (free.baud, free.capabilities.paced) == (19200, Ability.NO)
    assert VirtualPort(Wire(baud=None)).baud == 115200
    assert free.fileno() is None


@pytest.mark.parametrize("reaction", [-0.1, math.nan, math.inf, (0.2, 0.1), (-1.0, 1.0)])
def test_wrong_reactions(reaction: float | tuple[float, float]) -> None:
    with pytest.raises(SimulationError, match="reaction must be"):
        VirtualPort(Wire(baud=None), reaction=reaction)


@pytest.mark.parametrize("seconds", [-0.1, math.nan, math.inf])
def test_wrong_sleeps(seconds: float) -> None:
    with pytest.raises(SimulationError, match="sleep must be"):
        VirtualPort(Wire(baud=None)).sleep(seconds)


def test_closed() -> None:
    port = VirtualPort(Wire(baud=None))
    with port:
        port.write(b"x")
    port.close()
    for call in (lambda: port.read(1.0), lambda: port.write(b"x"), lambda: port.sleep(1.0)):
        with pytest.raises(PortLost, match="closed"):
            call()


def test_real_time_is_not_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    def forbidden(*_: object) -> float:
        raise AssertionError("real time was asked for")

    for name in ("monotonic", "time", "perf_counter", "sleep"):
        monkeypatch.setattr(time, name, forbidden)
    wire = Wire(baud=BAUD)
    wire.attach(Answerer())
    port = VirtualPort(wire)
    for _ in range(100):
        port.write(REQUEST)
        assert port.read(1.0) == ANSWER
        port.sleep(100.0)
    assert port.now() > 10_000
