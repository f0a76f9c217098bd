"""Random bits that only the frames of one direction have, and counters of some messages."""

from __future__ import annotations

import random
from typing import Any

from tests.support.whole.reference.notation import whole_span

Doc = dict[str, Any]
#: Names of the added bits.
NAMES = ("asks", "says", "turns")


def add(rng: random.Random, parts: Doc) -> None:
    """Give a part with bits some of one direction; of frames whose messages have directions."""
    found = [spec for spec in parts.values() if "bits" in spec and "if" not in spec]
    others = " ".join(str(spec.get("equals", "")) for spec in parts.values())
    counts = any(
        inner.get("role") == "counter"
        for spec in parts.values()
        for inner in (spec, *(each for each in spec.get("bits", {}).values() if isinstance(each, dict)))
    )
    if not found or rng.random() < 0.4:
        return
    spec = rng.choice(found)
    free = _free(spec)
    if not free or next(name for name, each in parts.items() if each is spec) in others:
        return
    inside = {name: each for name, each in spec["bits"].items() if isinstance(each, dict)}
    ways = [name for name, each in inside.items() if each.get("role") == "direction"]
    way = rng.choice(["direction", *ways])
    own, other = rng.choice((("request", "response"), ("response", "not response")))
    at = rng.choice(free)
    bits: Doc = {"asks": {"at": at, "if": {way: own}}, "says": {"at": at, "if": {way: other}}}
    if not counts and len(free) > 1:
        at = rng.choice([each for each in free if each != at])
        bits["turns"] = {"at": at, "role": "counter", "if": {way: "request"}}
    for name in rng.sample([*bits], rng.randint(1, len(bits))):
        spec["bits"][name] = bits[name]


def _free(spec: Doc) -> list[int]:
    used = set[int]()
    for each in spec["bits"].values():
        low, high = whole_span(each["at"] if isinstance(each, dict) else each)
        used |= {*range(low, high + 1)}
    return [each for each in range(int(spec["type"][1:])) if each not in used]
