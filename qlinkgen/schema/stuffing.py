"""Second pass, stuffing: another notation of a coding; checks that a preamble stays unique."""

from __future__ import annotations

from collections.abc import Sequence

from qlinkgen.model.coding import Insert
from qlinkgen.model.frame import DelimitedFrame, Part
from qlinkgen.schema.file_frames import StuffingSpec
from qlinkgen.schema.parts import PartBuilder
from qlinkgen.schema.report import Reporter
from qlinkgen.schema.source import Path

_PATH: Path = ("frame", "stuffing")


def build_stuffing(
    spec: StuffingSpec, parts: tuple[Part, ...], builder: PartBuilder, report: Reporter
) -> tuple[Insert, tuple[str, ...], bool]:
    """The coding, the names of the coded parts, and whether check values cover the coded bytes."""
    builder.known(spec.exempt, [part.name for part in parts], (*_PATH, "exempt"))
    if len(spec.insert) != 1:
        what = f"{len(spec.insert)} bytes cannot be inserted"
        report.error("bad-value", (*_PATH, "insert"), what, "write one byte, like 0x00")
    exempt = tuple(spec.exempt)
    after_stuffing = spec.checksum == "after"
    if after_stuffing:
        exempt = _all_but_payload(spec, parts, report)
        check_end(parts, (*_PATH, "checksum"), ("frame", "parts"), report)
    else:
        _check_middle(exempt, parts, report)
    payload = next(part for part in parts if part.role == "payload")
    if payload.name in spec.exempt:
        what = f"{payload.name} is exempt, so stuffing has no effect"
        report.error(
            "bad-frame",
            (*_PATH, "exempt"),
            what,
            f"remove {payload.name}, or the stuffing",
            needs=((*_PATH, "exempt"),),
        )
    stuffed = tuple(part.name for part in parts if part.name not in exempt)
    return Insert(spec.after, spec.insert[0]), stuffed or (payload.name,), after_stuffing


def _all_but_payload(spec: StuffingSpec, parts: tuple[Part, ...], report: Reporter) -> tuple[str, ...]:
    """All parts except the payload: length and checksum apply to stuffed bytes and cannot be stuffed."""
    others = tuple(part.name for part in parts if part.role != "payload")
    missing = [name for name in others if name not in spec.exempt]
    if spec.exempt and missing:
        what = f"{missing[0]} would be stuffed, though the checksum is computed after the stuffing"
        hint = "exempt all parts except the payload, or omit exempt"
        report.error("bad-frame", (*_PATH, "exempt"), what, hint)
    return others


def check_end(parts: Sequence[Part], place: Path, frame: Path, report: Reporter) -> None:
    """Check that a payload stuffed before the checksum has a length and a checksum.

    ``place`` is the path of what says so, ``frame`` that of the parts.
    """
    roles = [part.role for part in parts]
    needs = (place, frame)
    if "checksum" not in roles:
        what, hint = "the frame has no checksum to compute after the stuffing", "remove it, or add a checksum"
        report.error("bad-frame", place, what, hint, needs=needs)
    if "length" not in roles:
        what = "a payload that is stuffed before the checksum has no length to determine its end"
        hint = f"add a length that counts the payload, or remove {place[-1]}: after"
        report.error("no-frame-end", place, what, hint, needs=needs)


def _check_middle(exempt: tuple[str, ...], parts: tuple[Part, ...], report: Reporter) -> None:
    """Check that stuffed parts are adjacent."""
    stuffed = [index for index, part in enumerate(parts) if part.name not in exempt]
    for part in parts[stuffed[0] : stuffed[-1]] if stuffed else ():
        if part.name in exempt and part.role != "payload":
            place = (*_PATH, "exempt", exempt.index(part.name))
            what = f"{part.name} is exempt but is between stuffed parts"
            hint = "exempt only parts at the beginning and the end of the frame"
            report.error("bad-frame", place, what, hint, needs=(place, ("frame", "parts")))


def check_unique(frame: DelimitedFrame, path: Path, report: Reporter) -> None:
    """Warn if the preamble can occur in a stuffed frame."""
    stuffing = frame.stuffing
    if stuffing is None:
        return
    needs = (path, (*path[:-1], "parts"))
    if not frame.preamble:
        what, hint = (
            "the frame does not begin with a constant, so stuffing has no use",
            "remove it, or add a preamble",
        )
        report.error("preamble-not-unique", path, what, hint, of_key=True, needs=needs)
    elif not _broken(frame.preamble, stuffing.after, stuffing.insert):
        what = f"the preamble {frame.preamble.hex(' ').upper()} can occur inside a frame despite the stuffing"
        hint = "use a part of the preamble for after, and insert a byte that does not follow it there"
        report.error("preamble-not-unique", path, what, hint, of_key=True, needs=needs)


def _broken(preamble: bytes, after: bytes, insert: int) -> bool:
    """Whether the preamble contains the pattern without the inserted byte after it."""
    ends = (at + len(after) for at in range(len(preamble) - len(after)) if preamble[at:].startswith(after))
    return any(preamble[end] != insert for end in ends)
