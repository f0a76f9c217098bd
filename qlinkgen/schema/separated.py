"""Second pass, separators: checks the fields of a message that a separator divides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from qlinkgen.model.fields import Field
from qlinkgen.model.floats import Float
from qlinkgen.model.frame import DelimitedFrame, Frame
from qlinkgen.model.integer import TextForm
from qlinkgen.model.message import Message
from qlinkgen.model.scientific import Scientific
from qlinkgen.model.types import Array, Blob, Count, Scalar
from qlinkgen.model.words import Words
from qlinkgen.schema.notation import shown
from qlinkgen.schema.report import Reporter
from qlinkgen.schema.source import Path

_RULE = "bad-separator"


def separated(
    fields: Sequence[Field], separator: bytes, frame: Frame | None, path: Path, report: Reporter
) -> tuple[Field, ...]:
    """The fields between separators; their texts have neither the separator nor the end of the frame."""
    excluded = separator
    if isinstance(frame, DelimitedFrame):
        end = frame.part("terminator")
        excluded += end.constant if end else b""
    barred = bytes(sorted(each for each in {*excluded} if each < 0x80))
    _check_open(fields, path, report)
    _check_counts(fields, path, report)
    return tuple(_checked(field, separator, barred, (*path, field.name), report) for field in fields)


def check_separator(message: Message, frame: Frame, path: Path, report: Reporter) -> None:
    """Check what a frame around texts of varying size needs."""
    place = (*path[:-1], "separator")

    def error(what: str, hint: str) -> None:
        report.error(_RULE, place, what, hint, needs=(path, ("frame",)))

    if not isinstance(frame, DelimitedFrame):
        error(
            f"the frame of {message.name} has no fields of varying size", "use a frame of parts, or remove it"
        )
        return
    end = frame.part("terminator")
    if not frame.tells_end:
        error(
            f"neither the frame nor {message.name} tells where its last field ends",
            "give the frame a length or a terminator",
        )
    if end is not None and message.separator in end.constant:
        error("the separator ends the frame", "use another separator, or another terminator")
    if frame.payload.trim is not None:
        error("a payload of texts has no zeros at its end", "remove trim from the payload")
    if frame.length_scale > 1:
        error(f"the length counts in steps of {frame.length_scale} bytes", "use a length in bytes")
    if message.empty_is_default:
        error(f"an empty {message.name} is one of empty fields, not its defaults", "remove empty_request")


def _checked(field: Field, separator: bytes, excluded: bytes, path: Path, report: Reporter) -> Field:
    kind = field.type
    if field.slot:
        what = f"{field.slot} is a choice between separators"
        report.error(_RULE, path, what, "use a message for each case", of_key=True)
        return field
    if field.terminated:
        what = f"the separator ends {field.name}, which has a terminator too"
        report.error(_RULE, path, what, "remove terminator", of_key=True)
        return field
    number = kind.item if isinstance(kind, Array) and not kind.packed else kind
    if isinstance(kind, Blob) and kind.text and not kind.pad:
        if field.optional and not kind.length.minimum:
            what = f"an empty {field.name} is the same as an absent one"
            report.error(_RULE, (*path, "optional"), what, "remove optional, or write [1..N]", of_key=True)
        if kind.required:  # only vectors have it as a value
            fill = next(each for each in b" 0x_" if each not in excluded)
            kind = replace(kind, default=bytes((fill,)) * kind.length.minimum)
        if {*kind.default} & {*excluded}:
            what = f"the default of {field.name} contains the separator, or the end of the frame"
            report.error(_RULE, (*path, "default"), what, "use other characters", of_key=True)
        return replace(field, type=replace(kind, excluded=excluded))
    if not isinstance(number, Scalar) or number.text is None:
        what = f"{field.name} is not a text, so it may contain the separator"
        real = isinstance(number, Scalar) and isinstance(number.meaning, Float)
        form = "with as: scientific" if real else "with as: decimal or as: hex"
        hint = f"use text, an enum of words, or a number {form}"
        report.error(_RULE, path, what, hint, of_key=True)
        return field
    if (fault := _conflict(field.name, number.text, separator, excluded)) is not None:
        report.error(_RULE, path, *fault, of_key=True)
    return _listed(field, kind, separator, path, report) if isinstance(kind, Array) else field


def _check_open(fields: Sequence[Field], path: Path, report: Reporter) -> None:
    """Check that the number of texts tells the number of items of a list."""
    opened = ""
    for index, field in enumerate(fields):
        if not isinstance(field.type, Array) or field.type.length.fixed:
            continue
        optional = next((each.name for each in fields[index + 1 :] if each.optional), "")
        what = f"nothing tells how many of the texts belong to {field.name}"
        if opened:
            hint = f"give it, or {opened}, a constant number"
            report.error(_RULE, (*path, field.name), what, hint, of_key=True)
        elif optional:
            hint = f"remove optional from {optional}, put it last, or give it a constant number"
            report.error(
                _RULE, (*path, field.name), f"{what}, since {optional} may be absent", hint, of_key=True
            )
        opened = opened or field.name


def _check_counts(fields: Sequence[Field], path: Path, report: Reporter) -> None:
    """Check that a count tells the number of items of a list."""
    kinds = {field.name: field.type for field in fields}
    for field in fields:
        kind = field.type
        if not isinstance(kind, Scalar) or not isinstance(role := kind.role, Count):
            continue
        plain = role.unit == "items" and (role.scale, role.offset) == (1, 0)
        if not plain or not isinstance(kinds.get(role.run), Array) or kind.signed:
            what = f"{field.name} is not the number of items of a list"
            hint = "use an unsigned integer without scale and offset, and count the items of a list after it"
            report.error(_RULE, (*path, field.name), what, hint, of_key=True)


def _listed(field: Field, kind: Array, separator: bytes, path: Path, report: Reporter) -> Field:
    """A list of texts."""
    if isinstance(kind.item.text, Scientific):
        what = f"{field.name} is a list of floating-point numbers as text"
        report.error(_RULE, path, what, "use a field for each, or as: decimal with a scale", of_key=True)
    if field.optional:
        what = f"{field.name} is a list, which is not optional"
        report.error(_RULE, (*path, "optional"), what, "put it last, and write [0..N]", of_key=True)
    return replace(field, type=replace(kind, between=separator))


def _conflict(name: str, text: TextForm, separator: bytes, excluded: bytes) -> tuple[str, str] | None:
    """What is wrong with a number or a word that contains what ends it, and the fix."""
    if isinstance(text, Words) and (inside := text.alphabet & {*excluded}):
        found = shown(chr(min(inside)))
        what = f"a word of {text.enum} contains {found}, which divides fields or ends the frame"
        return what, "use another separator or terminator"
    if separator[0] in text.alphabet:
        what = f"the separator {shown(separator.decode())} may occur in the number {name}"
        return what, "use another separator"
    return None
