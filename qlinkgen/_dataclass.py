"""``dataclass`` of the standard library, for the price of its fields.

The library compiles up to six methods of each class while it is imported: a third of the time to start the
command line. These classes share all but the constructor, which is compiled when the first object is made.
What `dataclasses` offers for objects - fields, replace, asdict - and copies work as with its own. Every field
is an argument of the constructor.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from operator import attrgetter
from reprlib import recursive_repr
from typing import TYPE_CHECKING, Any

__all__ = ["dataclass"]

_Method = Callable[..., Any]


def _dataclass(
    cls: type | None = None,
    /,
    *,
    frozen: bool = False,
    slots: bool = False,
    eq: bool = True,
    kw_only: bool = False,
) -> Any:
    """Return a class with its fields and the methods of a dataclass; without a class, a decorator."""
    if cls is None:
        return lambda decorated: _made(decorated, frozen=frozen, slots=slots, eq=eq, kw_only=kw_only)
    return _made(cls, frozen=frozen, slots=slots, eq=eq, kw_only=kw_only)


def _made(cls: type, *, frozen: bool, slots: bool, eq: bool, kw_only: bool) -> type:
    written = set(vars(cls))
    made: type = dataclasses.dataclass(
        cls,
        init=False,
        repr=False,
        eq=False,
        slots=slots,
        kw_only=kw_only,
    )
    methods: dict[str, object] = {"__repr__": _repr, "__init__": _first_init(made, frozen=frozen)}
    if eq:
        compared = [each.name for each in dataclasses.fields(made) if each.compare]
        methods |= _comparison(compared, frozen=frozen)
    if frozen:
        methods |= {"__setattr__": _refuse, "__delattr__": _refuse}
    if frozen and slots:
        methods |= {"__getstate__": _state, "__setstate__": _set_state}
    for name, method in methods.items():
        if name not in written:
            setattr(made, name, method)
    return made


def _comparison(names: list[str], *, frozen: bool) -> dict[str, object]:
    """Return the methods that compare fields; objects that can change have no hash."""
    values: Callable[[object], object] = attrgetter(*names) if names else lambda _: ()

    def equal(self: object, other: object) -> bool:
        return values(self) == values(other) if other.__class__ is self.__class__ else NotImplemented

    def hashed(self: object) -> int:
        return hash(values(self))

    return {"__eq__": equal, "__hash__": hashed if frozen else None}


@recursive_repr()
def _repr(self: Any) -> str:
    shown = (f"{each.name}={getattr(self, each.name)!r}" for each in dataclasses.fields(self) if each.repr)
    return f"{self.__class__.__qualname__}({', '.join(shown)})"


def _refuse(self: object, name: str, _: object = None) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot change field {name!r} of {self.__class__.__name__}")


def _state(self: Any) -> list[object]:
    return [getattr(self, each.name) for each in dataclasses.fields(self)]


def _set_state(self: Any, state: list[object]) -> None:
    for each, value in zip(dataclasses.fields(self), state, strict=True):
        object.__setattr__(self, each.name, value)


def _first_init(made: Any, *, frozen: bool) -> _Method:
    """Return a constructor that is replaced by the compiled one when it is called."""

    def init(self: object, /, *positional: object, **named: object) -> None:
        made.__init__ = _init(made, frozen=frozen)
        made.__init__(self, *positional, **named)

    return init


def _init(made: Any, *, frozen: bool) -> _Method:
    """Compile a constructor from the names of fields, which are identifiers of this package."""
    known: dict[str, Any] = {"_set": object.__setattr__, "_absent": object()}
    positional: list[str] = []
    named: list[str] = []
    lines: list[str] = []
    for each in dataclasses.fields(made):
        argument = value = name = each.name
        if each.default_factory is not dataclasses.MISSING:
            known[f"_new_{name}"] = each.default_factory
            argument, value = f"{name}=_absent", f"_new_{name}() if {name} is _absent else {name}"
        elif each.default is not dataclasses.MISSING:
            known[f"_default_{name}"] = each.default
            argument = f"{name}=_default_{name}"
        (named if each.kw_only else positional).append(argument)
        lines.append(f"_set(self, '{name}', {value})" if frozen else f"self.{name} = {value}")
    if hasattr(made, "__post_init__"):
        lines.append("self.__post_init__()")
    arguments = ", ".join(["self", *positional, *(["*", *named] if named else [])])
    exec(f"def __init__({arguments}):\n  " + "\n  ".join(lines or ["pass"]), known)  # our own text
    init: _Method = known["__init__"]
    init.__qualname__ = f"{made.__qualname__}.__init__"
    return init


if TYPE_CHECKING:
    from dataclasses import dataclass
else:
    dataclass = _dataclass
