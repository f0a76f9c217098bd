"""`qlinkgen send`, `shell` and `simulate` with a host and its device of a schema of one's own."""

from __future__ import annotations

import json
import signal
from pathlib import Path

import pytest

from qlinkgen.backends.python import load
from qlinkgen.link.device import DeviceEngine
from qlinkgen.schema import load as load_schema
from qlinkgen.sim import Wire
from qlinkgen.sim.generic import GenericNode
from tests.bus.test_hosts import PUMP
from tests.cli.conftest import OnLine, Run
from tests.cli.wire import call, end, simulated


@pytest.fixture
def schema(tmp_path: Path) -> Path:
    """The schema of a pump."""
    path = tmp_path / "pump.yaml"
    path.write_text(PUMP)
    return path


def pump_line(schema: Path) -> tuple[Wire, DeviceEngine]:
    """A pump at the end of a link."""
    codec = load(load_schema(schema))
    engine = DeviceEngine(codec, GenericNode(codec))
    wire = Wire(baud=19200, collisions=False)
    wire.attach(engine)
    return wire, engine


def test_sending_selects_first(qlinkgen: Run, on_line: OnLine, schema: Path) -> None:
    wire, engine = pump_line(schema)
    heard: list[str] = []
    wire.taps.append(lambda _at, source, data: heard.append(data.hex()) if source == "outside" else None)
    port = on_line(wire)
    assert qlinkgen("send", schema, port, "beep").out == ""
    result = qlinkgen("send", schema, port, "set_rate", "rate=5", "--select", "2")
    assert json.loads(result.out) == {"message": "set_rate.response", "fields": {}}
    assert "".join(heard) == "1612140005"
    assert engine.counters.packets == 3


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (("get_rate", "--axis", "3"), "--axis 3: channel must be 1 or 2, not 3"),
        (("status", "--axis", "1"), "status does not depend on the current channel; omit --axis 1"),
        (("get_rate", "--check"), "pump has no status word known here; omit --check"),
        (("get_rate.response",), "is a response; send its request"),
    ],
)
def test_what_is_not_sent(
    qlinkgen: Run, on_line: OnLine, schema: Path, words: tuple[str, ...], error: str
) -> None:
    wire, engine = pump_line(schema)
    result = qlinkgen("send", schema, on_line(wire), *words)
    assert (result.code, result.out) == (2, "")
    assert error in result.err
    assert not engine.counters.packets


def test_lines_of_a_host(qlinkgen: Run, on_line: OnLine, schema: Path) -> None:
    wire, engine = pump_line(schema)
    text = b"set_rate @2 rate=5\n.node 2\nbeep\nget_rate\nstatus\n"
    result = qlinkgen("shell", schema, on_line(wire), stdin=text)
    assert (result.code, result.err) == (0, "")
    assert [row for row in result.lines if not row.startswith("  answered")] == [
        "set_rate.response", "  sent; 0.00 ms", "get_rate.response", "  rate = 0", "status.response",
        "  status = 0",
    ]  # fmt: skip
    assert engine.counters.packets == 5


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("status @1", "status does not depend on the current channel; omit @1"),
        ("get_rate @1 @2", "@1 @2: one number is selected at a time"),
        ("get_rate @one", "@one: not a whole number"),
        (".node 7", ".node 7: pump selects 1, 2 as channel"),
        ("drain @3", "drain does not depend"),
    ],
)
def test_a_wrong_line_of_a_host(qlinkgen: Run, on_line: OnLine, schema: Path, text: str, error: str) -> None:
    wire, _ = pump_line(schema)
    result = qlinkgen("shell", schema, on_line(wire), stdin=f"{text}\nstatus\n".encode())
    assert result.code == 1
    assert error in result.err
    assert "status.response" in result.out


def test_what_a_host_is_not(qlinkgen: Run, tmp_path: Path, schema: Path) -> None:
    silent = tmp_path / "silent.yaml"
    silent.write_text(PUMP.replace("  resync: {command: status, fill: 0xFF}\n", ""))
    for words in (("send", silent, "x", "status"), ("shell", silent, "x"), ("simulate", silent)):
        result = qlinkgen(*words)
        assert result.code == 2
        assert "does not say how its host comes back in step; add resync to its bus" in result.err
    assert "--echo requires a bus with a master" in qlinkgen("shell", schema, "x", "--echo", "none").err
    assert "packets of pump have no check value" in qlinkgen("fuzz", schema, "x").err
    refused = qlinkgen("simulate", "mc1231a", "--value", "get_pos.value=3")
    assert "behaves as documented, and takes no values" in refused.err


@pytest.mark.pty
def test_a_simulated_device_has_values_and_memory(schema: Path) -> None:
    with simulated(schema, "--memory", "--value", "get_rate.rate=17") as (path, process):
        done = call("send", str(schema), path, "get_rate", "--axis", "1")
        assert json.loads(done.stdout)["fields"] == {"rate": 17}
        code, out, err = end(process, signal.SIGTERM)
    assert (code, out) == (0, "")
    assert "a device of" in err
    assert err.endswith("qlinkgen: 2 packets executed, 0 illegal, 0 out of range\n")
