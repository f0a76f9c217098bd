"""Random frames with a destination and a source, of which the one that is not the node is the master."""

from __future__ import annotations

import random
from typing import Any

from tests.support.whole import one_way
from tests.support.whole.reference.fields import bits_of_type
from tests.support.whole.reference.notation import whole_span

Doc = dict[str, Any]
_ROLES = ("destination", "source")


def add(rng: random.Random, frame: Doc) -> int:
    """Make the address one of both roles, and add a part with the other; the bits of the smaller one.

    0 if the frame has no address.
    """
    parts: Doc = frame["parts"]
    at = [
        (spec, inner)
        for spec in parts.values()
        for inner in (spec, *spec.get("bits", {}).values())
        if isinstance(inner, dict) and inner.get("role") == "address"
    ]
    if not at or "as" in at[0][1]:
        return 0
    (spec, inner), name, roles = at[0], "partner", rng.sample(_ROLES, 2)
    low, high = whole_span(inner["at"]) if "at" in inner else (0, bits_of_type(spec["type"]) - 1)
    bits = high + 1 - low
    inner["role"] = roles[0]
    used = {each for one in spec.get("bits", {}).values() for each in _places(one)}
    free = [each for each in range(bits_of_type(spec["type"])) if each not in used]
    if "bits" in spec and free and free[-1] - free[0] + 1 == len(free) and len(free) <= 8 >= bits:
        spec["bits"][name] = {"at": f"{free[0]}..{free[-1]}", "role": roles[1]}
        return min(bits, len(free))
    wide = next(each for each in (8, 16, 32, 64) if bits <= each)
    other: Doc = {"type": f"u{wide}", "role": roles[1]}
    one_way.insert(rng, frame, name, other)
    return min(bits, bits_of_type(other["type"]))


def _places(bits: Any) -> range:
    low, high = whole_span(bits["at"] if isinstance(bits, dict) else bits)
    return range(low, high + 1)
