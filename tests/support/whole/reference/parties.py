"""The destination and the source of frames: the node is that of a request, and the source of a response."""

from __future__ import annotations

from typing import Any

from tests.support.whole.reference.notation import Doc, part_doc, whole_span

#: The direction in which a role is that of the master.
_OF_MASTER = {"destination": "response", "source": "request"}


def has_parties(document: Doc) -> bool:
    """Whether frames have a destination or a source."""
    specs = [part_doc(each) for each in document["frame"].get("parts", {}).values()]
    return any(inner.get("role") in _OF_MASTER for spec in specs for inner in _roles(spec))


def asks(document: Doc) -> bool:
    """Whether nodes answer masters; a link may have messages alone."""
    return document["bus"]["kind"] != "link" or bool(document.get("commands"))


def most(document: Doc) -> int:
    """The highest number that every party of frames can have."""
    specs = [part_doc(each) for each in document["frame"]["parts"].values()]
    found = [(spec, inner) for spec in specs for inner in _roles(spec) if inner.get("role") in _OF_MASTER]
    sizes = []
    for spec, inner in found:
        low, high = whole_span(inner["at"]) if "at" in inner else (0, int(spec["type"][1:]) - 1)
        sizes.append(high + 1 - low)
    return (1 << min(sizes, default=1)) - 1


def told(given: object, direction: str, document: Doc) -> object:
    """A part as it is in a direction: with an address, or with the number of the master as a value."""
    bus = {**document["bus"], "most": most(document), "silent": not asks(document)}
    spec = part_doc(given)
    if not any(inner.get("role") in _OF_MASTER for inner in _roles(spec)):
        return given
    if "bits" in spec:
        return {
            **spec,
            "bits": dict(_bits(name, each, direction, bus) for name, each in spec["bits"].items()),
        }
    whole = {key: value for key, value in spec.items() if key not in ("role", "if")}
    if bus["silent"]:
        return {**whole, "role": "value", **_in_range(spec["role"], bus)}
    if "if" in spec:
        return {**whole, "role": "value", **_master(bus)}
    if _OF_MASTER[spec["role"]] != direction:
        return {**whole, "role": "address"}
    last = int(spec["type"][1:]) - 1
    return {**whole, "role": "bits", "bits": {"master": {"at": f"0..{last}", **_master(bus)}}}


def _bits(name: str, given: Any, direction: str, bus: Doc) -> tuple[str, Any]:
    """Bits of a part and their name, as they are in a direction."""
    if not isinstance(given, dict) or given.get("role") not in _OF_MASTER:
        return name, given
    if bus["silent"]:
        return name, {"at": given["at"], **_in_range(given["role"], bus)}
    if _OF_MASTER[given["role"]] == direction:
        return "master", {"at": given["at"], "type": _number(given["at"]), **_master(bus)}
    return "node", {**given, "role": "address"}


def _master(bus: Doc) -> Doc:
    if bus["kind"] == "link":
        low, high = whole_span(bus["nodes"])
        return {"range": f"{low}..{high}", "default": bus.get("master", low)}
    return {"range": f"0..{bus['most']}", "default": bus["master"]}


def _number(at: Any) -> str:
    """The type of bits: a single one is a number too."""
    first, last = whole_span(at)
    return f"u{last + 1 - first}"


def _in_range(role: str, bus: Doc) -> Doc:
    if "nodes" not in bus:
        return {}
    low, high = whole_span(bus["nodes"])
    both = [low, high, bus.get("broadcast", low)] if role == "destination" else [low, high]
    return {"range": f"{min(both)}..{max(both)}", "default": low}


def _roles(spec: Doc) -> list[Doc]:
    return [spec, *(each for each in spec.get("bits", {}).values() if isinstance(each, dict))]
