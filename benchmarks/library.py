"""Protocols of the library beside their own libraries, in one interleaved run."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.library_pairs import Pair, checked
from benchmarks.library_peers import PAIRS
from benchmarks.library_sentences import nmea
from benchmarks.measure import Case, Timing, measure
from benchmarks.peer import PeerMissing
from benchmarks.report import Goal, Section, number

INTRO = """\
Generated Python of schemas of the library beside the library that other people wrote for the protocol, both
in pure Python: pymavlink without fastcrc. *encode*: objects are built of plain values and encoded;
*decode*: a stream is decoded and every field of each message is read. Streams come in pieces of 1 to 64
bytes; frame by frame for pymodbus, which takes all bytes that it has as one frame, and for dynamixel-sdk,
which reads as many bytes as a packet has. pyubx2 gets fields of bits as bytes, its quicker way; pynmea2 is
given texts, and converts only some of the fields that are read to numbers."""


def section(rounds: int) -> Section:
    """Times of each message, and how many times as fast the generated code is."""
    columns = ["", "encode", "its library", "times as fast", "decode", "its library", "times as fast"]
    result = Section("Protocols of the library beside their own libraries", INTRO, columns)
    pairs = list(_available(result.missing))
    timings = measure([case for pair in pairs for case in _cases(pair)], rounds)
    for pair in pairs:
        result.rows.append(_row(pair, timings))
        result.goals += _goals(pair, timings)
    return result


def _available(missing: list[str]) -> Sequence[Pair]:
    found = []
    for make in (*PAIRS, nmea):
        try:
            found.append(checked(make()))
        except PeerMissing as reason:
            missing.append(str(reason))
    return found


def _cases(pair: Pair) -> list[Case]:
    return [
        Case(
            f"{pair.protocol}/{side}/{work}", "run()", {"run": getattr(getattr(pair, side), work)}, pair.count
        )
        for work in ("encode", "decode")
        for side in ("ours", "theirs")
    ]


def _times(pair: Pair, work: str, timings: dict[str, Timing]) -> tuple[Timing, Timing]:
    ours, theirs = (timings[f"{pair.protocol}/{side}/{work}"] for side in ("ours", "theirs"))
    return ours, theirs


def _row(pair: Pair, timings: dict[str, Timing]) -> list[str]:
    cells = [f"{pair.protocol}, {pair.peer}"]
    for work in ("encode", "decode"):
        ours, theirs = _times(pair, work, timings)
        cells += [f"{number(each.best * 1e6)} us" for each in (ours, theirs)]
        cells.append(number(theirs.over(ours)))
    return cells


def _goals(pair: Pair, timings: dict[str, Timing]) -> list[Goal]:
    goals = []
    for work in ("encode", "decode"):
        ours, theirs = _times(pair, work, timings)
        what = f"{pair.protocol}: {work} against {pair.peer}"
        goals.append(Goal(what, theirs.over(ours), pair.limit, "x faster", at_least=True))
    return goals
