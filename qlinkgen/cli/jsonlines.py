"""JSON without loss of digits: numbers are read as Decimal and written in full, one object per line."""

from __future__ import annotations

import json
from collections.abc import Mapping
from decimal import Decimal

from qlinkgen.cli.boundary import Failure
from qlinkgen.model.values import Json


def line(found: Json) -> str:
    """Return an object as one line; a Decimal becomes a number with all its digits."""
    try:
        return json.dumps(found)
    except TypeError:
        return _exact(found)


def _exact(found: Json) -> str:
    if isinstance(found, Mapping):
        return (
            "{" + ", ".join(f"{json.dumps(str(name))}: {_exact(each)}" for name, each in found.items()) + "}"
        )
    if isinstance(found, list | tuple):
        return "[" + ", ".join(map(_exact, found)) + "]"
    if isinstance(found, Decimal):
        return f"{found:f}"
    return json.dumps(found)


def parse_object(text: str, what: str) -> dict[str, Json]:
    """Parse a text as a JSON object."""
    try:
        found = json.loads(
            text, parse_float=Decimal, parse_constant=_refuse_constant, object_pairs_hook=_refuse_doubles
        )
    except json.JSONDecodeError as error:
        raise Failure(f"{what}: invalid JSON at character {error.pos + 1}: {error.msg}") from None
    except RecursionError:
        raise Failure(f"{what}: nested too deeply; fields are numbers, texts and lists of numbers") from None
    except ValueError as error:
        raise Failure(f"{what}: {error}") from None
    if not isinstance(found, dict):
        raise Failure(f'{what}: not a JSON object; write for example {{"counter": 1}}')
    return found


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is not a finite number")


def _refuse_doubles(pairs: list[tuple[str, Json]]) -> dict[str, Json]:
    found = dict(pairs)
    if len(found) != len(pairs):
        names = [name for name, _ in pairs]
        double = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"duplicate key '{double}'; keep one")
    return found
