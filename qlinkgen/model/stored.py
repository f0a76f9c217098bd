"""The model as data: lists of names and values, from which it is made again without reading a schema.

Every object is stored once, after those that it consists of, so that what is the same object in one model is
the same in the other. Only classes of the model are made, by their constructors.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from fractions import Fraction
from functools import cache
from types import MappingProxyType
from typing import Any, TypeAlias

from qlinkgen.model.protocol import Protocol

#: A value in place: None, true, a number or a text, or a list that begins with one of these marks.
Cell: TypeAlias = bool | int | str | list[Any] | None
_REFERENCE, _BYTES, _FRACTION = 0, 1, 2
_PACKAGE = "qlinkgen.model."
#: Names of containers, which no class has.
_TUPLE, _MAPPING, _DICT = "()", "{=}", "{}"
_MAPPINGS: Mapping[str, Callable[[dict[object, object]], Mapping[object, object]]] = {
    _MAPPING: MappingProxyType,
    _DICT: dict,
}


class NotStorable(Exception):
    """A model has a value of a type that is not stored, or data is not that of a model."""


def store(protocol: Protocol) -> list[list[Cell]]:
    """Return a protocol as data that JSON preserves; the last list is that of the protocol.

    Raises:
        NotStorable: it has a value of another type.
    """
    return _Store(protocol).nodes


class _Store:
    """Collects the lists of the objects of a model."""

    def __init__(self, protocol: Protocol) -> None:
        self.nodes: list[list[Cell]] = []
        self._known: dict[int, int] = {}  # of objects that the protocol keeps alive
        self._cell(protocol)

    def _cell(self, value: object) -> Cell:
        match value:
            case None | bool() | int() | str() if type(value) in {type(None), bool, int, str}:
                return value
            case bytes():
                return [_BYTES, value.hex()]
            case Fraction():
                return [_FRACTION, value.numerator, value.denominator]
        at = self._known.get(id(value))
        if at is None:
            node = self._node(value)
            at = self._known[id(value)] = len(self.nodes)
            self.nodes.append(node)
        return [_REFERENCE, at]

    def _node(self, value: object) -> list[Cell]:
        if type(value) is tuple:
            return [_TUPLE, *map(self._cell, value)]
        if isinstance(value, MappingProxyType | dict):
            kind = _MAPPING if isinstance(value, MappingProxyType) else _DICT
            return [kind, *(self._cell(each) for item in value.items() for each in item)]
        cls = type(value)
        if not is_dataclass(cls) or not cls.__module__.startswith(_PACKAGE):
            raise NotStorable(f"{cls.__name__} is not a class of the model")
        name = f"{cls.__module__.removeprefix(_PACKAGE)}.{cls.__qualname__}"
        return [name, *(self._cell(getattr(value, each)) for each in _arguments(cls))]


def restore(nodes: Sequence[Sequence[Cell]]) -> Protocol:
    """Return the protocol of `store`.

    Raises:
        NotStorable: the data is not that of a model.
    """
    made: list[object] = []
    try:
        for name, *cells in nodes:
            made.append(_made(str(name), [_value(cell, made) for cell in cells]))
    except (TypeError, ValueError, IndexError, AttributeError, ImportError, ArithmeticError) as error:
        raise NotStorable(str(error)) from error
    if not made or not isinstance(made[-1], Protocol):
        raise NotStorable("the last object is not a protocol")
    return made[-1]


def _value(cell: Cell, made: Sequence[object]) -> object:
    if not isinstance(cell, list):
        return cell
    mark, *rest = cell
    if mark == _REFERENCE:
        return made[rest[0]]
    return bytes.fromhex(rest[0]) if mark == _BYTES else Fraction(*rest)


def _made(name: str, values: list[object]) -> object:
    if name == _TUPLE:
        return tuple(values)
    if name in _MAPPINGS:
        return _MAPPINGS[name](dict(zip(values[::2], values[1::2], strict=True)))
    cls, arguments = _class(name)
    return cls(**dict(zip(arguments, values, strict=True)))


@cache
def _class(name: str) -> tuple[type[object], tuple[str, ...]]:
    """Return a class of the model, and the arguments of its constructor."""
    module, _, own = name.rpartition(".")
    if not module.isidentifier():
        raise ValueError(f"{name} is not a class of the model")
    found = getattr(importlib.import_module(f"{_PACKAGE}{module}"), own)
    if not isinstance(found, type) or not is_dataclass(found) or found.__module__ != f"{_PACKAGE}{module}":
        raise ValueError(f"{name} is not a class of the model")
    return found, _arguments(found)


def _arguments(cls: type) -> tuple[str, ...]:
    return tuple(each.name for each in fields(cls) if each.init)
