"""`qlinkgen send PORT mc1231a`, and the chip set of `qlinkgen simulate mc1231a`."""

from __future__ import annotations

import contextlib
import json
import signal
from collections.abc import Iterator
from pathlib import Path

from qlinkgen._resources import schemas_dir
from qlinkgen.codecs import mc1231a
from qlinkgen.codecs.mc1231a import AxisStatus
from qlinkgen.protocols.mc1231a import ChipEngine, ChipSet
from qlinkgen.sim.chip_bus import chip_wire
from qlinkgen.sim.pty_bus import PtyBus
from tests.cli.conftest import Result, Run
from tests.cli.wire import SLACK, call, end, objects, simulated


@contextlib.contextmanager
def chip(chips: ChipSet | None = None) -> Iterator[tuple[str, ChipEngine]]:
    """A chip set in a thread: its port, and its end of the link, which keeps the packets."""
    engine = ChipEngine(chips or ChipSet(), record=True)
    with PtyBus(chip_wire(engine, baud=None)) as running:
        yield running.path, engine


def send(qlinkgen: Run, path: str, *words: str) -> Result:
    return qlinkgen("send", "mc1231a", path, *words, *SLACK)


def test_as_processes() -> None:
    with simulated("mc1231a") as (path, process):
        done = call("send", "mc1231a", path, "set_vel", "value=2.75", "--axis", "2", *SLACK)
        assert (done.returncode, done.stderr) == (0, "")
        assert objects(done.stdout) == [{"message": "set_vel.response", "fields": {}}]
        found = call("send", "mc1231a", path, "get_vel", "--axis", "2", *SLACK)
        assert objects(found.stdout) == [{"message": "get_vel.response", "fields": {"value": 2.75}}]
        code, out, err = end(process, signal.SIGTERM)
    assert (code, out) == (0, "")
    assert "an mc1231a chip set on" in err
    assert "qlinkgen: axis 2: position 0, status 0x0300\n" in err
    assert err.endswith("qlinkgen: 4 packets executed, 0 illegal, 0 out of range\n")


def test_the_axis_is_chosen_before_where_one_is_given(qlinkgen: Run) -> None:
    set_2, stop = mc1231a.Set2Request().to_frame(), mc1231a.StopRequest().to_frame()
    with chip() as (path, engine):
        assert json.loads(send(qlinkgen, path, "stop", "--axis", "2").out)["message"] == "stop.response"
        assert send(qlinkgen, path, "stop").code == 0
    assert engine.record == [set_2, stop, stop]


def test_without_checksum(qlinkgen: Run) -> None:
    with chip() as (path, _):
        written = send(qlinkgen, path, "set_acc", "value=0.5", "--axis", "1", "--checksum", "never")
        assert (written.code, written.out) == (0, ""), "the response is not awaited"
        # The unread response is still in the port, or on the line: the next call discards it.
        read = send(qlinkgen, path, "get_acc", "--axis", "1")
    assert json.loads(read.out)["fields"] == {"value": 0.5}


def test_an_illegal_command(qlinkgen: Run) -> None:
    with chip(ChipSet(illegal=["get_pos"])) as (path, _):
        result = qlinkgen("send", "mc1231a", path, "get_pos", "--axis", "1", "--slack", "0.3")
    assert (result.code, result.out) == (1, "")
    assert "get_pos.request: unknown command" in result.err


def test_a_command_error(qlinkgen: Run) -> None:
    chips = ChipSet()
    with chip(chips) as (path, _):
        fine = send(qlinkgen, path, "update", "--axis", "2", "--check")
        assert (fine.code, fine.err) == (0, "")
        chips.raise_event(2, AxisStatus.COMMAND_ERROR)
        for words in (("update", "--axis", "2"), ("multi_update", "axes=2")):
            result = send(qlinkgen, path, *words, "--check")
            assert result.code == 1
            assert json.loads(result.out)["message"] == f"{words[0]}.response"
            assert "axis 2: command error, status 0x0380" in result.err
        assert send(qlinkgen, path, "multi_update", "axes=1", "--check").code == 0
        assert send(qlinkgen, path, "update", "--axis", "2").code == 0, "without --check"


def test_a_missing_port(qlinkgen: Run) -> None:
    result = send(qlinkgen, "/dev/not-there", "get_pos")
    assert (result.code, result.out) == (1, "")
    assert "does not exist" in result.err


def test_a_changed_copy_has_no_status_word_to_check(qlinkgen: Run, tmp_path: Path) -> None:
    text = (schemas_dir() / "mc1231a.yaml").read_text(encoding="utf-8")
    copy = tmp_path / "own.yaml"
    copy.write_text(text.replace("title: MC1231A", "title: Another"), encoding="utf-8")
    with chip() as (path, engine):
        result = qlinkgen("send", str(copy), path, "get_vel", "--axis", "2", "--baud", "9600", *SLACK)
        assert json.loads(result.out) == {"message": "get_vel.response", "fields": {"value": 0.0}}
        result = qlinkgen("send", str(copy), path, "update", "--axis", "2", "--check")
    assert (result.code, result.out) == (2, "")
    assert "mc1231a has no status word known here; omit --check" in result.err
    assert engine.record == [mc1231a.Set2Request().to_frame(), mc1231a.GetVelRequest().to_frame()]
