"""Fields that depend on values of every frame."""

from __future__ import annotations

import random
from collections.abc import Iterator
from typing import Any

from tests.support.whole.frames import Shape

Doc = dict[str, Any]
#: A value of a frame, its bounds, and the direction that has it.
Value = tuple[str, int, int, str | None]
#: Keys of fields that have conditions of their own, or that the codec fills.
_KEPT = {"if", "optional", "counts", "switch", "terminator", "last", "algorithm", "equals", "echo", "packed"}
#: Keys of parts and bits that hold a value.
_PLAIN = {"type", "at", "signed", "range", "default", "byteorder", "doc", "if"}
#: Largest bound: numbers of tests have at most 64 bits.
_MOST = 1 << 64
#: Payloads of this size have room for more fields.
_WIDE = 48


def decide(rng: random.Random, shape: Shape, found: Doc) -> None:
    """Let fields of some messages depend on values of their frames."""
    parts = shape.frame.get("parts", {})
    payload = next((spec for spec in parts.values() if isinstance(spec, dict) and "size" in spec), {})
    plain = shape.kind == "parts" and shape.has_length and shape.word <= 1 and not shape.groups
    if not plain or "trim" in payload or "separator" in found.get("defaults", {}):
        return
    if not [*_values(parts)] and not {"stuffing", "coding"} & shape.frame.keys():
        _insert(rng, parts)
    known = [*_values(parts)]
    for spec in found["commands"].values() if known else ():
        _add_form(rng, spec, [each for each in known if each[3] in (None, "response")], shape.most)
    for direction, spec, fields in _several(found) if known else ():
        settled = {name for name, *_ in known} & {*(spec["id"] if isinstance(spec.get("id"), dict) else ())}
        if settled or "separator" in spec or "empty_request" in spec:
            continue
        named = [each for each in known if each[3] in (None, direction)]
        if named and rng.random() < 0.8:
            _condition(rng, fields, rng.choice(named), wide=shape.most >= _WIDE)


def _add_form(rng: random.Random, spec: Doc, known: list[Value], most: int) -> None:
    """Give the response of a command another form, which a value picks."""
    response = spec.get("response")
    if not known or most < _WIDE or not isinstance(response, dict) or rng.random() < 0.3:
        return
    fields = response.get("fields", response)
    identified = isinstance(spec.get("id"), dict) or isinstance(response.get("id"), dict)
    if identified or {"steps", "many", "separator"} & spec.keys() or "separator" in response:
        return
    if not all(_is_alone(name, each, fields) for name, each in fields.items()):
        return
    name, low, high, _ = rng.choice(known)
    if low < high:
        test = rng.choice((low, high, f"not {low}", f"{low}..{(low + high) // 2}"))
        means = rng.choice(({}, {}, {"means": "again"}))
        reply = {"if": {name: test}, "fields": {"reason": rng.choice(("u8", "bool", "u16"))}, **means}
        spec["replies"] = {**spec.get("replies", {}), "otherwise": reply}


def _insert(rng: random.Random, parts: Doc) -> None:
    """Add a value of every frame."""
    form = rng.choice(
        (
            {"type": "u8"},
            {"type": "i8", "range": "-3..5"},
            {"type": "u8", "bits": {"form": "1..3", "long": 6}},
        )
    )
    listed = list(parts.items())
    listed.insert(rng.randint(int(len(listed) > 1), len(listed) - 1), ("form_part", form))
    parts.clear()
    parts.update(listed)


def _values(parts: Doc) -> Iterator[Value]:
    """The values of a frame that a condition may test."""
    for name, spec in parts.items():
        if not isinstance(spec, dict):
            continue
        only = spec.get("if", {}).get("direction") if isinstance(spec.get("if", {}), dict) else ""
        if "if" in spec and not only:
            continue
        if spec.keys() <= _PLAIN and (bounds := _bounds(spec, 0)):
            yield (name, *bounds, only)
        for inner, given in spec.get("bits", {}).items():
            bits = given if isinstance(given, dict) else {"at": given}
            first, _, last = str(bits.get("at", 0)).partition("..")
            if bits.keys() <= _PLAIN - {"if"} and (
                bounds := _bounds(bits, int(last or first) - int(first) + 1)
            ):
                yield (inner, *bounds, only)


def _bounds(spec: Doc, bits: int) -> tuple[int, int] | None:
    """The bounds of a number, None of another type."""
    kind = str(spec.get("type", f"{'i' if spec.get('signed') else 'u'}{bits}"))
    if kind[:1] not in "ui" or not kind[1:].isdecimal():
        return None
    half = 1 << int(kind[1:]) - 1
    low, high = (-half, half - 1) if kind[0] == "i" else (0, 2 * half - 1)
    first, _, last = str(spec.get("range", f"{low}..{high}")).partition("..")
    bounds = int(first, 0), int(last or first, 0)
    return bounds if bounds[1] < _MOST else None


def _several(found: Doc) -> Iterator[tuple[str, Doc, Doc]]:
    """The direction of a message, what states its id, and its fields."""
    for spec in found["commands"].values():
        if "steps" in spec or "many" in spec or "otherwise" in spec.get("replies", {}):
            continue
        response = spec.get("response")
        if isinstance(spec.get("request"), dict):
            yield "request", spec, spec["request"]
        if isinstance(response, dict):
            fields = response.get("fields", response)
            yield "response", response if fields is not response else spec, fields
    for spec in found.get("messages", {}).values():
        yield spec.get("direction", "message"), spec, spec["fields"]


def _is_alone(name: str, spec: Any, fields: Doc) -> bool:
    """Whether a field may be absent: no other one tells its size or depends on it."""
    own = spec if isinstance(spec, dict) else {"type": spec}
    others = str({each: other for each, other in fields.items() if each != name})
    return not (_KEPT & own.keys() or "[" in str(own["type"]) or name in others)


def _condition(rng: random.Random, fields: Doc, value: Value, *, wide: bool) -> None:
    """Let a field, or two, depend on a value, and perhaps a new one begin or a choice by it end the message.

    `wide`: there is room for more fields.
    """
    name, low, high, _ = value
    text = str(fields)
    if "packed" in text and ".." in text:
        return
    tests = (low, high, f"not {low}", f"{low}..{(low + high) // 2}", [low, high])
    test = low if low == high else rng.choice(tests)
    open_at = [at for at, spec in enumerate(fields.values()) if _may_rest(spec)]
    names = [*fields][: open_at[0] if open_at else None]
    filled = "algorithm" in text or "equals" in text or "request." in text
    alone = [] if filled else [each for each in names if _is_alone(each, fields[each], fields)]
    for field in rng.sample(alone, min(len(alone), rng.choice((1, 1, 2)))):
        spec = fields[field] if isinstance(fields[field], dict) else {"type": fields[field]}
        fields[field] = {**spec, "if": {name: test}}
    if not wide:
        return
    if not alone or rng.random() < 0.3:
        others = dict(fields)
        fields.clear()
        fields["decided"] = {"type": rng.choice(("u8", "i8", "bool")), "if": {name: test}}
        fields.update(others)
    if low < high and not open_at and "optional" not in text and rng.random() < 0.5:
        cases: dict[object, Any] = {low: "u8", f"{low + 1}..{high}": rng.choice(("u8", "bool", "i8"))}
        fields["chosen"] = {"switch": name, "cases": cases}
        if high - low > 1 and rng.random() < 0.5:
            cases = {low: {}, high: {"inside": "u8"}}
            fields["chosen"] = {"switch": name, "cases": cases, "default": rng.choice(("u8", "bytes[0..3]"))}


def _may_rest(spec: Any) -> bool:
    """Whether a field may take the rest of the payload, or varies with it."""
    own = spec if isinstance(spec, dict) else {"type": spec}
    kinds = str(own.get("cases", own.get("type")))
    return "switch" in own or ".." in kinds or "[]" in kinds or kinds in ("bytes", "text") or "[" in kinds
