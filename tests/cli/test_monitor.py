"""`qlinkgen monitor`: prints requests and responses, and sends nothing."""

from __future__ import annotations

import json
import re
import signal
import subprocess
from pathlib import Path

import pytest

from qlinkgen.backends.python import load
from qlinkgen.codecs import qlink
from qlinkgen.protocols.qlink import VirtualNode
from qlinkgen.schema import load as load_schema
from qlinkgen.sim import FaultPlan
from qlinkgen.transport import PtyPort, SerialPort, open_pty
from tests.cli.conftest import Run
from tests.cli.full_disk import FULL_DISK
from tests.cli.wire import (
    CALM,
    PATIENCE,
    REPOSITORY,
    SLACK,
    bus,
    call,
    end,
    objects,
    read_until,
    records,
    simulated,
    started,
    tapped,
)

MODBUS = REPOSITORY / "tests" / "schemas" / "modbus_rtu.yaml"


def listening(process: subprocess.Popen[bytes]) -> None:
    read_until(process.stderr, "listening")


def finish(process: subprocess.Popen[bytes]) -> tuple[int, str, str]:
    out, err = process.communicate(timeout=PATIENCE)
    return process.returncode, out.decode(), err.decode()


def send(qlinkgen: Run, path: str, *words: str) -> None:
    assert qlinkgen("send", "qlink", path, *words, *CALM).code == 0


def test_a_bus_on_which_others_talk(qlinkgen: Run) -> None:
    with (
        bus() as running,
        tapped(running) as ear,
        started("monitor", "qlink", ear, "--json", "--count", "5", "--raw", *SLACK) as monitor,
    ):
        listening(monitor)
        send(qlinkgen, running.path, "motion", "--node", "3", "counter=1", "segments=7,8")
        send(qlinkgen, running.path, "node_start", "--node", "0")
        send(qlinkgen, running.path, "read", "--node", "1", "size=2")
        code, out, err = finish(monitor)
    assert code == 0
    assert (
        err
        == "qlinkgen: 5 frames, 0 of them damaged; 0 requests not answered; 0 of 54 bytes outside frames\n"
    )
    found = objects(out)
    assert records(found, "from", "to", "message", "node", "repeat", "late") == [
        ("master", 3, "motion.request", 3, False, None),
        (3, "master", "motion.response", 3, None, False),
        ("master", "all", "node_start.request", 0, False, None),
        ("master", 1, "read.request", 1, False, None),
        (1, "master", "read.response", 1, None, False),
    ]
    assert found[0]["fields"] == {"counter": 1, "outputs": 0, "segments": [7, 8]}
    request = qlink.MotionRequest(node=3, counter=1, segments=[7, 8])
    assert found[0]["raw"] == request.to_frame().hex()
    times = [each["at"] for each in found]
    assert times == sorted(times)  # type: ignore[type-var]
    assert found[1]["delay"] == pytest.approx(times[1] - times[0], abs=2e-6)  # type: ignore[operator]


def test_what_others_say_is_not_disturbed() -> None:
    with open_pty() as port:
        with started("monitor", "qlink", port.path) as monitor:
            listening(monitor)
            port.write(qlink.MotorPositionRequest(node=3).to_frame())
            read_until(monitor.stdout, "silent")
            code, out, err = end(monitor, signal.SIGTERM)
        assert (code, out) == (0, "")
        assert err.startswith("qlinkgen: 1 frame, 0 of them damaged; 1 request not answered; 0 of 7 bytes")
        assert port.read(0) == b""


def heard(
    port: PtyPort, *pieces: bytes, protocol: str | Path = "qlink", options: tuple[str, ...] = ()
) -> tuple[str, str]:
    """Return the output for these frames, in order."""
    with started("monitor", protocol, port.path, "--slack", "0.2", *options) as monitor:
        listening(monitor)
        out = ""
        for piece in pieces:
            port.write(piece)
            out += read_until(monitor.stdout, "\n")
        code, rest, err = end(monitor, signal.SIGINT)
    assert code == 0
    return out + rest, err


def test_everything_that_is_not_as_usual() -> None:
    ask = qlink.MotorPositionRequest(node=3).to_frame()
    answer = qlink.MotorPositionResponse(node=3, position=-7).to_frame()
    stray = qlink.MotorPositionResponse(node=9, position=1).to_frame()
    bad = ask[:-1] + bytes([ask[-1] ^ 1])
    with open_pty() as port, started("monitor", "qlink", port.path, "--slack", "0.2") as monitor:
        listening(monitor)
        port.write(ask)
        lines = read_until(monitor.stdout, "silent")
        port.write(ask)
        lines += read_until(monitor.stdout, "silent")
        port.write(answer)
        lines += read_until(monitor.stdout, "late")
        port.write(answer + stray + b"noise" + bad + ask + answer)
        lines += read_until(monitor.stdout, "after 0.00 ms")
        code, rest, err = end(monitor, signal.SIGINT)
    assert (code, rest) == (0, "")
    told = [re.sub(r"^ *\d+\.\d{6}  ", "", line) for line in lines.splitlines()]
    told = [re.sub(r"\d+\.\d\d ms", "N ms", re.sub(" +", " ", line)) for line in told]
    assert told == [
        "master > node 3 motor_position.request",
        "node 3 silent motor_position.request [not answered]",
        "master > node 3 motor_position.request [repeat]",
        "node 3 silent motor_position.request [not answered]",
        "node 3 > master motor_position.response position=-7 [late, after N ms]",
        "node 3 > master motor_position.response position=-7 [second answer]",
        "node 9 > master motor_position.response position=1 [answers nothing]",
        f"? damaged (crc) received checksum 15 e9, expected 15 e8 (crc-16/ibm-3740): {bad.hex(' ')}",
        "master > node 3 motor_position.request",
        "node 3 > master motor_position.response position=-7 [after N ms]",
    ]
    assert err.startswith("qlinkgen: 8 frames, 1 of them damaged; 2 requests not answered; 5 of ")


def test_the_same_as_json() -> None:
    ask = qlink.MotorPositionRequest(node=3).to_frame()
    stray = qlink.MotorPositionResponse(node=9, position=1).to_frame()
    bad = ask[:-1] + bytes([ask[-1] ^ 1])
    with open_pty() as port:
        out, _ = heard(port, bad + stray + ask, options=("--json",))
    damaged, answer, asked, *rest = objects(out)
    assert damaged["error"] == {
        "kind": "crc",
        "offset": 0,
        "raw": bad.hex(),
        "message": "received checksum 15 e9, expected 15 e8 (crc-16/ibm-3740)",
    }
    assert (damaged["asked"], "message" in damaged) == (None, False)
    assert records([answer], "from", "to", "stray", "late", "fields") == [
        (9, "master", True, False, {"position": 1})
    ]
    assert records([asked], "from", "to", "repeat") == [("master", 3, False)]
    assert [each["unanswered"] for each in rest] == [
        {"message": "motor_position.request", "node": 3, "fields": {}}
    ]


def test_faults_make_repeats_visible(qlinkgen: Run) -> None:
    plan = FaultPlan(drop=0.4, to="master", seed=2)
    with (
        bus(VirtualNode(1), faults=plan) as running,
        tapped(running) as ear,
        started("monitor", "qlink", ear, "--json", "--slack", "0.05") as monitor,
    ):
        listening(monitor)
        for _ in range(4):
            request = ("motor_position", "--node", "1", "--attempts", "200", "--slack", "0.05")
            assert qlinkgen("send", "qlink", running.path, *request, "--echo", "none").code == 0
        read_until(monitor.stdout, '"repeat": true')
        assert end(monitor, signal.SIGTERM)[0] == 0
    assert plan.counts["drop"] > 0


def test_a_schema_of_the_user() -> None:
    with (
        simulated(MODBUS, "--nodes", "7") as (path, _),
        open_pty() as ear,
        started("monitor", MODBUS, ear.path, "--seconds", "1000", *SLACK) as monitor,
    ):
        listening(monitor)
        with SerialPort(path, 19200) as port:
            request = _modbus(bytes.fromhex("070400010002"))
            port.write(request)
            ear.write(request)
            answer = b""
            while len(answer) < 7:
                answer += port.read(PATIENCE)
            ear.write(answer)
        out = read_until(monitor.stdout, "node 7 > master")
        assert end(monitor, signal.SIGINT)[0] == 0
    assert re.search(r"master > node 7 +read_input_registers.request +start=1 quantity=2", out)
    assert re.search(r"node 7 > master +read_input_registers.response +registers=0 \[", out)


def _modbus(body: bytes) -> bytes:
    register = 0xFFFF
    for byte in body:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ (0xA001 if register & 1 else 0)
    return body + register.to_bytes(2, "little")


def test_a_message_of_no_command() -> None:
    file = REPOSITORY / "tests" / "schemas" / "kitchen_sink.yaml"
    hello = load(load_schema(file)).MESSAGES["hello"](station=4, serial=99).to_frame()
    with open_pty() as port:
        out, err = heard(port, hello, protocol=file)
    assert re.search(r"\? > \? +hello +serial=99 \[unasked\]", out)
    assert err.startswith("qlinkgen: 1 frame, 0 of them damaged; 0 requests not answered")


def test_seconds_end_it(qlinkgen: Run) -> None:
    with open_pty() as port:
        result = qlinkgen("monitor", "qlink", port.path, "--seconds", "0.05")
    assert (result.code, result.out) == (0, "")
    assert result.err.splitlines() == [
        f"qlinkgen: listening to qlink on {port.path}; press Ctrl-C to stop",
        "qlinkgen: 0 frames, 0 of them damaged; 0 requests not answered; 0 of 0 bytes outside frames",
    ]


def test_a_port_that_goes_away() -> None:
    with open_pty() as port, started("monitor", "qlink", port.path) as monitor:
        listening(monitor)
        port.close()
        code, out, err = finish(monitor)
    assert (code, out) == (1, "")
    summary, error = err.splitlines()
    assert summary.startswith("qlinkgen: 0 frames")
    assert f"{port.path} was lost" in error


@FULL_DISK
def test_a_full_disk(qlinkgen: Run) -> None:
    with bus() as running, tapped(running) as ear:
        with Path("/dev/full").open("wb") as full, started("monitor", "qlink", ear, stdout=full) as monitor:
            listening(monitor)
            send(qlinkgen, running.path, "motor_position", "--node", "1")
            _, err = monitor.communicate(timeout=PATIENCE)
        assert monitor.returncode == 1
        assert b"No space left on device" in err
        assert b"Traceback" not in err
        send(qlinkgen, running.path, "motor_position", "--node", "1")


def test_a_reader_that_goes_away(qlinkgen: Run) -> None:
    with bus() as running, tapped(running) as ear, started("monitor", "qlink", ear) as monitor:
        listening(monitor)
        assert monitor.stdout is not None
        monitor.stdout.close()
        send(qlinkgen, running.path, "motor_position", "--node", "1")
        assert monitor.wait(PATIENCE) == 141


def test_two_at_one_port() -> None:
    with open_pty() as port, started("monitor", "qlink", port.path) as first:
        listening(first)
        second = call("monitor", "qlink", port.path)
        assert (second.returncode, second.stdout) == (1, "")
        assert f"{port.path} is in use by" in second.stderr
        assert f"(process {first.pid})" in second.stderr
        assert end(first, signal.SIGINT)[0] == 0


@pytest.mark.parametrize(
    ("arguments", "code", "text"),
    [
        (("qlink", "/dev/not-there"), 1, "port '/dev/not-there' does not exist"),
        (("trio", "x", "--slack", "1"), 2, "--slack requires a bus with a master"),
        (("mc1231a", "x"), 2, "`qlinkgen decode mc1231a --direction request --raw < x`"),
        (("nope", "x"), 2, "unknown schema 'nope'"),
        (("qlink", "x", "--count", "0"), 2, "--count"),
        (("qlink", "x", "--seconds", "soon"), 2, "--seconds soon: not a number of seconds"),
    ],
)
def test_errors(qlinkgen: Run, arguments: tuple[str, ...], code: int, text: str) -> None:
    result = qlinkgen("monitor", *arguments)
    assert (result.code, result.out) == (code, "")
    assert text in result.err


def test_json_lines_are_whole_objects() -> None:
    ask = qlink.MotorPositionRequest(node=3).to_frame()
    with open_pty() as port:
        out, _ = heard(port, ask, options=("--json", "--raw"))
    first = json.loads(out.splitlines()[0])
    assert list(first) == ["at", "from", "to", "message", "node", "fields", "repeat", "raw"]
