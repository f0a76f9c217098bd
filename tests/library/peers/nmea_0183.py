"""NMEA 0183 by pynmea2, which joins and parses sentences, and reads their numbers."""

from __future__ import annotations

import functools
import re
from decimal import Decimal
from typing import Any

import pynmea2

from qlinkgen.model.fields import Field
from qlinkgen.model.message import Direction
from qlinkgen.model.types import Blob, Enum, Scalar
from qlinkgen.schema import find, load
from tests.library.protocols import Record

UNKNOWN: frozenset[str] = frozenset()
_TYPES = {
    "position_fix": "GGA",
    "position": "GLL",
    "active_satellites": "GSA",
    "satellites_in_view": "GSV",
    "recommended": "RMC",
    "course": "VTG",
    "date": "ZDA",
    "heading": "HDT",
    "depth": "DPT",
    "depth_below": "DBT",
    "wind": "MWV",
}
_QUALITY = ("none", "gps", "differential", "pps", "rtk", "float_rtk", "estimated", "manual", "simulation")
#: Minimum number of characters and digits after the point of numbers; of others 1 and 0.
_SHAPES = (
    (r"time", 9, 2),
    (r"latitude", 9, 4),
    (r"longitude", 10, 4),
    (r"date", 6, 0),
    (r"year", 4, 0),
    (r"azimuth_.", 3, 0),
    (r"satellites?(_\d+)?|number_.|elevation_.|strength_.|in_view|day|month|zone_.*", 2, 0),
    (r".*altitude|separation|depth|offset|scale", 1, 1),
    (r".dop|age|speed|.*course|knots|heading|variation|feet|metres|fathoms|angle", 1, 2),
)
#: What it takes for a talker; P begins a sentence of a manufacturer.
_TALKER = re.compile(r"[A-OQ-Z][A-Z]")
#: What it reads as numbers that it cannot have: times and dates, which may be any digits here.
_CLOCKS = ("time", "date")


def _words(field: Field) -> dict[str, str]:
    """The letters of an enum by name, nothing for other fields."""
    kind = field.type
    if not isinstance(kind, Scalar) or not isinstance(kind.meaning, Enum) or kind.meaning.words is None:
        return {}
    words = kind.meaning.words
    return {each.name: words.text(each.value).decode() for each in kind.meaning.members}


def _text(field: Field, value: Any) -> str:
    name = field.name
    if value is None:
        return ""
    if words := _words(field):
        return words[value]
    if name == "quality":
        return str(_QUALITY.index(value) if value in _QUALITY else value)
    if isinstance(value, str):
        return value
    shapes = (each for each in _SHAPES if re.fullmatch(each[0], name))
    _, least, point = next(shapes, ("", 1, 0))
    return format(round(Decimal(str(value)), point), f"0{least}.{point}f")


@functools.cache
def _fields(message: str) -> tuple[Field, ...]:
    return load(find("nmea_0183")).by_name[message].fields


def build(record: Record) -> bytes | None:
    if not _TALKER.fullmatch(record["talker"]):
        return None
    kind, fields = _TYPES[record["message"]], record["fields"]
    stated = _fields(record["message"])
    texts = [_text(each, fields[each.name]) for each in stated]
    optional = [each.optional for each in stated]
    while optional and optional[-1] and not texts[-1]:
        texts.pop()
        optional.pop()
    sentence = getattr(pynmea2, kind)(record["talker"], kind, texts)
    return str(sentence.render(newline=True)).encode()


def read(wire: bytes, direction: Direction) -> Record | None:
    del direction
    if not _TALKER.fullmatch(wire[1:3].decode()):
        return None
    parsed = pynmea2.parse(wire.decode(), check=True)
    message = next(name for name, each in _TYPES.items() if each == parsed.sentence_type)
    fields: dict[str, Any] = {}
    for field, (_, attribute, *_) in zip(_fields(message), parsed.fields, strict=False):
        if field.name in _CLOCKS:
            continue
        value = getattr(parsed, attribute)
        if words := _words(field):
            fields[field.name] = {letter: name for name, letter in words.items()}[value] if value else None
        elif isinstance(field.type, Blob):
            fields[field.name] = value or (None if field.optional else "")
        elif field.name == "quality":
            fields[field.name] = _QUALITY[value] if value < len(_QUALITY) else value
        else:
            fields[field.name] = None if value in ("", None) else float(value)
    return {"message": message, "talker": parsed.talker, "fields": fields}
