"""A short soak, and each kind of fault alone, where the sums are exact."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from qlinkgen.sim import VirtualPort
from qlinkgen.sim.fault_kinds import KINDS, RateLike
from tests.soak import bus_run
from tests.soak.bus_page import as_page, as_text
from tests.soak.bus_run import LATE, Result, Soak

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
def test_on_the_virtual_clock() -> None:
    result = bus_run.virtual(12_000, seed=11)
    assert result.complaints == []
    assert result.account.asked >= 12_000
    assert all(result.counts[kind] > 30 for kind in KINDS), "every kind of fault was there"
    assert result.words > 5_000
    assert result.pieces > 500
    assert result.repeats > 100, "nodes have had repeats to recognise"
    assert result.total.late > 50
    assert result.collisions > 100
    assert result.account.outcomes["answered"] > 0.8 * result.account.asked
    assert 0.3 < result.account.slowest <= 1
    assert len(result.equations) == 6


def test_over_a_pty() -> None:
    result = bus_run.pty(300, seed=11, slack=0.15)  # the machine may be busy with other tests
    assert result.complaints == []
    assert result.counts.total > 10
    assert result.words > 50
    assert result.account.outcomes["answered"] > 200


def digest(seed: int, hash_seed: str) -> str:
    code = f"from tests.soak import bus_run; print(bus_run.virtual(1500, {seed}).account.digest)"
    path = os.pathsep.join((str(ROOT), str(ROOT / "generated" / "python")))
    environment = {**os.environ, "PYTHONHASHSEED": hash_seed, "PYTHONPATH": path}
    run = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, check=True, text=True
    )
    return run.stdout.strip()


@pytest.mark.slow
def test_a_seed_always_gives_the_same_log() -> None:
    here = bus_run.virtual(1500, seed=5)
    assert here.account.digest == bus_run.virtual(1500, seed=5).account.digest == digest(5, "1")
    assert here.account.digest != bus_run.virtual(1500, seed=6).account.digest


def test_the_page_is_made_of_the_figures() -> None:
    result = bus_run.virtual(500, seed=3)
    page = as_page([result], [1.0], "python -m tests.soak.bus")
    assert f"{result.total.requests:,}".replace(",", " ") in page
    assert result.account.digest in page
    assert result.account.digest in as_text(result, 1.0)


def alone(rates: dict[str, RateLike]) -> Result:
    """Soak with one kind of fault, and without cut cables, so that every timeout has one cause."""
    soak = Soak(rates, baud=115200, seed=4, steady=True)
    return soak.run("alone", VirtualPort(soak.wire), bus_run.SLACK, 4000)


@pytest.mark.slow
class TestEachFaultAlone:
    """All nodes are present, so injected and counted faults are equal."""

    def test_none(self) -> None:
        result = alone({})
        assert result.complaints == []
        assert not result.total.damaged
        assert (result.total.strays, result.total.skipped, result.collisions) == (0, 0, 0)
        assert result.total.timeouts == result.unwilling
        assert result.repeats == 0

    def test_drop(self) -> None:
        result = alone({"drop": 0.03})
        assert result.complaints == []
        assert result.counts["drop"] > 100
        assert result.total.timeouts == result.counts["drop"] - result.unheard + result.unwilling
        assert not result.total.damaged
        assert (result.total.strays, result.total.skipped) == (0, 0)

    def test_silent(self) -> None:
        result = alone({"silent": (0.01, 0.02, 0.1)})
        assert result.complaints == []
        assert result.counts.silenced > 50
        assert result.total.timeouts == result.counts.silenced + result.unwilling
        assert (result.total.strays, result.total.skipped) == (0, 0)

    def test_late(self) -> None:
        result = alone({"late": (0.03, *LATE)})
        assert result.complaints == []
        assert result.counts["late"] > 50
        in_time = result.counts["late"] - result.total.late
        assert result.total.timeouts == result.total.late + result.unwilling
        assert result.total.strays == result.total.late
        assert 0 <= in_time <= result.pieces, "a node_program_load has 10 ms more"

    def test_delay(self) -> None:
        result = alone({"delay": 0.05})
        assert result.complaints == []
        assert result.counts["delay"] > 200
        assert result.total.timeouts == result.unwilling
        assert (result.total.strays, result.total.skipped, result.repeats) == (0, 0, 0)

    def test_truncate(self) -> None:
        result = alone({"truncate": 0.03})
        assert result.complaints == []
        assert result.counts["truncate"] > 100
        harmless = result.counts["truncate"] - result.unheard + result.unwilling - result.total.timeouts
        assert 0 <= harmless <= 0.02 * result.counts["truncate"], "all but those of an inserted last byte"
        assert result.total.strays == 0

    def test_flip(self) -> None:
        result = alone({"flip": 0.03})
        assert result.complaints == []
        assert result.counts["flip"] > 100
        harmless = result.counts["flip"] - result.unheard + result.unwilling - result.total.timeouts
        assert 0 <= harmless <= 0.02 * result.counts["flip"], "all but those in an inserted last byte"
        assert result.total.strays == 0

    @pytest.mark.parametrize("kind", ["stray", "noise", "duplicate"])
    def test_what_comes_in_addition(self, kind: str) -> None:
        result = alone({kind: (0.03, 0.0, 0.0) if kind == "duplicate" else 0.03})
        assert result.complaints == []
        assert result.counts[kind] > 100
        total = result.total
        if kind == "noise":
            assert total.strays == 0
            assert total.skipped > 0
        heard = (
            total.strays
            + total.timeouts
            + sum(total.damaged.values())
            + (total.skipped if kind == "noise" else 0)
        )
        assert heard >= result.counts.to_master[kind], "none comes without being counted"
        assert total.timeouts - result.unwilling <= 2 * result.collisions, "only a collision costs an answer"
