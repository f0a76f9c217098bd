"""Random texts as values of every frame."""

from __future__ import annotations

import random
from typing import Any

from tests.support.whole.reference.fields import bits_of_type

Doc = dict[str, Any]

#: Keys of a value that becomes a text.
_KEPT = ("if", "type")


def add(rng: random.Random, parts: Doc) -> None:
    """Let some values of a frame be texts, if nothing else depends on them."""
    end = next((spec.get("value", "") for spec in parts.values() if spec.get("role") == "terminator"), "")
    others = " ".join(f"{spec.get('equals', '')} {spec.get('if', '')}" for spec in parts.values())
    counted = {name for spec in parts.values() for name in _names(spec.get("counts", []))}
    for name, spec in parts.items():
        told = spec.keys() - {"byteorder", "range", "scale", "offset", "default", "unit", *_KEPT}
        if told or "type" not in spec or name in others or rng.random() < 0.6:
            continue
        size = rng.choice((1, 2, 2, 3, 4, 5, 8))
        if name in counted:
            # The length has been drawn for its size.
            size = bits_of_type(spec["type"]) // 8
        letters = [each for each in "GPabc 0~" if f"{ord(each):02X}" not in end]
        text = "".join(rng.choice(letters) for _ in range(size))
        given = {"default": text} if rng.random() < 0.7 or " " not in letters else {}
        if text.strip() != text or text.isdecimal():
            given = {"default": "x" * size} if "78" not in end else {}
        parts[name] = {**{key: spec[key] for key in _KEPT if key in spec}, "type": f"text[{size}]", **given}


def _names(counts: str | list[str]) -> list[str]:
    return [counts] if isinstance(counts, str) else counts
