"""Transactions of the MC1231A host over a pty: the public API and raw system calls."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import tty
from collections.abc import Iterator

from benchmarks import ROOT
from benchmarks.host_responder import ANSWERS, POSITION, REQUESTS, VELOCITY
from benchmarks.report import Goal, Section, number
from benchmarks.wire import RAW, Client, Run
from qlinkgen.protocols.mc1231a import Host
from qlinkgen.transport.opening import open_port

SLICE = 100
BAUD = 115200
#: Seconds: the responder may have to wait for the machine; a long timeout costs nothing otherwise.
SLACK = 1.0
INTRO = """\
A transaction with a chip set in a second process that answers at once, over a pty: set_vel sends 5 bytes
and receives 2 of checksum, get_actl_pos 1 and 6, both for the current axis. Best round trip of all rounds,
all in turns, over that of the bare system calls with the same bytes. CPU is the host's."""


@contextlib.contextmanager
def responder() -> Iterator[str]:
    """A process that answers on a pty; yields the name of the host's side."""
    master, slave = os.openpty()
    tty.setraw(slave)
    process = subprocess.Popen(
        [sys.executable, "-m", "benchmarks.host_responder"],
        stdin=master,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    os.close(master)
    try:
        os.write(slave, REQUESTS["select"].to_frame())
        os.read(slave, 64)  # it has started
        yield os.ttyname(slave)
    finally:
        os.close(slave)
        process.terminate()
        process.wait()


def raw_client(name: str, request: bytes) -> Client:
    """Two system calls only."""
    descriptor = os.open(name, os.O_RDWR | os.O_NOCTTY)
    size = len(ANSWERS[request])

    def ask() -> bytes:
        os.write(descriptor, request)
        answer = os.read(descriptor, 64)
        while len(answer) < size:
            answer += os.read(descriptor, 64)
        return answer

    return ask


def section(rounds: int) -> Section:
    """All clients, interleaved."""
    result = Section("MC1231A transactions over a pty", INTRO, ["", "us", "x raw", "CPU us"])
    with contextlib.ExitStack() as stack:
        pairs = [_pair(stack, kind) for kind in ("write", "read")]
        for _ in range(rounds):
            for _, run, base in pairs:
                base.once()
                run.once()
    for name, run, base in pairs:
        result.rows += [_row(f"{RAW}, {name}", base, base), _row(f"Host.{name}", run, base)]
        result.goals.append(
            Goal(f"{name} with its checksum, public API", run.wall.over(base.wall), 4, "x raw round trip")
        )
    return result


def _pair(stack: contextlib.ExitStack, kind: str) -> tuple[str, Run, Run]:
    """The public API and the bare calls, each with its own responder."""
    bare = raw_client(stack.enter_context(responder()), REQUESTS[kind].to_frame())
    host = stack.enter_context(Host(open_port(stack.enter_context(responder()), baud=BAUD), slack=SLACK))
    axis = host.axis(1)
    if kind == "write":
        return "set_vel", Run(lambda: axis.set_vel(value=VELOCITY), SLICE), Run(bare, SLICE)
    assert axis.get_actl_pos().value == POSITION
    return "get_actl_pos", Run(axis.get_actl_pos, SLICE), Run(bare, SLICE)


def _row(name: str, run: Run, base: Run) -> list[str]:
    return [
        name,
        number(run.wall.best * 1e6),
        number(run.wall.over(base.wall)),
        number(run.cpu.best * 1e6),
    ]
