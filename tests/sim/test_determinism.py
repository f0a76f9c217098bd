"""The same seed gives the same bytes at exactly the same times, in any process."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

from qlinkgen.sim import Echo, FaultPlan, VirtualPort, Wire
from qlinkgen.sim.wire import Chunks
from tests.sim.lines import Answerer, Run, ask, listen

ROOT = Path(__file__).parents[2]


def everything(seed: int, chunks: Chunks = "random") -> str:
    """All events of a run with every kind of fault, including times."""
    plan = FaultPlan.parse(f"all=0.9,seed={seed}")
    wire = Wire(baud=19200, faults=plan, chunks=chunks, echo=Echo(partial=0.1, changed=0.1, seed=seed))
    for number in range(1, 5):
        wire.attach(Answerer(number, answer=b"answer of %d" % number, turnaround=0.0003))
    tap = listen(wire)
    port = VirtualPort(wire, reaction=(0.0, 0.002), seed=seed)
    heard = [ask(port, bytes([n % 4 + 1]) + b"request", within=0.015) for n in range(1000)]
    rows = [f"{at.hex()} {source} {data.hex()}" for at, source, data in tap]
    rows += [f"{at.hex()} {data.hex()}" for answers in heard for at, data in answers]
    return "\n".join([*rows, str(plan.counts.as_dict()), str(wire.collisions), str(port.now().hex())])


def digest(seed: int) -> str:
    return hashlib.sha256(everything(seed).encode()).hexdigest()


def test_again() -> None:
    assert everything(1) == everything(1)
    assert Run(FaultPlan.parse("all=0.5,seed=3")).log() == Run(FaultPlan.parse("all=0.5,seed=3")).log()


def test_another_seed_is_another_run() -> None:
    assert len({digest(seed) for seed in range(5)}) == 5


def test_in_processes_with_other_hashes() -> None:
    code = "from tests.sim.test_determinism import digest; print(digest(7))"
    found = set()
    for number in ("0", "1", "4711"):
        env = {**os.environ, "PYTHONHASHSEED": number}
        env["PYTHONPATH"] = str(ROOT)
        done = subprocess.run(
            [sys.executable, "-c", code],
            env=env,
            cwd=ROOT,
            check=True,
            capture_output=True,
            text=True,
            timeout=60,
        )
        found.add(done.stdout.strip())
    assert found == {digest(7)}


def test_pieces_change_nothing_but_the_pieces() -> None:
    def outcome(chunks: Chunks) -> tuple[bytes, Mapping[str, object]]:
        plan = FaultPlan.parse("all=0.9,late=0,silent=0,delay=0,duplicate=0,seed=5")
        wire = Wire(baud=None, faults=plan, chunks=chunks)
        wire.attach(Answerer(1))
        port = VirtualPort(wire)
        heard = [b"".join(data for _, data in ask(port, within=0.05)) for _ in range(500)]
        return b"".join(heard), plan.counts.as_dict()

    assert outcome("frame") == outcome("byte") == outcome("random")


@pytest.mark.parametrize("parts", [1, 2, 7])
def test_how_often_the_line_is_asked_changes_nothing(parts: int) -> None:
    def run(steps: int) -> list[tuple[float, str, bytes]]:
        wire = Wire(baud=9600, faults=FaultPlan.parse("all=0.9,seed=6"), chunks="byte")
        wire.attach(Answerer(1))
        tap = listen(wire)
        for n in range(300):
            wire.transmit(b"\x01request", n * 0.03)
            for step in range(1, steps):
                wire.advance(n * 0.03 + step * 0.03 / steps)
                wire.next_timer()
        wire.advance(20.0)
        return tap

    assert run(parts) == run(1)
