"""Marks each test by the resources that its code can use, and fails a test that uses others.

`pty` and `program` are assigned automatically. A test is marked if its function, one of its fixtures, or a
function or class of the tests that these refer to names a pseudo-terminal or `subprocess`. If a parameter
decides, such as the transport of a rig, the function that evaluates it is decorated with
`decided_by_parameter`, and the parameter has an attribute `needs` with the names of markers.

The search does not enter qlinkgen, nor follow `getattr` and the like. A guard covers these cases: a test that
opens a pseudo-terminal or starts a program without the marker fails.
"""

from __future__ import annotations

import functools
import inspect
import os
import sys
from collections.abc import Callable, Generator, Iterator
from types import CodeType, FunctionType, ModuleType
from typing import Any, TypeVar

import pytest

F = TypeVar("F", bound=Callable[..., Any])

MARKERS = {
    "pty": "opens a pseudo-terminal",
    "program": "starts another program: a compiler, an emulator, a second Python",
    "slow": "takes more than about half a second of processor time",
}
#: Names that show a need wherever they occur, as a global or as an attribute.
NAMES = {
    "subprocess": "program",
    "openpty": "pty",
    "open_pty": "pty",
    "PtyPort": "pty",
    "PtyBus": "pty",
    "PortRing": "pty",
    "ring_bus": "pty",
}
#: Packages whose functions and classes are searched.
SEARCHED = ("tests.", "benchmarks.")


_DECIDED: list[object] = []


# The search -----------------------------------------------------------------------------------------------


def decided_by_parameter(function: F) -> F:
    """Exclude a function from the search; the attribute `needs` of its parameter has the markers."""
    _DECIDED.append(function)
    return function


@functools.cache
def found_in(root: object) -> frozenset[str]:
    """Return the markers of a function or class and of all of the tests' code that it refers to."""
    found: set[str] = set()
    known: set[object] = set()
    waiting = [root]
    while waiting:
        each = waiting.pop()
        if isinstance(each, type):
            bases = [base for base in each.__bases__ if base.__module__.startswith(SEARCHED)]
            inside: tuple[object, ...] = (*map(_function, vars(each).values()), *bases)
        elif isinstance(function := _function(each), FunctionType):
            each, (names, inside) = function, _references(function)
            found |= {NAMES[name] for name in names}
        else:
            continue
        if each not in known:
            known.add(each)
            waiting += inside
    return frozenset(found)


def _function(value: object) -> object:
    """Return the function of a method, property or decorated function, None if a parameter decides."""
    value = getattr(value, "fget", None) or getattr(value, "__func__", value)
    if callable(value):
        value = inspect.unwrap(value, stop=_is_decided)
    return None if _is_decided(value) else value


def _is_decided(value: object) -> bool:
    return any(value is each for each in _DECIDED)


@functools.cache
def _references(function: FunctionType) -> tuple[frozenset[str], tuple[object, ...]]:
    """Return the NAMES in a function, and the functions and classes to search next."""
    names = set(_names(function.__code__))
    values = [function.__globals__[name] for name in names if name in function.__globals__]
    for module in [value for value in values if isinstance(value, ModuleType)]:
        if module.__name__.startswith(SEARCHED):
            values += [vars(module)[name] for name in names if name in vars(module)]
    homes = [(str(getattr(value, "__module__", "")), value) for value in values]
    found = names & NAMES.keys() | {home for home, _ in homes if home in NAMES}
    return frozenset(found), tuple(value for home, value in homes if home.startswith(SEARCHED))


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


def _needs(item: pytest.Item) -> frozenset[str]:
    if not isinstance(item, pytest.Function):
        return frozenset()
    fixtures = [known[-1].func for known in item._fixtureinfo.name2fixturedefs.values()]
    parameters = item.callspec.params.values() if hasattr(item, "callspec") else ()
    said: list[frozenset[str]] = [getattr(value, "needs", frozenset()) for value in parameters]
    return frozenset().union(*map(found_in, [item.function, *fixtures]), *said)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Add the markers, before -m selects by them."""
    for item in items:
        for need in _needs(item):
            item.add_marker(need)


# The guard ------------------------------------------------------------------------------------------------


class _Guard:
    """Records resources used without a marker. It does not raise, because the test might catch that."""

    def __init__(self) -> None:
        self.item: pytest.Item | None = None
        self.missing: dict[str, str] = {}

    def note(self, marker: str, what: str) -> None:
        if self.item is not None and self.item.get_closest_marker(marker) is None:
            self.missing[marker] = what

    def hear(self, event: str, details: tuple[Any, ...]) -> None:
        """Handle an audit event."""
        if event == "subprocess.Popen":
            self.note("program", f"starts {os.fsdecode(details[0])}")

    def openpty(self, original: Callable[[], tuple[int, int]]) -> tuple[int, int]:
        """Replace os.openpty, which has no audit event."""
        self.note("pty", "opens a pseudo-terminal")
        return original()

    def watch(self, item: pytest.Item) -> Generator[None, object, object]:
        """Fail a test or setup that has used a resource without a marker."""
        self.item = item
        self.missing.clear()
        try:
            result = yield
        finally:
            self.item = None
        for marker, what in self.missing.items():
            pytest.fail(
                f"this test {what} and is not marked {marker}: add @pytest.mark.{marker}", pytrace=False
            )
        return result


_guard = _Guard()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item: pytest.Item) -> Generator[None, object, object]:
    """Watch the fixtures of a test."""
    return (yield from _guard.watch(item))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    """Watch a test."""
    return (yield from _guard.watch(item))


def pytest_configure(config: pytest.Config) -> None:
    """Declare the markers, and install the guard for the rest of this process."""
    for name, meaning in MARKERS.items():
        config.addinivalue_line("markers", f"{name}: {meaning}")
    sys.addaudithook(_guard.hear)
    os.openpty = functools.partial(_guard.openpty, os.openpty)
