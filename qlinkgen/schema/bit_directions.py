"""Second pass, bits that only the frames of one direction have, and the requests that a counter counts.

A part with such bits is two parts of the model, one for each direction.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import get_args

from qlinkgen.model.condition import Test
from qlinkgen.model.frame import Direction, Part, PartBits
from qlinkgen.schema.file_frames import PartBitSpec
from qlinkgen.schema.notation import TestText
from qlinkgen.schema.part_directions import stated_direction
from qlinkgen.schema.report import Reporter, did_you_mean, listed
from qlinkgen.schema.source import Path

_RULE = "part-condition"
#: Roles of bits that all frames have.
_COMMON = ("address", "destination", "source", "direction")


def bits_direction(spec: PartBitSpec, ways: Sequence[str], path: Path, report: Reporter) -> Direction | None:
    """The direction whose frames have bits, None for both; ``ways`` are the names of the direction."""
    tests = [replace(each, field="direction") for each in spec.when or () if each.field in ways]
    if not tests:
        return None
    if spec.role in _COMMON:
        what, hint = f"frames without {path[-1]} would have no {spec.role}", "remove the condition"
        report.error("part-direction", (*path, "if"), what, hint, of_key=True)
        return None
    return stated_direction(tests, f"whether a frame has {path[-1]}", (*path, "if"), report)


def other_tests(spec: PartBitSpec, ways: Sequence[str]) -> tuple[TestText, ...]:
    """What a condition of bits asks beside the direction."""
    return tuple(each for each in spec.when or () if each.field not in ways)


def counted(texts: Sequence[TestText], path: Path, report: Reporter) -> tuple[Test, ...]:
    """The ids of the messages that a counter counts; their pieces are checked by `check_counters`."""
    place = (*path, "if")
    found = []
    for text in texts:
        if named := next((each.text for each in text.wanted if each.name), ""):
            what, hint = f"{named} is not a number of {text.field}", "write a number or a range"
            report.error(_RULE, place, what, hint, of_key=True)
        ranges = tuple((each.first, each.last) for each in text.wanted)
        found.append(Test(text.field, ranges, text.negated))
    return tuple(found)


def check_counters(parts: Sequence[Part], path: Path, report: Reporter) -> None:
    """Check that the message id tells which requests a counter counts."""
    pieces = [bits.name for part in parts for bits in part.bits if bits.role == "message"]
    for part in parts:
        for bits in part.bits:
            for test in bits.counting.when if bits.counting else ():
                if test.value not in pieces:
                    what = f"{test.value} does not tell which requests {bits.name} counts"
                    known = f"name a piece of the message id: {listed(pieces, 'or')}"
                    hint = did_you_mean(test.value, pieces, known if pieces else "remove it")
                    place = (*path, part.name, "bits", bits.name, "if")
                    report.error(_RULE, place, what, hint, of_key=True)


def each_way(parts: Sequence[Part]) -> tuple[Part, ...]:
    """The parts; those with bits of one direction as they are in each."""
    return tuple(each for part in parts for each in _each_way(part))


def _each_way(part: Part) -> Iterator[Part]:
    if not any(bits.only for bits in part.bits):
        yield part
        return
    for way in get_args(Direction):
        if part.only in (None, way):
            yield replace(part, bits=tuple(_of(part.bits, way)), only=way)


def _of(several: Sequence[PartBits], way: str) -> Iterator[PartBits]:
    for bits in several:
        if bits.only in (None, way):
            yield bits
