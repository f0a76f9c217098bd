"""`qlinkgen simulate` with values, delays and refusals of the nodes of a schema."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.conftest import Run
from tests.cli.wire import CALM, objects, simulated
from tests.sim.test_values import SCHEMA


def test_values_of_the_command_line_and_a_file(thermo: Path, tmp_path: Path, qlinkgen: Run) -> None:
    file = tmp_path / "log.yaml"
    file.write_text("values: {get_log: {samples: [1, -2], level: 3}}\ndelay: {get_log: 0.3}\nmemory: true\n")
    given = ("--value", "get_log.level=5", "--value", "get_log.heating=true")
    options = ("--nodes", "4", "--values", file, *given)
    with simulated(thermo, *options) as (path, _):
        done = qlinkgen("send", thermo, path, "get_log", "--node", "4", "first=0", "--baud", "9600", *CALM)
    assert done.code == 0, done.err
    (found,) = objects(done.out)
    assert found["fields"] == {"samples": [1, -2], "heating": True, "level": 5}


@pytest.mark.parametrize(
    ("options", "error"),
    [
        (("--value", "get_log=1"), "--value get_log=1: write COMMAND.FIELD=VALUE"),
        (("--value", "get_log.levl=1"), "get_log.response has no field 'levl'; did you mean level?"),
        (("--value", "get_log.level=8"), "get_log.response: level: 8 is out of range; 0..7 can be sent"),
        (("--delay", "get_log"), "--delay get_log: write COMMAND=NUMBER"),
        (("--delay", "get_log=soon"), "delay of get_log: soon was given; give a number, 0 or more"),
        (("--delay", "get_lag=1"), "unknown command 'get_lag'; did you mean get_log?"),
        (("--refuse", "get_log=1"), "get_log cannot be refused: none of its replies means refused"),
        (("--values", "nowhere.yaml"), "--values nowhere.yaml: No such file or directory"),
    ],
)
def test_wrong_options(options: tuple[str, ...], error: str, thermo: Path, qlinkgen: Run) -> None:
    done = qlinkgen("simulate", thermo, *options)
    assert (done.code, done.out) == (2, "")
    assert error in done.err


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("values: [1]", "values is not a mapping; write for example values: {get: {value: 1}}"),
        ("values: {get_log: 1}", "values: get_log is not a mapping"),
        ("delay: 1", "delay is not a mapping; write for example delay: {get: 0.5}"),
        ("tables: {holding: 1}", "tables: holding is not a mapping; write for example tables: {holding"),
        ("memory: true\nvalue: {}", ":2:1: unknown key 'value'; did you mean values?"),
        ("delay: {get_log: [1]}", "delay of get_log: [1] was given; give a number, 0 or more"),
        ("values: {", ":2:1: "),
        ("tables: {x: {get_log: {at: first}}}", "tables: x: get_log: write {at: FIELD, value: FIELD}"),
        ("tables: {x: {get_lag: {at: a, value: b}}}", "unknown command 'get_lag'; did you mean get_log?"),
        ("memory: 1", "memory: 1 was given; write true or false"),
    ],
)
def test_wrong_files(text: str, error: str, thermo: Path, tmp_path: Path, qlinkgen: Run) -> None:
    file = tmp_path / "values.yaml"
    file.write_text(text)
    done = qlinkgen("simulate", thermo, "--values", file)
    assert (done.code, done.out) == (2, "")
    assert error in done.err


def test_tables_of_a_file(tmp_path: Path, qlinkgen: Run) -> None:
    file = tmp_path / "registers.yaml"
    file.write_text(
        "tables:\n"
        "  holding:\n"
        "    write_multiple_registers: {at: start, value: registers}\n"
        "    read_holding_registers: {at: [start], value: registers}\n"
    )
    read = ("read_holding_registers", "start=1", "quantity=3", "--node", "7", *CALM)
    with simulated("modbus_rtu", "--nodes", "7", "--values", file) as (path, _):
        written = ("write_multiple_registers", "start=2", "registers=5,6", "--node", "7", *CALM)
        assert qlinkgen("send", "modbus_rtu", path, *written).code == 0
        (found,) = objects(qlinkgen("send", "modbus_rtu", path, *read).out)
    assert found["fields"] == {"registers": [0, 5, 6]}


def test_values_that_the_encoder_refuses(tmp_path: Path, qlinkgen: Run) -> None:
    file = tmp_path / "oven.yaml"
    file.write_text(SCHEMA)
    done = qlinkgen("simulate", file, "--value", "get_status.label=123456789")
    assert (done.code, done.out) == (2, "")
    assert "label: '123456789' cannot be sent; give text of 0..8 seven-bit characters" in done.err


def test_for_schemas_with_generic_nodes_only(qlinkgen: Run) -> None:
    done = qlinkgen("simulate", "qlink", "--memory")
    assert done.code == 2
    assert "nodes of qlink behave as documented, and take no values" in done.err
    done = qlinkgen("simulate", "trio", "--memory")
    assert "--memory requires a bus with a master or a host with one device; trio is a ring" in done.err
