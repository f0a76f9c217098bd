"""Random parts that only the frames of one direction have."""

from __future__ import annotations

import random
from typing import Any

from tests.support.whole.reference.fields import bits_of_type

Doc = dict[str, Any]
_NAMES = ("origin", "outcome", "stamp")


def add(rng: random.Random, frame: Doc, *, plain: bool) -> None:
    """Put some parts into a frame; ``plain``: they hold few of the bytes."""
    for name in rng.sample(_NAMES, rng.choice((1, 1, 2, 3))):
        _add(rng, frame, name, plain=plain)


def _add(rng: random.Random, frame: Doc, name: str, *, plain: bool) -> None:
    parts, spec = frame["parts"], _part(rng, frame["parts"], plain=plain)
    if any("fault" in each.get("bits", {}) for each in parts.values()):
        # The bits of two parts have different names.
        spec = {"type": "u8", "range": "0..1"} if "bits" in spec else spec
    names = list(parts)
    at = _place(rng, frame, names, constant="value" in spec)
    spec["if"] = {"direction": rng.choice(("request", "response", "not request"))}
    _insert(rng, frame, name, spec, at)


def insert(rng: random.Random, frame: Doc, name: str, spec: Doc) -> None:
    """Put a part somewhere into a frame."""
    _insert(rng, frame, name, spec, _place(rng, frame, list(frame["parts"]), constant=False))


def _insert(rng: random.Random, frame: Doc, name: str, spec: Doc, at: int) -> None:
    parts, names = frame["parts"], list(frame["parts"])
    names.insert(at, name)
    ordered = {each: spec if each == name else parts[each] for each in names}
    if source := spec.pop("of", ""):
        if names.index(source) > at:
            return
        spec["equals"] = source
    parts.clear()
    parts.update(ordered)
    for each in [*parts.values(), *_codings(frame)]:
        _mention(rng, each, name, names)


def _part(rng: random.Random, parts: Doc, *, plain: bool) -> Doc:
    """A constant, a value, bits, or a derived number."""
    sources = [
        name
        for name, spec in parts.items()
        if spec.get("role") in ("address", "message") and "as" not in spec
    ]
    whole = [name for name in sources if str(parts[name]["type"]).startswith("u")]
    kinds: list[Doc] = [
        {"value": "01"} if plain else {"value": rng.choice(("55", "01 02", "5A"))},
        {"type": "u8", "range": "0..1"} if plain else {"type": rng.choice(("u8", "u16", "i24"))},
        {"type": "u8", "bits": {"fault": "0..1", "busy": {"at": 2, "type": "bool"}}},
        {"type": "u8", "const": [1, 2]},
    ]
    if whole and not plain:
        of = rng.choice(whole)
        kinds.append({"type": f"u{bits_of_type(parts[of]['type'])}", "of": of})
    return rng.choice(kinds)


def _place(rng: random.Random, frame: Doc, names: list[str], *, constant: bool) -> int:
    """The index of a part among the others."""
    roles = [frame["parts"][name].get("role") for name in names]
    payload = roles.index("payload")
    blocks = any("every" in frame["parts"][name] for name in names)
    if frame.get("stuffing") or any("over" in each for each in _codings(frame)):
        return payload if blocks or rng.random() < 0.7 else payload + 1
    least = 1 if constant or roles[0] == "constant" or "value" in frame["parts"][names[0]] else 0
    last = roles.index("terminator") if "terminator" in roles else len(names)
    place = rng.randint(least, last)
    return payload if blocks and place == payload + 1 else place


def _codings(frame: Doc) -> list[Doc]:
    coding = frame.get("coding", [])
    return coding if isinstance(coding, list) else [coding]


def _mention(rng: random.Random, spec: Doc, name: str, names: list[str]) -> None:
    """Let what covers or counts parts around the new one cover or count it too, mostly."""
    for key in ("over", "counts"):
        over = spec.get(key)
        if not isinstance(over, list) or "every" in spec or "scale" in spec:
            continue
        known = [names.index(each) for each in over if each in names]
        at = names.index(name)
        inside = known and (min(known) < at < max(known) or "algorithm" not in spec)
        narrow = key == "counts" and spec["type"] == "u8"
        # What has a value for nothing covers the payload alone.
        if inside and not narrow and "otherwise" not in spec and ("type" not in spec or rng.random() < 0.8):
            others = [each for each in over if each not in names]
            over[:] = [each for each in names if each in (name, *over)] + others
