"""Named types of parts: bits with roles, written once for several frames or parts.

They are put in the place of their name before a file is checked, so that errors in them point at the type.
"""

from __future__ import annotations

from collections.abc import Iterator

from qlinkgen.schema.report import Reporter
from qlinkgen.schema.source import Data, Path, Source

_RULE = "part-type"
#: Mappings whose entries are fields, and places where fields are.
_OF_FIELDS = ("request", "response", "fields", "types", "cases")
_WITH_FIELDS = ("types", "replies", "commands", "messages", "defaults")


def place_part_types(source: Source, report: Reporter) -> None:
    """Replace the names of types with roles by these types; fields cannot have them."""
    data = source.data
    types = data.get("types") if isinstance(data, dict) else None
    if not isinstance(data, dict) or not isinstance(types, dict):
        return
    found = {name: given for name, given in types.items() if isinstance(given, dict) and _has_roles(given)}
    if not found:
        return
    used = set[str]()
    for path, parts in _groups(data):
        for name, part in parts.items():
            own = part if isinstance(part, dict) else {"type": part}
            kind = own.get("type")
            if isinstance(kind, str) and kind in found:
                parts[name] = {**found[kind], **{key: each for key, each in own.items() if key != "type"}}
                _place(source, ("types", kind), (*path, name))
                used.add(kind)
    data["types"] = {name: given for name, given in types.items() if name not in found}
    for name in found.keys() - used:
        what, hint = f"'{name}' is not used", "remove it, or use it as the type of a part"
        report.error("unused-type", ("types", name), what, hint, of_key=True)
    for group in _WITH_FIELDS:
        for path, name in _uses(data.get(group), (group,), found):
            what = f"{name} has bits with roles, which only parts of frames have"
            report.error(_RULE, path, what, "use another type for a field")
            report.taint(path)


def _has_roles(given: dict[str, Data]) -> bool:
    bits = given.get("bits")
    return isinstance(bits, dict) and any(isinstance(each, dict) and "role" in each for each in bits.values())


def _groups(data: dict[str, Data]) -> Iterator[tuple[Path, dict[str, Data]]]:
    """The parts of each frame, and their path."""
    several = data.get("frames")
    found: list[tuple[Path, Data]] = [(("frame",), data.get("frame"))]
    if isinstance(several, dict):
        found += [(("frames", name), each) for name, each in several.items()]
    for path, frame in found:
        parts = frame.get("parts") if isinstance(frame, dict) else None
        if isinstance(parts, dict):
            yield (*path, "parts"), parts


def _place(source: Source, kind: Path, part: Path) -> None:
    """Add the positions of a type in the place of a part."""
    for places in (source.keys, source.values):
        for path, position in [each for each in places.items() if each[0][: len(kind)] == kind]:
            if len(path) > len(kind):
                places.setdefault((*part, *path[len(kind) :]), position)


def _uses(node: Data, path: Path, found: dict[str, dict[str, Data]]) -> Iterator[tuple[Path, str]]:
    """The fields that have one of the types."""
    if isinstance(node, list):
        for index, each in enumerate(node):
            yield from _uses(each, (*path, index), found)
    for key, value in node.items() if isinstance(node, dict) else ():
        place = (*path, key)
        name = value.partition("[")[0].strip() if isinstance(value, str) else ""
        if name in found and (key == "type" or path[-1] in _OF_FIELDS):
            yield place, name
        yield from _uses(value, place, found)
