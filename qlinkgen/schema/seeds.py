"""Second pass, seeds: the bytes of numeric attributes of messages that check values cover."""

from __future__ import annotations

from collections.abc import Mapping

from qlinkgen.model.frame import ATTRIBUTE, DelimitedFrame, Frame, FrameKinds
from qlinkgen.model.integer import byte_chunks, pack_chunks
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.kinds import Label
from qlinkgen.schema.notation import shown
from qlinkgen.schema.report import Reporter, did_you_mean
from qlinkgen.schema.source import Path

#: Sizes of numeric attributes.
_SIZES = {"u8": 1, "u16": 2, "u24": 3, "u32": 4, "u64": 8}


def check_types(file: SchemaFile, report: Reporter) -> None:
    """Check that an attribute has either values or a type."""
    for name, spec in file.attributes.items():
        path: Path = ("attributes", name)
        if (spec.values is None) == (spec.type is None):
            what = f"{name} has {'neither values nor' if spec.type is None else 'both values and'} a type"
            hint = "write values: [WORD, ...], or type: u8 for a number"
            report.error("unknown-attribute", path, what, hint, of_key=True, absent=True)
        elif spec.type is not None and spec.type not in _SIZES:
            what = f"{shown(spec.type)} is not the type of an attribute"
            report.error("unknown-type", (*path, "type"), what, "use u8, u16, u24, u32 or u64")


def check_references(file: SchemaFile, report: Reporter, frame: Frame | None) -> None:
    """Check that check values cover declared numeric attributes."""
    if isinstance(frame, FrameKinds):
        for kind in frame.kinds:
            _check_covered(file, report, kind.frame, ("frames", kind.name, "parts"))
    elif isinstance(frame, DelimitedFrame):
        _check_covered(file, report, frame, ("frame", "parts"))


def _check_covered(file: SchemaFile, report: Reporter, frame: DelimitedFrame, path: Path) -> None:
    """Check the attributes that the check values of a frame cover."""
    for part in frame.parts:
        for index, covered in enumerate(part.checksum.over if part.checksum else ()):
            name = covered.removeprefix(ATTRIBUTE)
            spec = file.attributes.get(name)
            if covered == name or (spec and spec.type is not None):
                continue
            place = (*path, part.name, "over", index)
            what = f"{shown(covered)} is not a declared attribute with a type"
            hint = f"declare it: attributes: {{{name}: {{type: u8}}}}"
            if spec is None:
                hint = did_you_mean(name, file.attributes, hint)
            report.error("unknown-attribute", place, what, hint, needs=(place, ("attributes",)))


def is_number(value: Label, kind: str) -> bool:
    """Whether a value fits an attribute of an integer type."""
    number = isinstance(value, int) and not isinstance(value, bool)
    return number and 0 <= int(value) < 1 << 8 * _SIZES.get(kind, 8)


class SeedBuilder:
    """Builds the seeds of messages."""

    def __init__(self, file: SchemaFile, report: Reporter, frame: Frame | None) -> None:
        """``frame`` is None if it could not be built."""
        self._file = file
        self._report = report
        self._names = frame.attributes if isinstance(frame, DelimitedFrame) else ()
        self._known: dict[int, tuple[str, tuple[tuple[str, bytes], ...]]] = {}

    def of(
        self, name: str, number: int, given: Mapping[str, Label], path: Path
    ) -> tuple[tuple[str, bytes], ...]:
        """The seeds of a message: the name in ``over`` and the bytes of each attribute."""
        found = []
        for attribute in self._names:
            spec, value = self._file.attributes.get(attribute), given.get(attribute)
            if spec is None or spec.type not in _SIZES:
                continue
            if value is None:
                what = f"{name} has no {attribute}, which a check value covers"
                hint = f"add attributes: {{{attribute}: NUMBER}}"
                self._report.error("check-seed", path, what, hint, of_key=True, absent=True)
            elif is_number(value, spec.type):
                chunks = byte_chunks(_SIZES[spec.type], self._file.byteorder)
                found.append((ATTRIBUTE + attribute, pack_chunks(int(value), chunks)))
        seeds = tuple(found)
        other, theirs = self._known.setdefault(number, (name, seeds))
        if len(seeds) == len(theirs) and seeds != theirs:
            what = f"{name} and {other} have one id and different attributes that a check value covers"
            self._report.error("check-seed", path, what, "give both the same", of_key=True)
        return seeds

    def of_command(self, command: str, number: int) -> tuple[tuple[str, bytes], ...]:
        """The seeds of a message of a command; "" is a reply of all commands."""
        given = self._file.defaults.attributes
        path: Path = ("defaults",)
        if command in self._file.commands:
            given, path = {**given, **self._file.commands[command].attributes}, ("commands", command)
        return self.of(command or "a reply of all commands", number, given, path)
