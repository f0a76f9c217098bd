"""Random parts of a frame that depend on values of its header."""

from __future__ import annotations

import random
from typing import Any

Doc = dict[str, Any]


#: Names of the added values, first of those before the payload.
NAMES = ("hop_count", "zone_id", "seal", "seal_time")


def add(rng: random.Random, frame: Doc) -> None:
    """Put values that only some frames have before the payload, or at the end, if the frame may have them."""
    parts: Doc = frame["parts"]
    roles = [spec.get("role") for spec in parts.values()]
    stuffed = "stuffing" in frame or "terminator" in roles or any("every" in each for each in parts.values())
    if stuffed or not any("counts" in spec for spec in parts.values()):
        return
    names, payload = list(parts), roles.index("payload")
    signed = rng.random() < 0.3
    degree = {"at": "1..3", "signed": signed}
    conduct: Doc = {"type": "u8", "bits": {"whole": {"at": 0, "type": "bool"}, "degree": degree}}
    at = rng.randint(int(payload > 0), payload)
    ordered = {**{each: parts[each] for each in names[:at]}, "conduct": conduct}
    ordered |= {each: parts[each] for each in names[at:payload]}
    before = {name: _value(rng) for name in NAMES[: rng.choice((0, 1, 2))]}
    most = rng.choice((0, 1, 2) if before else (1, 2))
    after = {name: _value(rng) for name in NAMES[2 : 2 + most]}
    for group in (before, after):
        test = rng.choice(_tests(signed=signed))
        for spec in group.values():
            spec["if"] = test
    ordered |= before | {each: parts[each] for each in names[payload:]} | after
    parts.clear()
    parts.update(ordered)
    for each in [*parts][len(names[:payload]) + 1 + len(before) :]:
        _cover(rng, parts[each], names, [*before], payload)


def _tests(*, signed: bool) -> list[str | Doc]:
    low = -4 if signed else 0
    return [
        "whole",
        "conduct.whole",
        {"whole": False},
        {"degree": f"{low}..1"},
        {"degree": "not 2"},
        {"degree": [low, 3]},
        {"whole": True, "conduct.degree": "not 0..1"},
    ]


def _value(rng: random.Random) -> Doc:
    spec: Doc = {"type": rng.choice(("u8", "u16", "i8", "i24", "u40"))}
    if rng.random() < 0.4:
        spec |= {"default": rng.choice((1, 5, 100))}
    elif rng.random() < 0.3:
        spec |= {"range": "2..90", "default": 2}
    return spec


def _cover(rng: random.Random, spec: Doc, names: list[str], added: list[str], payload: int) -> None:
    """Let a check value after the payload cover the new parts before it, mostly."""
    over = spec.get("over")
    if not isinstance(over, list) or "otherwise" in spec or rng.random() < 0.2:
        return
    others = [each for each in over if each not in names]
    front = [each for each in over if each in names[:payload]]
    over[:] = [*front, *added, *(each for each in over if each in names[payload:]), *others]
