"""`qlinkgen simulate`: nodes on a new port, and how to stop them."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from qlinkgen.codecs import qlink
from qlinkgen.protocols.qlink import Bus
from qlinkgen.transport import open_port
from tests.cli.conftest import Run
from tests.cli.full_disk import FULL_DISK
from tests.cli.wire import (
    CALM,
    COMMAND,
    ENVIRONMENT,
    PATIENCE,
    REPOSITORY,
    SLACK,
    call,
    end,
    objects,
    read_until,
    simulated,
    started,
)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_the_first_line_and_the_end(tmp_path: Path, number: int) -> None:
    link = tmp_path / "bus"
    with started("simulate", "qlink", "--nodes", "1-16", "--link", link) as process:
        first = read_until(process.stdout, "\n")
        path = json.loads(first)["port"]
        assert first == f'{{"port": "{path}"}}\n'
        assert os.readlink(link) == path  # noqa: PTH115
        told = read_until(process.stderr, "Ctrl-C")
        assert told == f"qlinkgen: 16 nodes of qlink on {path}, linked as {link}; press Ctrl-C to stop\n"
        code, out, err = end(process, number)
    assert (code, out) == (0, "")
    assert err == "qlinkgen: 0 answers to 0 requests, 0 broadcasts\n"
    assert not os.path.lexists(link)


def test_ends_with_a_shell_that_ignores_ctrl_c(tmp_path: Path) -> None:
    # Scripts start background programs with SIGINT ignored.
    script = 'trap "" INT; "$@" & echo $! >pid; wait $!; exit $?'
    command = ["bash", "-c", script, "bash", *COMMAND, "simulate", "qlink"]
    with subprocess.Popen(command, cwd=tmp_path, env=ENVIRONMENT, stdout=-1, stderr=-1, bufsize=0) as shell:
        try:
            read_until(shell.stdout, "\n")
            os.kill(int((tmp_path / "pid").read_text()), signal.SIGINT)
            _, err = shell.communicate(timeout=PATIENCE)
        finally:
            shell.kill()
    assert shell.returncode == 0
    assert b"0 answers" in err


def test_nodes_behave_as_the_document_says() -> None:
    with simulated("qlink", "--nodes", "2,4-5") as (path, process):
        with Bus(open_port(path), slack=10, echo="none") as bus:
            assert [bus.node(number).node_info().serial_number for number in (2, 4, 5)] == [1002, 1004, 1005]
            bus.node(4).motion(segments=[3, 4, 5])
            assert bus.node(4).motor_position().position == 0
            bus.node_start(0)
            while (status := bus.node(4).motion()).fifo_space < 48:
                pass
            assert status.position == 12
        code, _, err = end(process, signal.SIGTERM)
    assert code == 0
    assert re.search(r"\n?qlinkgen: (\d+) answers to \1 requests, 1 broadcast\n$", err)


def test_faults_are_counted_and_the_seed_decides_them() -> None:
    seen = []
    for _ in range(2):
        options = ("--nodes", "1", "--faults", "drop=0.3,to=master", "--seed", "5")
        with simulated("qlink", *options) as (path, process):
            with Bus(open_port(path), slack=0.05, attempts=200, echo="none", health=None) as bus:
                for _ in range(20):
                    bus.node(1).motor_position()
                total = bus.engine.total
            _, _, err = end(process, signal.SIGTERM)
        found = re.search(
            r"(\d+) answers to (\d+) requests, 0 broadcasts, (\d+) faults \(drop (\d+)\); seed 5", err
        )
        assert found, err
        answers, requests, faults, drops = map(int, found.groups())
        # A busy machine causes repeats as well; they do not change which answers are dropped.
        assert answers <= requests
        assert faults == drops
        assert requests == total.requests
        assert total.repeats >= drops > 0
        seen.append((requests, drops))
    if seen[0][0] == seen[1][0]:
        assert seen[0] == seen[1]


def test_baud_paces() -> None:
    with (
        simulated("qlink", "--baud", "1200") as (path, _),
        Bus(open_port(path, baud=1200), slack=10, echo="none") as bus,
    ):
        request = qlink.LoopBackRequest(node=1, data=bytes(20))
        reply = bus.transact(request)
    size = len(reply.response.to_frame()) + len(request.to_frame())
    assert reply.elapsed >= size * 10 / 1200


def test_echo() -> None:
    with simulated("qlink", "--echo") as (path, _), Bus(open_port(path), slack=10) as bus:
        assert bus.node(1).motor_position().position == 0
        assert bus.engine._echo.mode == "expect"


def test_what_is_on_the_line(tmp_path: Path, qlinkgen: Run) -> None:
    tap = tmp_path / "tap"
    with simulated("qlink", "--nodes", "3", "--tap", tap, "--trace", "--baud", "19200") as (path, process):
        with open_port(str(tap)) as ear:
            ear.write(b"ignored")
            done = qlinkgen("send", "qlink", path, "motor_position", "--node", "3", *CALM)
            assert done.code == 0
            heard = b""
            while len(heard) < 18:
                heard += ear.read(PATIENCE)
        _, _, err = end(process, signal.SIGTERM)
    request, answer = qlink.MotorPositionRequest(node=3), qlink.MotorPositionResponse(node=3, position=0)
    assert heard == request.to_frame() + answer.to_frame()
    assert f"request   {request.to_frame().hex(' ')} [motor_position.request node 3]\n" in err
    assert f"answer    {answer.to_frame().hex(' ')} [motor_position.response node 3 position=0]\n" in err
    assert "1 answer to 1 request" in err
    assert not os.path.lexists(tap)


def test_another_checksum(qlinkgen: Run) -> None:
    with simulated("qlink", "--set", "crc=crc-16/xmodem") as (path, _):
        request = ("send", "qlink", path, "motor_position", "--node", "1", "--echo", "none")
        other = qlinkgen(*request, "--slack", "0.1", "--attempts", "1")
        assert other.code == 1
        assert "no answer" in other.err
        done = call(*request, *SLACK, "--set", "crc=crc-16/xmodem")  # a process: all of it has one checksum
    assert objects(done.stdout) == [
        {"message": "motor_position.response", "node": 1, "fields": {"position": 0}}
    ]


@pytest.mark.parametrize(
    ("schema", "request_", "answer"),
    [
        (
            "modbus_rtu",
            "write_single_register --node 7 number=3 value=0xBEEF",
            {"number": 3, "value": 0xBEEF},
        ),
        ("modbus_rtu", "read_holding_registers --node 7 start=1 quantity=2", {"registers": [0]}),
        ("dynamixel", "ping --node 7", {"error": "none", "model": 0, "firmware": 0}),
    ],
)
def test_a_schema_of_the_user(schema: str, request_: str, answer: dict[str, object], qlinkgen: Run) -> None:
    file = REPOSITORY / "tests" / "schemas" / f"{schema}.yaml"
    with simulated(file, "--nodes", "7") as (path, _):
        done = qlinkgen("send", file, path, *request_.split(), *CALM)
    assert (done.code, done.err) == (0, "")
    (found,) = objects(done.out)
    command, address = request_.partition(" ")[0], "id" if schema == "dynamixel" else "address"
    assert found == {"message": f"{command}.response", address: 7, "fields": answer}


def test_a_schema_without_commands(tmp_path: Path, qlinkgen: Run) -> None:
    text = (REPOSITORY / "tests" / "schemas" / "modbus_rtu.yaml").read_text()
    file = tmp_path / "talk.yaml"
    file.write_text(
        text[: text.index("\ncommands:")] + "\nmessages:\n  hello: {id: 1, fields: {value: u8}}\n"
    )
    assert qlinkgen("lint", file).code == 0, qlinkgen("lint", file).out
    result = qlinkgen("simulate", file)
    assert (result.code, result.out) == (2, "")
    assert "modbus_rtu has no commands, only messages, so its nodes have nothing to answer" in result.err


def test_frames_without_addresses(tmp_path: Path, qlinkgen: Run) -> None:
    file = tmp_path / "probe.yaml"
    file.write_text(
        "qlinkgen: 1\n"
        'protocol: {name: probe, title: Probe, revision: "1", source: Own design}\n'
        "byteorder: big\n"
        "frame:\n  parts:\n"
        "    start: {role: constant, value: 7E}\n"
        "    number: {role: message, type: u8}\n"
        "    data: {role: payload, size: 0..4}\n"
        "    sum: {role: checksum, type: u8, algorithm: sum8, over: [number, data]}\n"
        "bus: {kind: master_slave, baud: 9600, response_within: 5 ms}\n"
        "defaults: {repeat: safe}\n"
        "commands:\n"
        "  get: {id: 1, doc: Get., request: {}, response: {value: u16}}\n"
    )
    assert qlinkgen("lint", file).code == 0
    refused = qlinkgen("simulate", file, "--nodes", "1")
    assert refused.code == 2
    assert "have no address; omit --nodes 1" in refused.err
    with simulated(file) as (path, _):
        done = qlinkgen("send", file, path, "get", *CALM)
    assert objects(done.out) == [{"message": "get.response", "fields": {"value": 0}}]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("qlink", "--nodes", "0"), "--nodes 0: 0 is out of range; nodes are 1..16"),
        (("qlink", "--nodes", "1-17"), "--nodes 1-17: 1-17 is out of range; nodes are 1..16"),
        (("qlink", "--nodes", "3-1"), "write 1-3"),
        (("qlink", "--nodes", "1-3,2"), "duplicate node 2"),
        (("qlink", "--nodes", "1,"), "'' is not a node"),
        (("qlink", "--nodes", "one"), "'one' is not a node; write for example 3, 1-16 or 1,3,5-7"),
        (
            ("qlink", "--ring", "keypad"),
            "--ring requires a ring; qlink is a bus with a master: omit it",
        ),
        (("trio", "--nodes", "3"), "--nodes requires a bus with a master; trio is a ring: omit it"),
        (("trio", "--ring", "keybad"), "--ring keybad: unknown kind of node 'keybad'"),
        (("trio", "--ring", ",".join(15 * ["keypad"])), "a ring has at most 15"),
        (("trio", "--faults", "drop=1,to=master"), "a ring has neither master nor slaves"),
        (("trio", "--set", "crc=crc-99"), "unknown checksum algorithm 'crc-99'"),
        (("mc1231a", "--ring", "keypad"), "--ring requires a ring; mc1231a has one host and one device"),
        (("mc1231a", "--echo"), "--echo requires a bus with a master"),
        (("qlink", "--faults", "dorp=1"), "did you mean drop?"),
        (("qlink", "--faults", "drop=2"), "must be a probability from 0 to 1"),
        (("qlink", "--faults", "drop=0.1,seed=1", "--seed", "2"), "duplicate seed"),
        (("qlink", "--baud", "0"), "--baud"),
        (("qlink", "--set", "crc=crc-99"), "unknown checksum algorithm 'crc-99'"),
        (("nothing",), "unknown schema 'nothing'"),
    ],
)
def test_wrong_usage(qlinkgen: Run, arguments: tuple[str, ...], text: str) -> None:
    result = qlinkgen("simulate", *arguments)
    assert (result.code, result.out) == (2, "")
    assert text in result.err


@pytest.mark.pty
def test_a_link_that_cannot_be_made(qlinkgen: Run, tmp_path: Path) -> None:
    taken = tmp_path / "taken"
    taken.write_text("mine")
    result = qlinkgen("simulate", "qlink", "--link", taken)
    assert (result.code, result.out) == (1, "")
    assert "exists and is not a link to a pty" in result.err
    assert taken.read_text() == "mine"


@FULL_DISK
def test_nowhere_to_say_the_port(tmp_path: Path) -> None:
    link = tmp_path / "bus"
    with Path("/dev/full").open("wb") as full:
        done = call("simulate", "qlink", "--link", link, stdout=full)
    assert done.returncode == 1
    assert "No space left on device" in done.stderr
    assert not os.path.lexists(link)


@pytest.mark.parametrize(
    ("protocol", "words", "reply"),
    [
        ("qlink", ("motor_position", "--node", "1", "--echo", "none"), "motor_position.response"),
        ("mc1231a", ("get_vel", "--axis", "2"), "get_vel.response"),
        ("modbus_rtu", ("read_exception_status", "--node", "1"), "read_exception_status.response"),
    ],
)
def test_a_port_of_tcp(protocol: str, words: tuple[str, ...], reply: str, qlinkgen: Run) -> None:
    with simulated(protocol, "--listen", "tcp:0") as (url, process):
        assert url.startswith("socket://127.0.0.1:")
        for _ in range(2):  # one master after the other
            done = qlinkgen("send", protocol, url, *words, *SLACK)
            assert [each["message"] for each in objects(done.out)] == [reply]
        code, _, err = end(process, signal.SIGTERM)
    assert code == 0
    assert f" on {url}; press Ctrl-C to stop" in err


def test_a_ring_on_a_port_of_tcp(qlinkgen: Run) -> None:
    with simulated("trio", "--listen", "tcp:localhost:0") as (url, process):
        sent = ("direct_variable_transfer", "--address", "1", "number=7", "value=-0.25")
        assert qlinkgen("send", "trio", url, *sent).code == 0
        _, _, err = end(process, signal.SIGTERM)
    assert url.startswith("socket://localhost:")
    assert "VR(7) = -0.25" in err


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("qlink", "--listen", "5000"), "--listen 5000: write tcp:PORT or tcp:HOST:PORT"),
        (("qlink", "--listen", "tcp:65536"), "--listen tcp:65536: write tcp:PORT or"),
        (("qlink", "--listen", "tcp:0", "--link", "bus"), "--link bus: a TCP port has no link"),
        (("trio", "--listen", "tcp:0", "--closed"), "--listen tcp:0: a closed ring has no port"),
        (("qlink", "--listen", "tcp:192.0.2.1:0"), "cannot listen on socket://192.0.2.1:0"),
    ],
)
def test_wrong_addresses(words: tuple[str, ...], text: str, qlinkgen: Run) -> None:
    result = qlinkgen("simulate", *words)
    assert result.code in {1, 2}
    assert text in result.err


def test_a_signal_that_does_not_interrupt_the_wait() -> None:
    """The system may deliver it in any thread, or before the wait begins: then the wait goes on."""
    program = """
import signal, threading, time
from qlinkgen.cli.simulating import run_bus
from qlinkgen.sim import Wire
from qlinkgen.sim.pty_bus import PtyBus

def end():
    time.sleep(0.3)  # until the main thread waits
    signal.pthread_kill(threading.get_ident(), signal.SIGINT)

threading.Thread(target=end).start()
run_bus(PtyBus(Wire(baud=115200)), None, "a line")
"""
    command = [sys.executable, "-c", program]
    subprocess.run(command, env=ENVIRONMENT, check=True, capture_output=True, timeout=PATIENCE)
