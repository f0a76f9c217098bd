"""How a schema file is read: numbers, ranges and bytes as they are written."""

from __future__ import annotations

import re
from fractions import Fraction
from typing import Any, Literal

import yaml

Doc = dict[str, Any]


Direction = Literal["request", "response", "message"]


Role = Literal["value", "constant", "reserved", "count", "filled"]


class Prefixed(int):
    """A number written as 0x10, not as 16: where bytes are expected, only the second is a pair of digits."""


class _Loader(yaml.CSafeLoader):
    """Loads numbers with a decimal point exactly; on, off, yes and no as text."""

    def exact(self, node: yaml.ScalarNode) -> Fraction:
        """The exact number."""
        return Fraction(node.value)

    def number(self, node: yaml.ScalarNode) -> int:
        value = int(self.construct_yaml_int(node))
        return value if node.value.isdecimal() else Prefixed(value)


_Loader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in pairs if tag != "tag:yaml.org,2002:bool"]
    for first, pairs in _Loader.yaml_implicit_resolvers.items()
}


_Loader.add_implicit_resolver("tag:yaml.org,2002:bool", re.compile(r"true\Z|false\Z"), list("tf"))


_Loader.add_constructor("tag:yaml.org,2002:float", _Loader.exact)


_Loader.add_constructor("tag:yaml.org,2002:int", _Loader.number)


def _newest(node: Any) -> Any:
    """What the newest version of the protocol has."""
    if isinstance(node, list):
        return [_newest(each) for each in node]
    if not isinstance(node, dict):
        return node
    return {
        name: _newest(each) for name, each in node.items() if not (isinstance(each, dict) and "until" in each)
    }


def _named(document: Doc) -> None:
    """Replace the names of types of parts by these, which fields do not have."""
    types = document.get("types", {})
    for frame in (document.get("frame", {}), *document.get("frames", {}).values()):
        parts = frame.get("parts", {})
        for name, spec in parts.items():
            kind = spec.get("type") if isinstance(spec, dict) else spec
            given = types.get(kind) if isinstance(kind, str) else None
            if given and _has_roles(given):
                own = {key: each for key, each in spec.items() if key != "type"} if spec != kind else {}
                parts[name] = {**given, **own}
    document["types"] = {name: each for name, each in types.items() if not _has_roles(each)}


def _proven(document: Doc) -> None:
    """Write a check value over the request, a part of a kind of frame, as the last field of its responses."""
    for name, frame in document.get("frames", {}).items():
        (payload, *_), last = frame["parts"], list(frame["parts"])[-1]
        check = frame["parts"][last]
        if not isinstance(check, dict) or "request." not in str(check.get("over")):
            continue
        del frame["parts"][last]
        low, high = map(int, frame["parts"][payload]["size"].split(".."))
        size = int(check["type"][1:]) // 8
        frame["parts"][payload]["size"] = f"{low + size}..{high + size}"
        for command in document["commands"].values():
            response = command.get("response")
            if isinstance(response, dict) and response.get("frame") == name:
                response["fields"][last] = {**check}


def _has_roles(kind: Any) -> bool:
    """Whether the bits of a type, which may be a name in short, have roles."""
    return isinstance(kind, dict) and "'role'" in str(kind.get("bits"))


def load(text: str) -> Doc:
    """The plain data of a schema file."""
    document: Doc = _newest(yaml.load(text, _Loader))
    _named(document)
    _proven(document)
    parts = document.get("frame", {}).get("parts", {})
    # Silence has no bytes, and frames end without it unless nothing else ends them.
    for name in [
        name
        for name, spec in parts.items()
        if isinstance(spec, dict) and spec.get("role") in {"idle", "break"}
    ]:
        document["frame"]["silent"] = parts.pop(name).get("alone", False)
    stuffed(document.get("frame", {}), parts)
    return document


def stuffed(frame: Doc, parts: Doc) -> None:
    """Write the insertion into a frame that is read from left to right as stuffing."""
    coding = frame.get("coding")
    if isinstance(coding, dict) and "add" in coding and coding.get("checked") == "after":
        frame["plus"] = octets(frame.pop("coding")["add"])[0]
        return
    ended = any(isinstance(spec, dict) and spec.get("role") == "terminator" for spec in parts.values())
    if not isinstance(coding, dict) or "insert" not in coding or ended or frame.get("silent"):
        return
    del frame["coding"]
    first = next(iter(parts))
    constant = not isinstance(parts[first], dict) or {"value", "text"} & parts[first].keys()
    over = coding.get("over", list(parts)[int(bool(constant)) :])
    frame["stuffing"] = {"after": coding["after"], "insert": coding["insert"]}
    if coding.get("checked") == "after":
        frame["stuffing"]["checksum"] = "after"
    else:
        frame["stuffing"]["exempt"] = [name for name in parts if name not in over]


def exact(given: object) -> Fraction:
    """A number in any of its notations."""
    text = str(given).replace(" ", "").replace("_", "")
    if text.lower().startswith("0x"):
        return Fraction(int(text, 16))
    if "^" in text:
        top, base, power = re.split(r"[/^]", text)
        return Fraction(int(top), int(base) ** int(power))
    if "/" in text:
        top, below = text.split("/")
        return Fraction(top) / int(below)
    return Fraction(text)


def span(given: object) -> tuple[Fraction, Fraction]:
    """A range, or one number."""
    first, _, last = str(given).partition("..")
    return exact(first), exact(last or first)


def whole_span(given: object) -> tuple[int, int]:
    """A range of whole numbers."""
    first, last = span(given)
    return int(first), int(last)


def octets(given: object) -> bytes:
    """Pairs of hex digits, to YAML a number if they are two decimal ones; or a number."""
    if isinstance(given, Prefixed) or (isinstance(given, int) and not 10 <= given <= 99):
        return bytes([given])
    return bytes.fromhex(str(given))


def as_doc(given: Any) -> Doc:
    return given if isinstance(given, dict) else {"at": given}


def part_doc(given: object) -> Doc:
    """A part of a frame with its role; a short form becomes a mapping."""
    if not isinstance(given, dict):
        pairs = isinstance(given, int) or re.fullmatch("([0-9A-F]{2} ?)+", str(given))
        given = {"value" if pairs else "type": given}
    told = {
        "bits": "bits",
        "equals": "derived",
        "const": "constant",
        "value": "constant",
        "text": "constant",
        "counts": "length",
        "algorithm": "checksum",
    }
    return {"role": next((role for key, role in told.items() if key in given), "value"), **given}


def of_way(given: object, direction: str) -> object:
    """A part without the bits that only the frames of the other direction have; "" for all bits."""
    if not isinstance(given, dict) or "bits" not in given or not direction:
        return given
    ways = ("", "request" if direction == "request" else "response")
    return {**given, "bits": {name: each for name, each in given["bits"].items() if bits_way(each) in ways}}


def bits_way(given: object) -> str:
    """The direction whose frames have some bits, "" for both."""
    tests = given.get("if", {}) if isinstance(given, dict) else {}
    named = [each for each in tests.values() if isinstance(each, str)]
    way = next((each for each in named if each.removeprefix("not ") in ("request", "response")), "")
    other = {"not request": "response", "not response": "request"}
    return other.get(way, way)


def whole_or_negative(given: object) -> tuple[int, int]:
    """A range of integers."""
    first, last = span(given)
    return int(first), int(last)
