"""NMEA 0183 by pynmea2 and by the schema of the library."""

from __future__ import annotations

from typing import Any

from benchmarks import messages
from benchmarks.library_pairs import REPEATS, Pair, Side, module_of, own, reader, spelled
from benchmarks.peer import load

#: For each sentence its message, and its fields with values and texts: a program that uses pynmea2 writes
#: numbers in these formats.
_SENTENCES = (
    (
        "GGA",
        "position_fix",
        (
            ("time", 123519.25, "%09.2f"), ("latitude", 4807.038, "%09.4f"), ("latitude_side", 0, "N"),
            ("longitude", 1131.5, "%010.4f"), ("longitude_side", 0, "E"), ("quality", 1, "%d"),
            ("satellites", 8, "%02d"), ("hdop", 0.9, "%.2f"), ("altitude", 545.4, "%.1f"),
            ("altitude_unit", "M", "M"), ("separation", 46.9, "%.1f"), ("separation_unit", "M", "M"),
            ("age", None, ""), ("station", "", ""),
        ),
    ),
    (
        "RMC",
        "recommended",
        (
            ("time", 123519.25, "%09.2f"), ("status", 0, "A"), ("latitude", 4807.038, "%09.4f"),
            ("latitude_side", 0, "N"), ("longitude", 1131.5, "%010.4f"), ("longitude_side", 0, "E"),
            ("speed", 22.4, "%.2f"), ("course", 84.4, "%.2f"), ("date", 230394, "%06d"),
            ("variation", 3.1, "%.2f"), ("variation_side", 1, "W"),
        ),
    ),
    (
        "VTG",
        "course",
        (
            ("true_course", 54.7, "%.2f"), ("true_sign", "T", "T"), ("magnetic_course", 34.4, "%.2f"),
            ("magnetic_sign", "M", "M"), ("knots", 5.5, "%.2f"), ("knots_sign", "N", "N"),
            ("speed", 10.2, "%.2f"), ("speed_sign", "K", "K"),
        ),
    ),
)  # fmt: skip


def nmea() -> Pair:
    """NMEA 0183 beside pynmea2, whose user writes numbers as texts, and which reads only some as numbers."""
    library: Any = load("pynmea2")
    listed = [(message, {name: value for name, value, _ in fields}) for _, message, fields in _SENTENCES]
    ours = own(module_of("nmea_0183"), listed)
    pieces = [piece.decode() for piece in messages.chunks(b"".join(ours.encode()))]
    calls = [
        f"library.{kind}('GP', '{kind}', ({', '.join(_text(*field) for field in fields)}))"
        ".render(newline=True).encode()"
        for kind, _, fields in _SENTENCES
    ] * REPEATS
    kinds = {getattr(library, kind): len(fields) for kind, _, fields in _SENTENCES}
    readers = {kind: reader(*(name for _, name, *_ in kind.fields[:size])) for kind, size in kinds.items()}

    def decode() -> list[object]:
        following = library.NMEAStreamReader().next
        return [readers[type(each)](each) for piece in pieces for each in following(piece)]

    theirs = Side(spelled(calls, {"library": library}), decode)
    return Pair("NMEA 0183", "pynmea2", len(calls), 2, ours, theirs)


def _text(name: str, value: object, form: str) -> str:
    """The expression for the text of a field."""
    del name
    return f"{form!r} % {value!r}" if "%" in form else repr(form)
