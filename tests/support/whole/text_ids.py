"""Message ids of several lengths, in place of numbers."""

from __future__ import annotations

import random
from typing import Any

Doc = dict[str, Any]
#: None begins like another.
_APART = ("S", "MEAS:VOLT?", "*IDN?", "DPT", "Z0", "g", "+", "CONF:VOLT:RANG", "X9Y8", "_a", "#1", "PMTK605")
#: Many begin like others.
_ALIKE = ("S", "SI", "SIX", "*IDN?", "MEAS", "MEAS:VOLT?", "SIC", "Z", "ZZ", "*", "MEAS:CURR?", "M")


def draw(rng: random.Random, document: Doc) -> None:
    """Let the ids of some schemas be texts of several lengths."""
    frame = document.get("frame", {})
    parts: Doc = frame.get("parts", {})
    name = next((each for each, spec in parts.items() if _has_role(spec, "message")), "")
    data = next((each for each, spec in parts.items() if _has_role(spec, "payload")), "")
    if not name or not _fits(document, name, data) or rng.random() < 0.3:
        return
    texts = _Texts(rng)
    groups = [*document.get("commands", {}).values(), *document.get("messages", {}).values()]
    groups += document.get("replies", {}).values()
    for spec in list(groups):
        groups += spec.get("replies", {}).values()
        groups += [each for each in [spec.get("response")] if isinstance(each, dict) and "id" in each]
        groups += [each for step in spec.get("steps", ()) for each in step.values() if isinstance(each, dict)]
    common = document.get("defaults", {}).get("response", {})
    if "id" in common:
        common["id"] = texts.of(name, common["id"]) if rng.random() < 0.5 else ""
    for spec in groups:
        if "id" in spec and isinstance(spec["id"], int | dict):
            spec["id"] = texts.of(name, spec["id"])
    used = [*texts.given.values(), *([""] if common.get("id") == "" else [])] or ["S"]
    least, most = min(map(len, used)), max(map(len, used))
    kind: Doc = {"role": "message", "type": f"text[{least if least < most else least - 1}..{most}]"}
    kind |= {"ignore_case": True} if rng.random() < 0.3 else {}
    moved: Doc = {}
    for each, spec in parts.items():
        if each == data:
            moved[name] = kind
        if each != name:
            moved[each] = _covering(spec, name, data)
    frame["parts"] = moved


class _Texts:
    def __init__(self, rng: random.Random) -> None:
        known = list(_ALIKE if rng.random() < 0.5 else _APART)
        rng.shuffle(known)
        self._free, self.given = known, dict[str, str]()

    def of(self, name: str, number: Any) -> Any:
        """The text in place of a number, which may be stated beside values."""
        if isinstance(number, dict):
            return {**number, name: self.of(name, number[name])} if name in number else number
        if str(number) not in self.given:
            self.given[str(number)] = self._free.pop() if self._free else f"Q{len(self.given)}"
        return self.given[str(number)]


def _covering(spec: Any, name: str, data: str) -> Any:
    """A part that covers the id where it covers the payload."""
    if not isinstance(spec, dict):
        return spec
    changed = dict(spec)
    for key in {"over", "counts"} & spec.keys():
        given = [spec[key]] if isinstance(spec[key], str) else spec[key]
        kept = [each for each in given if each != name]
        changed[key] = [each for part in kept for each in ((name, part) if part == data else (part,))]
    return changed


def _has_role(spec: Any, role: str) -> bool:
    return isinstance(spec, dict) and spec.get("role") == role


def _fits(document: Doc, name: str, data: str) -> bool:
    """Whether the ids of a schema can be texts of several lengths."""
    frame, whole = document["frame"], str(document)
    parts = frame["parts"]
    specs = [spec for spec in parts.values() if isinstance(spec, dict)]
    ended = any("counts" in spec or spec.get("role") == "terminator" or spec.get("alone") for spec in specs)
    alone = all(
        name not in given or given != [name]
        for spec in specs
        for key in ("over", "counts")
        for given in ([spec[key]] if isinstance(spec.get(key), str) else [spec.get(key, [])])
    )
    odd = ("request.id", f"request.{name}'", f"equals': '{name}", f"equals': '~{name}", "to_unknown",
           "'trim'", "'every'", "attribute.", "'scale'", "after'", "'otherwise'")  # fmt: skip
    several = sum(_has_role(spec, role) for spec in specs for role in ("message", "direction"))
    several += str([spec.get("bits") for spec in specs]).count("'message'")
    several += str([spec.get("bits") for spec in specs]).count("'direction'")
    steady = not any(each in str(parts) + str(frame.get("stuffing")) for each in odd)
    counting = f"'if': {{'{name}'" in whole or "request.id" in whole or f"request.{name}'" in whole
    plain = "to_unknown" not in document and "empty_request" not in whole
    return bool(data) and ended and alone and several == 1 and steady and not counting and plain
