"""Tests are marked by the resources that their code can reach; a test that uses another resource fails."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from qlinkgen.transport import open_pty
from tests.cli import wire
from tests.support.cdriver import Driver
from tests.support.needs import MARKERS, decided_by_parameter, found_in

CONFTEST = Path(__file__).with_name("conftest.py")


def nothing() -> int:
    return len("subprocess, openpty")


def directly() -> None:
    subprocess.run(["true"], check=True)


def imported_inside() -> None:
    from subprocess import run

    run(["true"], check=True)


def in_a_nested_function() -> Callable[[], object]:
    def inside() -> object:
        return os.openpty()

    return inside


@contextlib.contextmanager
def in_a_block() -> Iterator[None]:
    with open_pty():
        yield


def through_a_helper() -> None:
    with in_a_block():
        directly()


class Base:
    def method(self) -> None:
        directly()


class Derived(Base):
    @property
    def attribute(self) -> object:
        return in_a_nested_function()

    @staticmethod
    def round_and_round() -> object:
        return Derived()


def through_what_a_parameter_decides() -> None:
    with as_the_parameter_says():
        pass


def through_a_class() -> object:
    return Derived.round_and_round()


def through_a_module() -> None:
    wire.call("--version")


def through_another_module() -> object:
    return Driver("driver")


@decided_by_parameter
@contextlib.contextmanager
def as_the_parameter_says() -> Iterator[None]:
    directly()
    yield


@pytest.mark.parametrize(
    ("function", "needs"),
    [
        (nothing, ""),
        (directly, "program"),
        (imported_inside, "program"),
        (in_a_nested_function, "pty"),
        (in_a_block, "pty"),
        (through_a_helper, "program pty"),
        (Base, "program"),
        (Derived, "program pty"),
        (through_a_class, "program pty"),
        (through_a_module, "program"),
        (through_another_module, "program"),
        (as_the_parameter_says, ""),
        (through_what_a_parameter_decides, ""),
        (os.openpty, ""),
    ],
)
def test_what_is_found(function: object, needs: str) -> None:
    assert found_in(function) == set(needs.split())


TESTS = """
import os
import subprocess
from dataclasses import dataclass

import pytest

HIDDEN = {"program": lambda: subprocess.run(["true"]), "pty": os.openpty}

@dataclass
class Setting:
    needs: frozenset[str]

@pytest.fixture
def port():
    return os.openpty()

def test_nothing(): pass
def test_a_program(): subprocess.run(["true"])
def test_a_fixture(port): pass
def test_a_hidden_program(): HIDDEN["program"]()
def test_a_hidden_pty(): HIDDEN["pty"]()
@pytest.mark.program
def test_a_hidden_program_with_its_marker(): HIDDEN["program"]()
@pytest.mark.pty
def test_a_hidden_pty_with_its_marker(): HIDDEN["pty"]()
@pytest.mark.pty
def test_another_marker(): HIDDEN["program"]()
@pytest.mark.parametrize("setting", [Setting(frozenset({"pty"})), Setting(frozenset())])
def test_a_parameter(setting): setting.needs and HIDDEN["pty"]()
def test_swallowed():
    try:
        HIDDEN["program"]()
    except Exception:
        pass
"""

HIDDEN = {
    "test_a_hidden_program": "program",
    "test_a_hidden_pty": "pty",
    "test_another_marker": "program",
    "test_swallowed": "program",
}


def session(folder: Path, *options: str) -> str:
    (folder / "conftest.py").write_text(CONFTEST.read_text("utf-8"))
    (folder / "test_sample.py").write_text(TESTS)
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-v", "--tb=line", *options]
    environment = {**os.environ, "PYTHONPATH": str(CONFTEST.parents[1])}
    done = subprocess.run(
        [*command, "--rootdir", str(folder), str(folder)],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    return done.stdout


def test_a_missing_marker_is_named(tmp_path: Path) -> None:
    said = session(tmp_path)
    assert "4 failed, 7 passed" in said
    for name, marker in HIDDEN.items():
        assert f"::{name} FAILED" in said
        assert f"is not marked {marker}: add @pytest.mark.{marker}" in said


def test_the_fast_suite_has_neither(tmp_path: Path) -> None:
    said = session(tmp_path, "-m", " and ".join(f"not {marker}" for marker in MARKERS))
    assert "3 failed, 2 passed, 6 deselected" in said
    assert "::test_nothing PASSED" in said
    assert "::test_a_parameter[setting1] PASSED" in said


def test_make_leaves_out_what_is_marked() -> None:
    makefile = (CONFTEST.parents[1] / "Makefile").read_text("utf-8")
    assert f'-m "{" and ".join(f"not {marker}" for marker in MARKERS)}"' in makefile
