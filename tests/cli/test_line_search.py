"""`qlinkgen doctor --find-line`: finds speed and parity by listening, and sends nothing."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest

from qlinkgen.cli import wire_options
from qlinkgen.codecs import qlink, trio
from qlinkgen.transport import Port
from qlinkgen.transport.port import Capabilities
from tests.cli.conftest import Run

REQUEST = qlink.MotorPositionRequest(node=3).to_frame()
#: Adds a line with traffic at a speed and with some parities; returns the settings that were tried.
Busy = Callable[..., list[tuple[int, str]]]


class Ear(Port):
    """A port that receives a frame every 50 ms, garbled at a wrong setting."""

    own_clock = True
    capabilities = Capabilities()

    def __init__(self, baud: int, frame: bytes, *, right: bool) -> None:
        self.baud, self.name = baud, "ear"
        self._data = frame if right else bytes(each ^ 0x5A for each in frame)
        self._now, self._due = 0.0, 0.05

    def now(self) -> float:
        return self._now

    def sleep(self, seconds: float) -> None:
        self._now += seconds

    def read(self, timeout: float) -> bytes:
        end = self._now + timeout
        if self._due > end:
            self._now = end
            return b""
        self._now, self._due = max(self._now, self._due), self._due + 0.05
        return self._data

    def write(self, data: bytes) -> None:
        raise AssertionError("something was sent")

    def close(self) -> None:
        pass


@pytest.fixture
def busy(monkeypatch: pytest.MonkeyPatch) -> Busy:
    def make(baud: int, *parities: str, frame: bytes = REQUEST) -> list[tuple[int, str]]:
        tried: list[tuple[int, str]] = []

        def opened(name: str, *, baud: int, parity: str, stop_bits: int) -> Ear:
            tried.append((baud, parity))
            return Ear(baud, frame, right=baud == wanted and parity in parities)

        wanted = baud
        monkeypatch.setattr(wire_options, "open_port", opened)
        return tried

    return make


def test_the_speed_of_the_schema_is_tried_first(qlinkgen: Run, busy: Busy) -> None:
    tried = busy(115200, "none", "even", "odd")
    result = qlinkgen("doctor", "qlink", "x", "--find-line")
    assert (result.code, result.err, result.lines[-1]) == (0, "", "found: --baud 115200")
    assert tried == [(115200, "none")]


def test_a_parity_that_a_port_does_not_check(qlinkgen: Run, busy: Busy) -> None:
    tried = busy(19200, "even", "odd")
    result = qlinkgen("doctor", "qlink", "x", "--find-line")
    assert (result.code, result.lines[-1]) == (0, "found: --baud 19200 --parity even or odd")
    assert tried[-3:] == [(19200, "none"), (19200, "even"), (19200, "odd")]
    assert [row.split() for row in result.lines if row.split()[:2] == ["9600", "none"]] != []


def test_as_json_and_on_a_ring(qlinkgen: Run, busy: Busy) -> None:
    busy(38400, "odd", frame=trio.CharacterTransfer(address=3, characters="HELLO").to_frame())
    result = qlinkgen("doctor", "trio", "x", "--find-line", "--json")
    found: dict[str, Any] = json.loads(result.out)
    assert found["found"] == [{"baud": 38400, "parity": "odd"}]
    assert found["heard"][-1]["frames"] == 3
    assert found["heard"][0]["frames"] == 0 < found["heard"][0]["bytes"]


def test_nothing_found(qlinkgen: Run, busy: Busy) -> None:
    tried = busy(1, "none")
    result = qlinkgen("doctor", "qlink", "x", "--find-line", "--baud", "9600", "--seconds", "0.2")
    assert result.code == 1
    assert "no valid frame at any setting; check PROTOCOL, wiring and polarity" in result.err
    assert tried == [(9600, "none"), (9600, "even"), (9600, "odd")]
    busy(1, "none", frame=b"")
    result = qlinkgen("doctor", "qlink", "x", "--find-line", "--baud", "9600", "--seconds", "0.2")
    assert "nothing was received; let a master send" in result.err
    assert qlinkgen("doctor", "mc1231a", "x", "--find-line").code == 2
