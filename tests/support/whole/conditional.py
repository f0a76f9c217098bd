"""Random parts of a frame that depend on values of its header."""

from __future__ import annotations

import random
from typing import Any

Doc = dict[str, Any]


#: Names of the added values, first of those before the payload.
NAMES = ("hop_count", "zone_id", "seal", "seal_time", "long_size", "late_mark", "late_sum", "late_end")
_ALGORITHMS = (("sum8", "u8"), ("crc-16/xmodem", "u16"), ("fletcher-8", "u16"), ("crc-32/iso-hdlc", "u32"))


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
    size = next(name for name, spec in parts.items() if "counts" in spec)
    if rng.random() < 0.5 and (longer := _longer(rng, parts, size, parts[names[payload]])):
        before = {"long_size": longer}
    most = rng.choice((0, 1, 2) if before else (1, 2))
    after = {name: _value(rng) for name in NAMES[2 : 2 + most]}
    # Drawn from another source: the schemas of earlier seeds stay what they are.
    more = random.Random(repr(rng.getstate()))
    groups = [(group, rng.choice(_tests(signed=signed))) for group in (before, after)]
    if more.random() < 0.4:
        found = _whole(more, parts, [*before])
        alone = more.random() < 0.5
        sized: list[Doc] = [{size: "not 0"}, {size: "3..9"}] if "otherwise" not in parts[size] else []
        test = more.choice([*sized, groups[1][1]]) if alone else groups[1][1]
        after = found if alone else after | found
        groups[1] = after, test
    for group, test in groups:
        for spec in group.values():
            spec.setdefault("if", test)
    ordered |= before | {each: parts[each] for each in names[payload:]} | after
    parts.clear()
    parts.update(ordered)
    for each in names[payload:]:
        _cover(rng, parts[each], names, [*before], payload)


def _whole(rng: random.Random, parts: Doc, before: list[str]) -> Doc:
    """Constants and a check value at the end of a frame."""
    found: Doc = {"late_mark": {"value": "5A"}} if rng.random() < 0.4 else {}
    if not found or rng.random() < 0.8:
        kept = [name for name, spec in parts.items() if spec.get("role") != "checksum" and "if" not in spec]
        at = next(index for index, name in enumerate(kept) if parts[name].get("role") == "payload")
        able = (*kept[:at], *before, *kept[at:], *found)
        covered = [name for name in able if rng.random() < 0.7] or kept[-1:]
        algorithm, kind = rng.choice(_ALGORITHMS)
        found["late_sum"] = {"role": "checksum", "type": kind, "algorithm": algorithm, "over": covered}
        if rng.random() < 0.3:
            found["late_end"] = {"value": "0D 0A"}
    return found


def _longer(rng: random.Random, parts: Doc, size: str, payload: Doc) -> Doc:
    """A length for long payloads, to which the first one hands over; {} if that states every size."""
    first = parts[size]
    repeated = any(size in str(each.get("equals", "")) for each in parts.values())
    most = int(str(payload["size"]).split("..")[-1])
    if "scale" in first or "offset" in first or repeated or "trim" in payload or most < 12:
        return {}
    top = (1 << int(first["type"][1:])) - 1
    otherwise = rng.choice((min(top, most + 90), min(top, 255), top))
    last = rng.choice((9, 11, most // 2)) if most < 200 or otherwise > most else otherwise - 1
    first["otherwise"] = otherwise
    last = min(otherwise - 1, last)
    if last < otherwise - 1 or rng.random() < 0.5:
        first["range"] = f"0..{last}"
    return {"type": rng.choice(("u16", "u16", "u24")), "counts": first["counts"], "if": {size: otherwise}}


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
