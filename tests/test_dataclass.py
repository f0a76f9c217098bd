"""Classes with shared methods behave as those of the standard library."""

from __future__ import annotations

import copy
import dataclasses
import pickle
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import pytest

from qlinkgen import _dataclass

WAYS = {"own": _dataclass.dataclass, "library": dataclasses.dataclass}
each_way = pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)


def _classes(way: Callable[..., Any]) -> tuple[Any, Any, Any]:
    @way(frozen=True, slots=True)
    class Point:
        """A point."""

        x: int
        y: int = 2
        tags: list[str] = dataclasses.field(default_factory=list, compare=False, repr=False)

    @way(frozen=True, slots=True, kw_only=True)
    class Named(Point):
        """A point with a name."""

        name: str

        def __post_init__(self) -> None:
            if not self.name:
                raise ValueError("no name")

        def __repr__(self) -> str:
            return self.name

    @way
    class Counter:
        """A number that changes."""

        count: int = 0

    return Point, Named, Counter


@each_way
def test_objects_are_made_compared_and_shown(way: Callable[..., Any]) -> None:
    point, named, counter = _classes(way)
    assert point(1) == point(1, 2, ["a"]) != point(1, 3)
    assert point(1) != named(1, name="n")
    assert hash(point(1)) == hash(point(1, tags=["b"]))
    assert repr(point(1)).endswith("Point(x=1, y=2)")
    assert repr(named(1, name="n")) == "n"
    assert point(1).tags is not point(1).tags
    assert dataclasses.replace(point(1), y=5) == point(1, 5)
    assert dataclasses.asdict(named(1, 3, name="n")) == {"x": 1, "y": 3, "tags": [], "name": "n"}
    assert point.__match_args__ == ("x", "y", "tags")
    changed = counter()
    changed.count += 1
    assert changed == counter(1)
    with pytest.raises(TypeError, match="unhashable"):
        hash(changed)
    point.__qualname__ = point.__name__
    setattr(sys.modules[__name__], point.__name__, point)
    assert copy.copy(point(4)) == copy.deepcopy(point(4)) == pickle.loads(pickle.dumps(point(4))) == point(4)


@each_way
def test_wrong_use_is_refused(way: Callable[..., Any]) -> None:
    point, named, _ = _classes(way)
    with pytest.raises(dataclasses.FrozenInstanceError):
        point(1).x = 2
    with pytest.raises(dataclasses.FrozenInstanceError):
        del point(1).x
    with pytest.raises(AttributeError):
        object.__setattr__(point(1), "z", 2)
    with pytest.raises(TypeError, match="__init__"):
        point()
    with pytest.raises(TypeError, match="__init__"):
        point(1, 2, [], 4)
    with pytest.raises(TypeError, match="name"):
        named(1)
    with pytest.raises(ValueError, match="no name"):
        named(1, name="")


def test_the_command_line_compiles_no_method_of_a_class_before_it_is_used() -> None:
    script = (
        "import dataclasses, qlinkgen.backends.python, qlinkgen.cli.decode, qlinkgen.cli.encode, sys\n"
        "made = [value for name, module in [*sys.modules.items()] if name.startswith('qlinkgen.')\n"
        "        for value in vars(module).values()\n"
        "        if isinstance(value, type) and '__dataclass_fields__' in vars(value)]\n"
        "print(len(made), *{each.__module__ + '.' + each.__name__ for each in made\n"
        "                   if each.__dataclass_params__.init})"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    count, *compiled = done.stdout.split()
    assert int(count) > 100
    assert compiled == ["qlinkgen.errors.Fault"]  # it is ordered
