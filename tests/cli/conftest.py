"""Runs the command line in this process: its output, errors and exit code, as a shell would see them."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from qlinkgen.cli import cli, wire_options
from qlinkgen.cli.boundary import run
from qlinkgen.sim import VirtualPort, Wire
from tests.support.remembering import remembering


@dataclass(frozen=True)
class Result:
    """Output, errors and exit code of a run."""

    code: int
    out: str
    err: str

    @property
    def lines(self) -> list[str]:
        return self.out.splitlines()


Run = Callable[..., Result]

#: A bus that is not shipped: little endian, no stuffing, a one-byte sum, bit fields, a counted array.
THERMO = """\
qlinkgen: 1
protocol: {name: thermo, title: Thermostat bus, revision: "2", source: Own design}
byteorder: little

enums:
  mode:
    type: u8
    values: {off: 0, heat: 1, cool: 2}

frame:
  parts:
    start: {role: constant, value: 7E 81}
    unit: {role: address, type: u8}
    size: {role: length, type: u8, counts: [data]}
    number: {role: message, type: u8}
    data: {role: payload, size: 0..32}
    sum: {role: checksum, type: u8, algorithm: sum8, over: [unit, size, number, data]}

bus: {kind: master_slave, nodes: 1..30, response_within: 5 ms}

defaults: {addressing: node, repeat: safe}

commands:
  set_target:
    id: 0x10
    doc: Set the target temperature.
    request:
      mode: {type: mode, default: heat}
      target: {type: i16, scale: 1/100, unit: degC, range: -40..85, default: 20}
    response: {}
  get_log:
    id: 0x11
    doc: Read the last temperatures.
    confirmed: false
    request: {first: u8}
    response:
      count: {type: u8, counts: samples}
      samples: "i16[0..8]"
      state:
        type: u8
        bits: {heating: {at: 0, type: bool}, level: 4..6}
"""


@pytest.fixture(scope="module", autouse=True)
def _remembering() -> Iterator[None]:
    """Make calls in this process cheap: there are some 1600 of them, of a few schemas."""
    with remembering():
        yield


@pytest.fixture
def qlinkgen(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """Return a function that runs `qlinkgen` with arguments and standard input."""
    for name in ("FORCE_COLOR", "NO_COLOR"):
        monkeypatch.delenv(name, raising=False)

    def call(*arguments: str | Path, stdin: bytes = b"") -> Result:
        monkeypatch.setattr(sys, "argv", ["qlinkgen", *map(str, arguments)])
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(stdin)))
        code = run(cli)
        captured = capsys.readouterr()
        assert "Traceback" not in captured.err
        return Result(code, captured.out, captured.err)

    return call


#: Returns the name of the port of a simulated line.
OnLine = Callable[[Wire], str]


@pytest.fixture
def on_line(monkeypatch: pytest.MonkeyPatch) -> OnLine:
    """Return a function that puts a line at a port with a virtual clock: no timeout takes real time."""

    def put(wire: Wire) -> str:
        ports = [VirtualPort(wire)]

        def opened(name: str, *, baud: int, **_: object) -> VirtualPort:
            ports.append(VirtualPort(wire, baud=baud, start=ports[-1].now()))
            return ports[-1]

        monkeypatch.setattr(wire_options, "open_port", opened)
        return ports[0].name

    return put


@pytest.fixture
def thermo(tmp_path: Path) -> Path:
    """A schema outside the tree."""
    path = tmp_path / "thermo.yaml"
    path.write_text(THERMO)
    return path
