"""The kit on other processors, emulated: big-endian, 32 bits without a library, 8 bits with 2 KiB of RAM."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.conformance import emulators
from tests.conformance.conftest import Write
from tests.conformance.test_host import vectors_of
from tests.proof import cases


@pytest.mark.parametrize("name", cases.SHIPPED)
def test_big_endian(name: str, kit: Write, tmp_path: Path, require_tool: Callable[..., str]) -> None:
    report = emulators.big_endian(kit(name), tmp_path, require_tool)
    report.check()
    assert not vectors_of(name) - report.by_verb


@pytest.mark.parametrize("name", cases.SHIPPED)
def test_cortex_m3_without_a_library(
    name: str, kit: Write, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    optimisation = "-Os" if name == "trio" else "-O0"
    report = emulators.cortex_m3(name, kit(name), tmp_path, require_tool, optimisation)
    report.check()
    assert not vectors_of(name) - report.by_verb


#: First and last message of each part. 32 KiB of flash hold two whole protocols, and half of the third
#: without dispatching, which needs the code of all commands in every part.
HALVES = ((0, 101), (102, 201))
RUNS: list[tuple[str, tuple[int, ...]]] = [
    ("qlink", ()),
    ("trio", ()),
    *(("mc1231a", half) for half in HALVES),
]


@pytest.mark.parametrize(("name", "part"), RUNS)
def test_atmega328p(
    name: str,
    part: tuple[int, ...],
    *,
    kit: Write,
    simulator: Path,
    tmp_path: Path,
    require_tool: Callable[..., str],
) -> None:
    limits = zip(("FIRST", "LAST", "DISPATCH"), (*part, 0) if part else (), strict=False)
    chosen = [f"-DCONFORMANCE_{which}={number}" for which, number in limits]
    report = emulators.atmega328p(name, kit(name), tmp_path, require_tool, simulator, *chosen)
    report.check()
    messages = [message.name for message in cases.protocol(name).messages]
    kept = set(messages[part[0] : part[1] + 1] if part else messages)
    assert {each.split(" ")[0] for each in report.names} - {"check"} == kept
    if not part:
        assert not vectors_of(name) - report.by_verb


def test_the_halves_are_all() -> None:
    (first, middle), (next_one, last) = HALVES
    assert first == 0
    assert middle + 1 == next_one
    assert last == len(cases.protocol("mc1231a").messages) - 1
