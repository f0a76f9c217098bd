"""Values of every frame that a message states beside its id."""

from __future__ import annotations

import random
import re
from collections.abc import Iterator
from typing import Any

from tests.support.whole.frames import Shape

Doc = dict[str, Any]


def settle(rng: random.Random, shape: Shape, found: Doc) -> None:
    """Let messages state values of their frames."""
    known = [*_values(shape.frame.get("parts", {}))]
    if not known or shape.id_bits == 0 or shape.kind != "parts":
        return
    shared = "id" in found.get("defaults", {}).get("response", {})
    replies = [each for spec in found["commands"].values() for each in spec.get("replies", {}).values()]
    responses = [spec.get("response") for spec in found["commands"].values()]
    several = [
        *found["commands"].values(),
        *found.get("messages", {}).values(),
        *([] if shared else [*found.get("replies", {}).values(), *replies]),
        *(each for each in responses if isinstance(each, dict) and isinstance(each.get("fields"), dict)),
    ]
    for spec in several:
        number = spec.get("id")
        if number is None or str(number).startswith("request") or rng.random() < 0.5:
            continue
        direction = "request" if "request" in spec else spec.get("direction", "response")
        name, low, high, only = rng.choice(known)
        if only in (None, direction) and ("direction" in spec or "from" not in spec):
            stated = number if isinstance(number, dict) else {_piece(shape): number}
            spec["id"] = {**stated, name: rng.choice((low, high, rng.randint(low, high)))}


def _piece(shape: Shape) -> str:
    """The name of the only piece of the id."""
    for name, spec in shape.frame["parts"].items():
        for inner, each in [("", spec), *(spec.get("bits", {}) if isinstance(spec, dict) else {}).items()]:
            if isinstance(each, dict) and each.get("role") == "message":
                return str(inner or name)
    raise AssertionError("no message id")


def _values(parts: Doc) -> Iterator[tuple[str, int, int, str | None]]:
    """Plain values of a frame, their bounds, and the direction that has them."""
    for name, spec in parts.items():
        if not isinstance(spec, dict) or not re.fullmatch(r"u\d+", str(spec.get("type"))):
            continue
        only = spec.get("if", {}).get("direction") if isinstance(spec.get("if", {}), dict) else ""
        if "if" in spec and not only:
            continue
        if spec.keys() <= {"type", "range", "default", "byteorder", "if", "doc"}:
            yield (name, *_bounds(spec, int(spec["type"][1:])), only)
        for inner, bits in spec.get("bits", {}).items():
            given = bits if isinstance(bits, dict) else {"at": bits}
            if given.keys() <= {"at", "range", "default", "doc"}:
                first, _, last = str(given["at"]).partition("..")
                yield (inner, *_bounds(given, int(last or first) - int(first) + 1), only)


def _bounds(spec: Doc, bits: int) -> tuple[int, int]:
    low, _, high = str(spec.get("range", f"0..{(1 << bits) - 1}")).partition("..")
    return int(low, 0), int(high or low, 0)
