"""What works on Windows, shown on a system that lacks what Windows lacks."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from qlinkgen.captures import read_pcapng
from tests.cli.wire import ENVIRONMENT, PATIENCE, SLACK, end, objects, read_until

WINDOWS = (sys.executable, str(Path(__file__).with_name("windows.py")))
FRAME = "a5a504210315e8"

#: The library: import everything of the runtime, ask without a pty, and with a typed bus over TCP.
PROGRAM = """
import asyncio
import sys

import qlinkgen.bus, qlinkgen.captures, qlinkgen.link, qlinkgen.protocols.trio, qlinkgen.sim
from qlinkgen.codecs.qlink_bus import AsyncBus, Bus, Slave
from qlinkgen.errors import CapabilityMissing
from qlinkgen.protocols.qlink import VirtualNode
from qlinkgen.transport import memory_pair, open_pty
from qlinkgen.transport.listening import ListeningPort

try:
    open_pty()
except CapabilityMissing as error:
    print(error)
ours, theirs = memory_pair()
with Bus(ours) as bus, Slave(theirs, VirtualNode(3)) as slave, slave.running():
    print(bus.node(3).node_info().serial_number)
with Slave(ListeningPort(), VirtualNode(3, serial_number=7)) as slave, slave.running():
    with Bus.open(slave.port.name, slack=10) as bus:
        print(bus.node(3).node_info().serial_number, bus.port.capabilities.paced)

    async def ask():
        async with AsyncBus.open(slave.port.name, slack=10) as bus:
            print((await bus.node(3).node_info()).serial_number)

    asyncio.run(ask())
"""


def on_windows(*words: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*WINDOWS, *map(str, words)],
        env=ENVIRONMENT,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )


@contextmanager
def simulated(*words: str | Path) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    command = [*WINDOWS, "qlinkgen", "simulate", *map(str, words)]
    with subprocess.Popen(command, env=ENVIRONMENT, stdin=-3, stdout=-1, stderr=-1, bufsize=0) as process:
        try:
            yield json.loads(read_until(process.stdout, "\n"))["port"], process
        finally:
            process.kill()


def test_encode_and_decode() -> None:
    done = on_windows("qlinkgen", "encode", "qlink", "motor_position", "--node", "3")
    assert (done.returncode, done.stdout) == (0, f"{FRAME}\n")
    done = on_windows("qlinkgen", "decode", "qlink", FRAME)
    assert [each["message"] for each in objects(done.stdout)] == ["motor_position.request"]


def test_generate_and_lint(tmp_path: Path) -> None:
    done = on_windows(
        "qlinkgen", "generate", "qlink", "--target", "python", "--target", "c", "--output", tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert list(tmp_path.rglob("qlink.py"))
    assert on_windows("qlinkgen", "lint", "qlink").returncode == 0


def test_a_simulator_and_its_master(tmp_path: Path) -> None:
    file = tmp_path / "line.pcapng"
    with simulated("modbus_rtu", "--listen", "tcp:0") as (url, process):
        words = ("read_exception_status", "--node", "1", *SLACK, "--record", file)
        done = on_windows("qlinkgen", "send", "modbus_rtu", url, *words)
        assert [each["message"] for each in objects(done.stdout)] == ["read_exception_status.response"]
        code, _, err = end(process, signal.SIGTERM)
    assert code == 0
    assert "1 answer to 1 request" in err
    assert [each.direction for each in read_pcapng(file)] == ["sent", "received"]


def test_without_a_pty() -> None:
    done = on_windows("qlinkgen", "simulate", "qlink")
    assert (done.returncode, done.stdout) == (2, "")
    assert "this system has no ptys; add --listen tcp:0" in done.stderr


def test_the_library(tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    done = on_windows(program)
    assert done.stderr == ""
    refused, *numbers = done.stdout.splitlines()
    assert refused.startswith("this system has no ptys; use memory_pair()")
    assert numbers == ["0", "7 no", "7"]
