"""Commands as processes of their own, and buses for them; nothing is left behind, no name is fixed."""

from __future__ import annotations

import contextlib
import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import IO

from qlinkgen.codecs import qlink
from qlinkgen.link.codec import Codec
from qlinkgen.link.slave import Node, SlaveEngine
from qlinkgen.protocols.qlink import VirtualNode
from qlinkgen.sim import FaultPlan, Wire
from qlinkgen.sim.pty_bus import PtyBus
from qlinkgen.transport import open_pty

REPOSITORY = Path(__file__).resolve().parents[2]
COMMAND = [sys.executable, "-m", "qlinkgen"]
ENVIRONMENT = {
    **{name: value for name, value in os.environ.items() if name not in {"FORCE_COLOR", "NO_COLOR"}},
    "PYTHONPATH": str(REPOSITORY),
    "PYTHONUNBUFFERED": "",
}
#: Seconds that nothing here needs; a wait that long has failed.
PATIENCE = 60.0
#: An answer that is to come may be late by this much: the machine has other things to do.
SLACK = ("--slack", "10")
#: The same for who asks; the search for an echo would wait for all of it.
CALM = (*SLACK, "--echo", "none")


def call(
    *arguments: str | Path,
    stdout: int | IO[bytes] = -1,
    stderr: int = -1,
    environment: dict[str, str] = ENVIRONMENT,
) -> subprocess.CompletedProcess[str]:
    """Run a command to its end."""
    return subprocess.run(
        [*COMMAND, *map(str, arguments)],
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=stdout,
        stderr=stderr,
        text=True,
        timeout=PATIENCE,
        check=False,
    )


def on_terminal(*arguments: str | Path) -> tuple[int, str, str]:
    """Run a command with its errors on a terminal: exit code, standard output, what the terminal shows."""
    own, theirs = os.openpty()
    environment = {**ENVIRONMENT, "TERM": "xterm", "COLUMNS": "80"}
    command = [*COMMAND, *map(str, arguments)]
    with subprocess.Popen(
        command, env=environment, stdin=subprocess.DEVNULL, stdout=-1, stderr=theirs
    ) as process:
        os.close(theirs)
        try:
            shown = b""
            with contextlib.suppress(OSError):  # EIO: the program has closed its end
                while data := os.read(own, 4096):
                    shown += data
            out, _ = process.communicate(timeout=PATIENCE)
        finally:
            process.kill()
            os.close(own)
    return process.returncode, out.decode(), shown.decode()


def wait_for(done: Callable[[], object]) -> None:
    """Wait until something is so."""
    limit = time.monotonic() + PATIENCE
    while not done():
        assert time.monotonic() < limit
        time.sleep(0.01)


@contextlib.contextmanager
def started(*arguments: str | Path, stdout: int | IO[bytes] = -1) -> Iterator[subprocess.Popen[bytes]]:
    """A command that runs until the end of the block."""
    command = [*COMMAND, *map(str, arguments)]
    with subprocess.Popen(
        command, env=ENVIRONMENT, stdin=subprocess.DEVNULL, stdout=stdout, stderr=-1, bufsize=0
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def read_until(stream: IO[bytes] | None, wanted: str) -> str:
    """Read lines until one that has the words wanted; all that was read."""
    assert stream is not None
    text, end = b"", time.monotonic() + PATIENCE
    while wanted not in text.decode() or not text.endswith(b"\n"):
        left = end - time.monotonic()
        ready, _, _ = select.select([stream], [], [], max(0.0, left))
        assert ready, f"{wanted!r} did not come, only {text!r}"
        data = os.read(stream.fileno(), 4096)
        assert data, f"ended without {wanted!r}: {text!r}"
        text += data
    return text.decode()


def end(process: subprocess.Popen[bytes], number: int) -> tuple[int, str, str]:
    """Send a signal; exit code and the rest of both outputs."""
    process.send_signal(number)
    out, err = process.communicate(timeout=PATIENCE)
    return process.returncode, (out or b"").decode(), err.decode()


@contextlib.contextmanager
def simulated(*arguments: str | Path) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """`qlinkgen simulate` in a process of its own: its port, and the process."""
    with started("simulate", *arguments) as process:
        first = read_until(process.stdout, "\n")
        yield json.loads(first)["port"], process


def line(
    *nodes: Node, codec: Codec = qlink, baud: int | None = None, faults: FaultPlan | None = None
) -> Wire:
    """A simulated line; nodes 1 and 3 of Q.link unless others are given."""
    wire = Wire(baud=baud, faults=faults)
    for node in nodes or (VirtualNode(1), VirtualNode(3, position_type=1, serial_number=77)):
        wire.attach(SlaveEngine(codec, node))
    return wire


@contextlib.contextmanager
def bus(
    *nodes: Node,
    codec: Codec = qlink,
    baud: int | None = None,
    faults: FaultPlan | None = None,
) -> Iterator[PtyBus]:
    """The same line on a pty, run by a thread."""
    with PtyBus(line(*nodes, codec=codec, baud=baud, faults=faults)) as running:
        yield running


@contextlib.contextmanager
def tapped(running: PtyBus) -> Iterator[str]:
    """A port on which everything can be heard that goes over a bus."""
    with open_pty() as ear:
        running.call(lambda: running.wire.taps.append(lambda at, source, data: ear.write(data)))
        try:
            yield ear.path
        finally:
            running.call(running.wire.taps.clear)
            running.stop()


def objects(text: str) -> list[dict[str, object]]:
    """The objects of lines of JSON."""
    return [json.loads(line) for line in text.splitlines()]


def records(lines: Iterable[dict[str, object]], *names: str) -> list[tuple[object, ...]]:
    """Some entries of each object."""
    return [tuple(each.get(name) for name in names) for each in lines]
