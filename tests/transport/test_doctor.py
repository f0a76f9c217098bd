"""`qlinkgen doctor`: its findings, recommendations and errors."""

from __future__ import annotations

import json
import os
import threading
from pathlib import Path

import pytest

from qlinkgen.cli import diagnosis
from qlinkgen.transport import PtyPort, SerialPort, memory_pair
from tests.cli.conftest import Run
from tests.transport.conftest import GET_SERIAL, PATIENCE, SET_SERIAL, Disguise, Driver


def test_text(qlinkgen: Run, pty: PtyPort) -> None:
    result = qlinkgen("doctor", "qlink", pty.path)
    assert (result.code, result.err) == (0, "")
    assert result.lines[0] == f"{pty.path} at 115200 baud"
    rows = [line.split() for line in result.lines]
    assert ["driver", "pty"] in rows
    assert [row[:3] for row in rows if row[:1] == ["exclusive"]] == [["exclusive", "yes", "other"]]
    assert "latency      0 us   a pty delivers bytes immediately" in result.lines
    allowances = [row for row in rows if row[:1] == ["allowance"]]
    assert [row[1:5] for row in allowances] == [["10.00", "ms", "for", "the"]]
    assert (
        "note: bytes ignore the baud rate here: the timing differs from that of a serial line" in result.lines
    )
    assert "fix:" not in result.out
    assert "local echo" not in result.out
    assert pty.read(0) == b""  # nothing is sent without --probe


def test_json(qlinkgen: Run, pty: PtyPort) -> None:
    result = qlinkgen("doctor", "qlink", pty.path, "--json", "--baud", "9600")
    found = json.loads(result.out)
    assert result.code == 0
    assert list(found) == [
        *("port", "baud", "exclusive", "low_latency", "rs485", "paced"),
        *("latency", "latency_source", "driver", "transaction", "echo", "advice"),
    ]
    assert (found["port"], found["baud"], found["paced"], found["latency"]) == (pty.path, 9600, "no", 0.0)
    terms = found["transaction"]
    assert (terms["command"], terms["allowance"], terms["frame_ends"]) == ("loop_back", 0.003125, 0.0)
    assert terms["on_wire"] == pytest.approx(terms["longest"] * 10 / 9600)
    assert terms["deadline"] == pytest.approx(terms["on_wire"] + terms["allowance"] + terms["host_slack"])
    assert found["echo"] is None
    assert [advice["kind"] for advice in found["advice"]] == ["note"]


def test_a_slow_adapter_is_a_fix(qlinkgen: Run, pty: PtyPort, disguise: Disguise) -> None:
    disguise(pty.path, "ftdi_sio", "16\n")
    result = qlinkgen("doctor", "qlink", pty.path)
    assert result.code == 1
    (fix,) = [line for line in result.lines if line.startswith("fix: ")]
    assert (
        """echo 'ACTION=="add", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", ATTR{latency_timer}="1"' """
        "| sudo tee /etc/udev/rules.d/"
    ) in fix
    assert "latency      16.00 ms  latency_timer of ftdi_sio" in result.out
    assert "20.00 ms  16.00 ms of latency, and 4.00 ms to wake this program" in result.out


def test_a_quick_adapter_needs_nothing(
    qlinkgen: Run, pty: PtyPort, disguise: Disguise, monkeypatch: pytest.MonkeyPatch
) -> None:
    disguise(pty.path, "ftdi_sio", "1\n")
    monkeypatch.setattr(diagnosis, "BY_ID", Path("/nowhere"))
    result = qlinkgen("doctor", "qlink", pty.path)
    assert result.code == 0
    assert "note:" not in result.out


def test_low_latency_refused(qlinkgen: Run, pty: PtyPort, disguise: Disguise) -> None:
    disguise(pty.path, "cp210x")
    result = qlinkgen("doctor", "qlink", pty.path)
    assert result.code == 0
    assert (
        f"note: the driver cp210x refused low latency; try `sudo setserial {pty.path} low_latency`"
        in result.out
    )
    assert "20 ms of host slack are assumed" in result.out
    assert "an unknown latency, assumed to be 16.00 ms, and 4.00 ms to wake this program" in result.out


def test_low_latency_without_a_number(
    qlinkgen: Run, pty: PtyPort, driver: Driver, disguise: Disguise
) -> None:
    disguise(pty.path, "serial8250")
    driver.register(GET_SERIAL, SET_SERIAL, [0] * 32)
    result = qlinkgen("doctor", "qlink", pty.path, "--json")
    found = json.loads(result.out)
    assert found["low_latency"] == "yes"
    (advice,) = found["advice"]
    assert advice["kind"] == "note"
    assert advice["text"].startswith("its latency is unknown (the driver serial8250 does not report it)")


def test_a_name_that_stays(
    qlinkgen: Run, pty: PtyPort, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    link = tmp_path / "usb-FTDI_FT232R-if00"
    link.symlink_to(pty.path)
    monkeypatch.setattr(diagnosis, "BY_ID", tmp_path)
    note = f"note: {link} is a stable name of this adapter"
    assert note in qlinkgen("doctor", "qlink", pty.path).lines
    assert "stays with" not in qlinkgen("doctor", "qlink", link).out


def test_probe_without_echo(qlinkgen: Run, pty: PtyPort) -> None:
    result = qlinkgen("doctor", "qlink", pty.path, "--probe")
    assert result.code == 0
    assert "local echo   no     the port does not receive its own bytes" in result.lines
    assert pty.read(0) == b"\0"


def test_probe_with_echo(qlinkgen: Run) -> None:
    result = qlinkgen("doctor", "qlink", "loop://", "--probe")
    assert result.code == 0
    (row,) = [line for line in result.lines if line.startswith("local echo")]
    assert "yes" in row
    assert "note: the port receives its own bytes" in result.out


def test_probe_of_a_line_that_is_not_quiet(qlinkgen: Run, pty: PtyPort) -> None:
    # A thread, because opening a port discards earlier bytes.
    stop = threading.Event()

    def chatter() -> None:
        while not stop.wait(0.005):
            pty.write(b"\xa5\xa5")

    other = threading.Thread(target=chatter)
    other.start()
    try:
        result = qlinkgen("doctor", "qlink", pty.path, "--probe", "--json")
    finally:
        stop.set()
        other.join(PATIENCE)
    found = json.loads(result.out)
    assert result.code == 1
    assert found["echo"]["heard"] is None
    assert found["echo"]["received"].startswith("a5a5")
    assert pty.read(0) == b""  # it did not send into that
    assert [each["kind"] for each in found["advice"]] == ["note", "fix"]


def test_what_comes_back_is_not_the_echo() -> None:
    near, far = memory_pair()
    quiet = near.read

    def read(timeout: float) -> bytes:
        if data := far.read(0):
            far.write(data + b"\x55")
        return quiet(0)

    near.read = read  # type: ignore[method-assign]
    echo = diagnosis.probe(near)
    assert (echo.heard, echo.received) == (None, "0055")
    assert echo.seconds is not None


def test_text_of_an_unclear_probe(qlinkgen: Run, pty: PtyPort, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("qlinkgen.cli.doctor.probe", lambda port: diagnosis.Echo(None, None, "a5a5"))
    result = qlinkgen("doctor", "qlink", pty.path, "--probe")
    assert result.code == 1
    assert "local echo   unknown  unexpected bytes: a5a5" in result.lines
    assert "fix: unexpected bytes on this line (a5a5); stop other masters" in result.out


def test_colours_on_a_terminal(qlinkgen: Run, pty: PtyPort, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("qlinkgen.cli.doctor.on_terminal", lambda: True)
    assert "ignore the baud rate" in qlinkgen("doctor", "qlink", pty.path).out


def test_missing(qlinkgen: Run) -> None:
    result = qlinkgen("doctor", "qlink", "/dev/ttyNONE0")
    assert (result.code, result.out) == (1, "")
    assert result.err.startswith("qlinkgen: error: port '/dev/ttyNONE0' does not exist; ")


def test_busy(qlinkgen: Run, pty: PtyPort) -> None:
    with SerialPort(pty.path):
        result = qlinkgen("doctor", "qlink", pty.path, "--json")
    assert (result.code, result.out) == (1, "")
    assert f"(process {os.getpid()}); end it, or use another port" in result.err


def test_lost(qlinkgen: Run, pty: PtyPort, monkeypatch: pytest.MonkeyPatch) -> None:
    look = diagnosis.probe

    def unplug(port: SerialPort) -> diagnosis.Echo:
        pty.close()
        return look(port)

    monkeypatch.setattr("qlinkgen.cli.doctor.probe", unplug)
    result = qlinkgen("doctor", "qlink", pty.path, "--probe")
    assert (result.code, result.out) == (1, "")
    assert result.err.startswith(f"qlinkgen: error: {pty.path} was lost (")


@pytest.mark.parametrize(
    "arguments", [[], [""], ["/dev/null", "--baud", "0"], ["/dev/null", "--baud", "fast"]]
)
def test_usage(qlinkgen: Run, arguments: list[str]) -> None:
    assert qlinkgen("doctor", "qlink", *arguments).code == 2


def test_help_lists_it(qlinkgen: Run) -> None:
    assert "doctor" in qlinkgen("--help").out
    assert "--probe" in qlinkgen("doctor", "--help").out
