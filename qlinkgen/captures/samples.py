"""Samples of logic analysers: tables of levels of sigrok, PulseView and Saleae, and the bytes in them.

A byte on a serial line is a low start bit, its bits from the lowest, a parity bit or none, and a high stop
bit. Each bit is taken in its middle.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from decimal import Decimal, InvalidOperation
from itertools import chain, islice
from typing import BinaryIO, NamedTuple

from qlinkgen.captures.lines import lines
from qlinkgen.captures.records import NANO, Problems, Record
from qlinkgen.captures.times import direction

_RATE = re.compile(r";\s*Samplerate:\s*([\d.]+)\s*(|k|M|G)Hz", re.IGNORECASE)
_UNITS = {"": 1, "k": 10**3, "m": 10**6, "g": 10**9}
_LEVELS = ("0", "1")
#: Sample rate where a table states neither times nor a rate.
_ASSUMED = 10**6
#: Usual speeds of lines, to which a measured one is rounded if it is within 4 %.
_SPEEDS = (
    *(1200, 2400, 4800, 9600, 14400, 19200, 28800, 38400, 57600, 76800, 115200, 230400, 250000, 460800),
    *(500000, 921600, 1000000, 1500000, 2000000, 3000000),
)
#: Changes of levels from which the speed is measured.
_ENOUGH = 2000


class Frame(NamedTuple):
    """Bits of a byte on the line."""

    #: Bits per second; None: it is measured.
    baud: int | None = None
    #: Start, data, parity and stop.
    bits: int = 10


class _Change(NamedTuple):
    """A new level of a channel."""

    at: int  # nanoseconds
    offset: int
    level: bool


class _Columns(NamedTuple):
    time: int | None
    #: Place and name of each channel.
    channels: dict[int, str]


def is_samples(heads: Sequence[str]) -> bool:
    """Whether lines are those of a table of levels, with its header."""
    rows = [each.split(",") for each in heads if not each.startswith(";")][:3]
    if len(rows) < 2:
        return False
    columns = _columns(rows[0])
    return bool(columns.channels) and all(_is_row(columns, row) for row in rows[1:])


def _columns(cells: Sequence[str]) -> _Columns:
    names = [each.strip().strip('"') for each in cells]
    times = [index for index, name in enumerate(names) if name.lower().startswith("time")]
    channels = {
        index: name for index, name in enumerate(names) if index not in times and name not in (*_LEVELS, "")
    }
    return _Columns(times[0] if times else None, channels)


def _is_row(columns: _Columns, cells: Sequence[str]) -> bool:
    return max(columns.channels) < len(cells) and all(
        cells[index].strip() in _LEVELS for index in columns.channels
    )


def read_samples(file: BinaryIO, problems: Problems, frame: Frame) -> Iterator[Record]:
    """Return a record for each byte, at the time of its start bit, with the name of its channel."""
    changes = _changes(file, problems)
    first = list(islice(changes, _ENOUGH))
    baud = frame.baud or _measured(first)
    if not baud:
        return
    channels: dict[str, _Line] = {}
    end = 0
    for name, change in chain(first, changes):
        if change.at < end:
            problems.add(change.offset, "the time of a row precedes that of the last one; a byte may be lost")
            for line in channels.values():
                line.reset()
        if name not in channels:
            channels[name] = _Line(name, NANO / baud, frame.bits, problems)
        for line in channels.values():
            yield from line.until(change.at)
        channels[name].change(change)
        end = change.at
    for line in channels.values():
        yield from line.until(end + frame.bits * NANO // baud)


def _changes(file: BinaryIO, problems: Problems) -> Iterator[tuple[str, _Change]]:
    columns: _Columns | None = None
    rate = Decimal(_ASSUMED)
    levels: dict[str, bool] = {}
    row = 0
    for line in lines(file, problems):
        if line.text.startswith(";"):
            if stated := _RATE.match(line.text):
                rate = Decimal(stated[1]) * _UNITS[stated[2].lower()]
            continue
        cells = line.text.split(",")
        if columns is None:
            columns = _columns(cells)
            continue
        if not columns.channels or not _is_row(columns, cells):
            if line.text.strip():
                problems.add(line.offset, f"'{line.text[:40]}' is not a row of levels; passed over")
            continue
        at = _time(columns, cells, row, rate)
        row += 1
        if at is None:
            problems.add(line.offset, f"'{line.text[:40]}' has no time; passed over")
            continue
        for index, name in columns.channels.items():
            level = cells[index].strip() == "1"
            if levels.get(name) is not level:
                levels[name] = level
                yield name, _Change(at, line.offset, level)


def _time(columns: _Columns, cells: Sequence[str], row: int, rate: Decimal) -> int | None:
    if columns.time is None:
        return int(row * NANO / rate)
    try:
        return int(Decimal(cells[columns.time].strip()) * NANO)
    except (InvalidOperation, ValueError, OverflowError):
        return None


def _measured(changes: Sequence[tuple[str, _Change]]) -> int:
    """Return the speed of a line whose shortest pulse is one bit; 0 without one."""
    before: dict[str, int] = {}
    pulses = []
    for name, change in changes:
        if name in before and change.at > before[name]:
            pulses.append(change.at - before[name])
        before[name] = change.at
    if not pulses:
        return 0
    # The shortest pulse is measured by all that are about as long.
    bit = [each for each in pulses if each < min(pulses) * 1.4]
    speed = NANO * len(bit) / sum(bit)
    near = min(_SPEEDS, key=lambda each: abs(each - speed))
    return near if abs(near - speed) < near * 0.04 else round(speed)


class _Line:
    """Finds the bytes of a channel."""

    def __init__(self, name: str, bit: float, bits: int, problems: Problems) -> None:
        self._name, self._bit, self._bits, self._problems = name, bit, bits, problems
        self._level = True
        self._start: _Change | None = None
        self._taken: list[bool] = []

    def until(self, at: int) -> Iterator[Record]:
        """Return the byte that ends before a time."""
        start = self._start
        if start is None:
            return
        while len(self._taken) < self._bits and start.at + (len(self._taken) + 0.5) * self._bit < at:
            self._taken.append(self._level)
        if len(self._taken) < self._bits:
            return
        self._start = None
        begin, *data, stop = self._taken
        if begin:
            return  # a pulse shorter than half a bit
        if not stop:
            self._problems.add(start.offset, f"a byte of {self._name} has no stop bit; it is left out")
            return
        byte = sum(bit << index for index, bit in enumerate(data[:8]))
        yield Record(bytes([byte]), start.offset, start.at, direction(self._name), self._name)

    def reset(self) -> None:
        """Give up the byte."""
        self._start = None

    def change(self, change: _Change) -> None:
        """Take a new level."""
        if self._start is None and self._level and not change.level:
            self._start, self._taken = change, []
        self._level = change.level
