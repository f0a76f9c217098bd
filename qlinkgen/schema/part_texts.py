"""Second pass, texts in a frame: they do not have the bytes that end it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from qlinkgen.model.fields import Field
from qlinkgen.model.frame import DelimitedFrame, Frame, Part, PartBits
from qlinkgen.model.types import Blob, Characters, Scalar, byte_chunks
from qlinkgen.schema.report import Reporter
from qlinkgen.schema.source import Path

#: Maximum number of characters of a text.
MAX_CHARACTERS = 8


def text_of(kind: Blob) -> Scalar | None:
    """The integer of a text in a header; None for a type that is not one."""
    number = kind.length.maximum
    if not kind.text or not kind.length.fixed or not 0 < number <= MAX_CHARACTERS:
        return None
    return Scalar(
        bits=8 * number,
        chunks=byte_chunks(number, "big"),
        minimum=0,
        maximum=(1 << 8 * number) - 1,
        default=int.from_bytes(kind.default, "big"),
        meaning=Characters(number),
    )


def without_end(
    parts: Sequence[Part], coded: Collection[str], path: Path, report: Reporter
) -> tuple[Part, ...]:
    """The parts; texts that travel as they are do not have the bytes of the terminator."""
    end = next((part.constant for part in parts if part.role == "terminator"), b"")
    excluded = bytes(sorted({each for each in end if each < 0x80}))
    return tuple(
        part if part.name in coded else _without(part, excluded, (*path, part.name), report) for part in parts
    )


def fields_without_end(
    fields: Sequence[Field], frame: Frame | None, path: Path, report: Reporter
) -> tuple[Field, ...]:
    """The fields; texts that travel as they are do not have the bytes of the terminator."""
    end = frame.part("terminator") if isinstance(frame, DelimitedFrame) else None
    if end is None or not end.constant.isascii():  # no text has such a byte
        return tuple(fields)
    assert isinstance(frame, DelimitedFrame)
    if frame.payload.name in frame.coded:
        return tuple(fields)
    return tuple(_text_without(field, end.constant, (*path, field.name), report) for field in fields)


def _text_without(field: Field, end: bytes, path: Path, report: Reporter) -> Field:
    kind = field.type
    if not isinstance(kind, Blob) or not kind.text or kind.pad:
        return field
    kind = replace(kind, excluded=bytes(sorted({*kind.excluded, *end})))
    if kind.required:  # only vectors have it as a value
        fill = next(each for each in b" 0x_" if each not in kind.excluded)
        kind = replace(kind, default=bytes((fill,)) * kind.length.minimum)
    if {*kind.default} & {*kind.excluded}:
        what = f"the default of {field.name} contains a byte that ends the frame"
        report.error("default-out-of-range", (*path, "default"), what, "use other characters", of_key=True)
    return replace(field, type=kind)


def _without(part: Part, excluded: bytes, path: Path, report: Reporter) -> Part:
    def changed(bits: PartBits) -> PartBits:
        if bits.type is None or not isinstance(bits.type.meaning, Characters):
            return bits
        kind = replace(bits.type.meaning, excluded=excluded)
        if not kind.allows(bits.type.default):
            what = f"the default of {bits.name} contains a byte that ends the frame"
            report.error(
                "default-out-of-range", (*path, "default"), what, "use other characters", of_key=True
            )
        return replace(bits, type=replace(bits.type, meaning=kind))

    return replace(part, bits=tuple(map(changed, part.bits)))
