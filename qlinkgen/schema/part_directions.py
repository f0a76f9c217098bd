"""Second pass, parts that only the frames of one direction have."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import get_args

from qlinkgen.model.frame import DelimitedFrame, Direction, Part
from qlinkgen.schema.file_frames import PartSpec
from qlinkgen.schema.notation import TestText
from qlinkgen.schema.report import Reporter
from qlinkgen.schema.source import Path

_RULE = "part-direction"
_DIRECTIONS: tuple[Direction, ...] = get_args(Direction)
#: Roles without which a frame cannot be found, or its message told.
_COMMON = ("payload", "message", "address", "direction", "length", "terminator", "counter", "idle", "break")


def direction_of(spec: PartSpec, report: Reporter, path: Path) -> Direction | None:
    """The direction whose frames have a part, None for both."""
    if spec.when is None or not any(test.field == "direction" for test in spec.when):
        return None
    place, name = (*path, "if"), path[-1]
    roles = [spec.told, *(bits.role for bits in (spec.bits or {}).values())]
    if common := next((role for role in roles if role in _COMMON), None):
        what = f"frames without {name} would have no {common}"
        report.error(_RULE, place, what, "remove the condition", of_key=True)
        return None
    return stated_direction(spec.when, f"whether a frame has {name}", place, report)


def stated_direction(
    when: Sequence[TestText], decided: str, place: Path, report: Reporter
) -> Direction | None:
    """The direction that a condition states, None after an error; ``decided`` is what it decides."""
    if len(when) == 1 and when[0].field == "direction":
        test = when[0]
        named = {wanted.name for wanted in test.wanted}
        found = [each for each in _DIRECTIONS if (each in named) != test.negated]
        if named <= {*_DIRECTIONS} and len(found) == 1:
            return found[0]
    what = f"the direction and nothing else must decide {decided}"
    hint = "write {direction: request} or {direction: response}, or name other values"
    report.error(_RULE, place, what, hint, of_key=True)
    return None


def check_directions(
    frame: DelimitedFrame, specs: Mapping[str, PartSpec], path: Path, report: Reporter
) -> None:
    """Check that the frames of both directions can be made, and found by one receiver."""
    for part in frame.parts:
        for key, whole in (("over", specs[part.name].over), ("counts", specs[part.name].counts)):
            ways = [frame.towards(each) for each in _DIRECTIONS if part.only in (None, each)]
            if whole and not all(_named(way, part.name, key) for way in ways):
                doing = "cover" if key == "over" else "count"
                what = f"{part.name} has nothing to {doing} in the frames of one direction"
                report.error(_RULE, (*path, part.name, key), what, "name a part that they have", of_key=True)
        source = next((each for each in frame.parts if _follows(part, each)), None)
        both = source is not None and all(
            any(each.name == source.name for each in frame.towards(way).parts) for way in _DIRECTIONS
        )
        if source and source.only and source.only != part.only and not both:
            what = f"{part.name} follows from {source.name}, which only a {source.only} has"
            report.error(_RULE, (*path, part.name, "equals"), what, "give both the same if", of_key=True)
    # Each of several kinds has a search of its own for each direction.
    if path[0] == "frame" and not report.failed:
        _check_search(frame, report)


def _follows(part: Part, source: Part) -> bool:
    return part.derivation is not None and part.derivation.of == source.name


def _named(frame: DelimitedFrame, name: str, key: str) -> tuple[str, ...]:
    """The parts of a frame that one of them covers or counts."""
    part = next(each for each in frame.parts if each.name == name)
    return part.counts if key == "counts" else part.checksum.over if part.checksum else ()


def _check_search(frame: DelimitedFrame, report: Reporter) -> None:
    """Check that one receiver finds the frames of both directions."""
    # Imported here because most schemas have no such parts.
    from qlinkgen.plan.framing import frame_plan  # noqa: PLC0415

    first, other = (frame_plan(frame, each).search for each in _DIRECTIONS)
    conditional = [part for part in frame.parts if part.only]
    if wrong := next((what for what in first if first[what] != other[what]), ""):
        place = ("frame", "parts", conditional[0].name, "if")
        what = f"the frames of requests and responses differ in {wrong}"
        hint = "let both have the same, or write a schema for each direction"
        report.error(_RULE, place, what, hint, of_key=True)
