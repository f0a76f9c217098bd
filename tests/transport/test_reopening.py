"""Reopening of a lost port: reported once, and only if requested."""

from __future__ import annotations

from pathlib import Path

import pytest

from qlinkgen.errors import PortLost, PortMissing
from qlinkgen.transport import Port, ReopeningPort, memory_pair, open_port, open_pty
from tests.transport.conftest import PATIENCE


def test_unplugged_and_plugged_in_again(tmp_path: Path) -> None:
    name = str(tmp_path / "bus")
    first = open_pty(name)
    port = open_port(name, baud=9600, reopen=True)
    assert isinstance(port, ReopeningPort)
    port.write(b"one")
    assert first.read(PATIENCE) == b"one"
    first.close()
    with pytest.raises(PortLost, match="was lost"):
        port.read(PATIENCE)
    assert port.fileno() is None
    for use in (lambda: port.read(PATIENCE), lambda: port.write(b"x")):
        with pytest.raises(PortLost, match="is still missing: port") as caught:
            use()
        assert isinstance(caught.value.__cause__, PortMissing)
        assert caught.value.port == name
    with open_pty(name) as second:
        port.write(b"two")
        assert second.read(PATIENCE) == b"two"
        second.write(b"back")
        assert port.read(PATIENCE) == b"back"
        assert port.reopened == 1
        assert port.fileno() is not None
        port.close()
        assert port.fileno() is None
        for use in (lambda: port.read(0), lambda: port.write(b"x")):
            with pytest.raises(PortLost, match="was closed here"):
                use()
        assert port.reopened == 1


def test_the_loss_is_told_even_when_the_port_is_back_already(tmp_path: Path) -> None:
    name = str(tmp_path / "bus")
    first = open_pty(name)
    with open_port(name, reopen=True) as port:
        first.close()
        with open_pty(name) as second:
            with pytest.raises(PortLost):
                port.write(b"half a transaction")
            port.write(b"whole")
            assert second.read(PATIENCE) == b"whole"


def test_not_unless_asked_for(tmp_path: Path) -> None:
    name = str(tmp_path / "bus")
    first = open_pty(name)
    with open_port(name) as port:
        first.close()
        with open_pty(name):
            for _ in range(3):
                with pytest.raises(PortLost, match="was lost"):
                    port.read(0.01)


def test_the_first_opening_fails_as_ever() -> None:
    with pytest.raises(PortMissing):
        open_port("/dev/ttyNONE0", reopen=True)


def test_closed_while_away() -> None:
    made: list[tuple[Port, Port]] = []

    def opener() -> Port:
        made.append(memory_pair(9600, names=(f"near {len(made)}", "far")))
        return made[-1][0]

    port = ReopeningPort(opener)
    assert (port.name, port.baud) == ("near 0", 9600)
    assert port.capabilities == made[0][0].capabilities
    made[0][1].close()
    with pytest.raises(PortLost):
        port.read(PATIENCE)
    # The kernel gives a reconnected adapter its old number only if it is closed everywhere.
    with pytest.raises(PortLost, match="near 0 was closed here"):
        made[0][0].write(b"x")
    port.close()
    port.close()
    with pytest.raises(PortLost, match="near 0 was closed here"):
        port.read(0)
    assert len(made) == 1


def test_the_clock_is_the_ports() -> None:
    class Simulated(type(memory_pair()[0])):  # type: ignore[misc]
        def now(self) -> float:
            return 42.0

        def sleep(self, seconds: float) -> None:
            slept.append(seconds)

    slept: list[float] = []
    port, _ = memory_pair()
    port.__class__ = Simulated
    reopening = ReopeningPort(lambda: port)
    reopening.sleep(1.5)
    assert reopening.now() == 42.0
    assert slept == [1.5]
