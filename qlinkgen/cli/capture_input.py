"""Opens captures for commands: files or standard input, in a format that is detected by the frames in them.

Bytes alone often do not tell a format: hex digits are bytes too. Whichever reading gives more bytes in whole
frames is the right one.
"""

from __future__ import annotations

import io
import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import chain, islice, product
from pathlib import Path
from typing import BinaryIO, NamedTuple

from qlinkgen.captures.formats import Read, possible, read_raw, reader_of
from qlinkgen.captures.logs import LineRegex
from qlinkgen.captures.packed import opened
from qlinkgen.captures.records import Problems, Record
from qlinkgen.captures.samples import Frame
from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.capture_options import CaptureOptions
from qlinkgen.cli.decoder import Decoder
from qlinkgen.cli.hex_text import HexError, HexReader
from qlinkgen.cli.progress import Progress, progress
from qlinkgen.cli.streams import Bad
from qlinkgen.cli.traffic import Placed, Sides, Traffic, sides_of, source_of
from qlinkgen.errors import CaptureError
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan.framing import frame_plan

_LINE = re.compile(rb"[^\n]*\n|[^\n]+")
#: What is read while it is typed or arrives: pairs of digits, comments and white space.
_DIGITS = re.compile(rb"(?:[0-9a-fA-FxX\s]|#[^\n]*\n?)*")
#: Bytes with which the format is detected: as they are in the file, and of the line.
_HEAD = 1 << 16
_SAMPLE = 1 << 13
#: A likelier format, and the directions that a capture states, are taken unless there are as many times more
#: bytes in frames without them: of some protocols, most bytes are frames.
_CLEARLY = 2
#: Records of which the directions are detected.
_RECORDS = 4000


class _Reader(NamedTuple):
    """Reads a format."""

    read: Read
    #: Offsets of records are those of their bytes.
    exact: bool = False


class _Chosen(NamedTuple):
    """How a capture is read."""

    reader: _Reader
    sides: Sides


@contextmanager
def _opened(name: str, problems: Problems) -> Iterator[tuple[io.BufferedReader, Progress]]:
    """Open a file, or standard input for -, as it was before it was compressed."""
    if name == "-":
        yield opened(sys.stdin.buffer, problems), Progress()
        return
    if Path(name).is_dir():
        raise Failure(f"'{name}' is a folder; name a file of it")
    with (
        open(name, "rb", buffering=_HEAD) as file,  # noqa: PTH123  # the buffer is what detection sees
        progress(file, name) as shown,
    ):
        yield opened(file, problems), shown


class Capture:
    """Reads and decodes one file.

    Attributes:
        problems: what could not be read.
        size: bytes read so far.
    """

    def __init__(self, protocol: Protocol, decoder: Decoder, options: CaptureOptions) -> None:
        """Decode as the user tells."""
        self._protocol, self._decoder, self._options = protocol, decoder, options
        self.problems = Problems()
        self.size = 0

    def frames(self, name: str) -> Iterator[Placed]:
        """Return the frames of a file, or of standard input for -."""
        with _opened(name, self.problems) as (file, shown):
            chosen = self._chosen(file, live=name == "-")
            traffic = self._decoder.traffic(chosen.sides, exact=chosen.reader.exact)
            yield from traffic.decode(self._read(chosen, file, shown))

    def records(self, name: str) -> Iterator[Record]:
        """Return the bytes of a file as they were captured."""
        with _opened(name, self.problems) as (file, shown):
            yield from self._read(self._chosen(file, live=False), file, shown)

    def _chosen(self, file: io.BufferedReader, *, live: bool) -> _Chosen:
        return _choose(self._protocol, file, self._readers(file, live=live), self._decoder)

    def _read(self, chosen: _Chosen, file: io.BufferedReader, shown: Progress) -> Iterator[Record]:
        for record in chosen.reader.read(file, self.problems):
            self.size += len(record.data)
            shown.update()
            yield record

    def _readers(self, file: io.BufferedReader, *, live: bool) -> list[_Reader]:
        """Return the readers that the file can have, the likeliest first."""
        options = self._options
        if options.line_regex is not None:
            try:
                return [_Reader(LineRegex(options.line_regex).read)]
            except CaptureError as error:
                raise Failure(f"--line-regex: {error}") from None
        silent = frame_plan(self._protocol.frame).silent
        head = file.peek(_HEAD)
        if live and not silent and options.format in {None, "hex"} and _DIGITS.fullmatch(head):
            return [_Reader(_read_typed)]
        formats = [options.format] if options.format else possible(head)
        if silent and "raw" in formats:
            formats.remove("raw")
            if not formats:
                what = f"only a silence ends a frame of {self._protocol.name}, and raw bytes have no times"
                raise Failure(f"{what}; give hex text with one frame on each line")
        readers: list[_Reader] = []
        for each in formats:
            readers += self._of_samples() if each == "samples" else [_Reader(reader_of(each), each == "raw")]
        return readers

    def _of_samples(self) -> list[_Reader]:
        """Return readers of levels: as the schema states the line, and as it may be instead."""
        bus, given = self._protocol.bus, self._options.baud
        speeds = dict.fromkeys([given] if given else [bus.baud, None])
        bits = dict.fromkeys([bus.bits_per_byte, 10, 11])
        return [_Reader(reader_of("samples", Frame(*each))) for each in product(speeds, bits)]


def _choose(
    protocol: Protocol, file: io.BufferedReader, readers: Sequence[_Reader], decoder: Decoder
) -> _Chosen:
    """Return how a capture is read: with the reader and directions that give most bytes in frames.

    A likelier reader is taken unless another one gives clearly more. Of the file, nothing is taken.
    """
    head = file.peek(_HEAD)
    best: _Chosen | None = None
    most = 0.0
    for reader in readers:
        records = _sample(reader.read(io.BytesIO(head), Problems()))
        sources = list(dict.fromkeys(map(source_of, records)))
        every = [
            (_covered(decoder.traffic(sides, exact=reader.exact), records), sides)
            for sides in sides_of(sources, protocol)
        ]
        covered, sides = max(every, key=lambda found: found[0] * (_CLEARLY if found[1] else 1))
        if best is None or covered > most * _CLEARLY:
            best, most = _Chosen(reader, sides), covered
    assert best is not None  # there is a reader
    return best


def _sample(records: Iterator[Record]) -> list[Record]:
    found: list[Record] = []
    size = 0
    for record in islice(records, _RECORDS):
        found.append(record._replace(data=record.data[: _SAMPLE - size]))
        size += len(record.data)
        if size >= _SAMPLE:
            break
    return found


def _covered(traffic: Traffic, records: Sequence[Record]) -> float:
    """Return the part of the bytes that are in whole frames, times the part of frames that are whole."""
    total = sum(len(each.data) for each in records)
    size = good = bad = 0
    for event, place in traffic.decode(records):
        if isinstance(event, Bad):
            bad += 1
        else:
            good += 1
            size += place.size
    return size / total * good / (good + bad) if total and good else 0.0


def _read_typed(file: BinaryIO, problems: Problems) -> Iterator[Record]:  # it raises
    """Read hex text while it arrives: bytes as soon as both digits are known; a chunk may end anywhere.

    The bytes before a wrong character are returned before the error is raised.
    """
    reader, comment, line, start, end = HexReader(), False, 1, 0, 0
    for chunk in chain(read_raw(file, problems), (Record(b"\n", 0),)):
        for piece in _LINE.findall(chunk.data):
            text, mark, _ = (b"#" + piece if comment else piece).partition(b"#")
            last = piece.endswith(b"\n")
            try:
                found = reader.feed(text.decode("ascii", "surrogateescape") + ("\n" if last else ""))
            except HexError as error:
                yield Record(error.before, start)
                what = f"standard input, line {line}: {error.message}"
                raise Failure(f"{what}; comments begin with #") from None
            if found:
                yield Record(found, start)
            comment = bool(mark) and not last
            end += len(piece)
            if last:
                line, start = line + 1, end
