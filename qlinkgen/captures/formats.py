"""Formats of captures: which ones a file can have, and the reader of each."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import BinaryIO, NamedTuple, TypeAlias

from qlinkgen.captures.analysers import is_annotation, is_saleae, read_annotations, read_saleae
from qlinkgen.captures.dumps import is_dump, read_dump
from qlinkgen.captures.lines import head_lines
from qlinkgen.captures.links import Line
from qlinkgen.captures.logs import is_entry, is_hex, read_hex, read_log
from qlinkgen.captures.pcap import is_pcap, read_pcap
from qlinkgen.captures.pcapng import SECTION
from qlinkgen.captures.reader import Reader
from qlinkgen.captures.records import Format, Problems, Record
from qlinkgen.captures.samples import Frame, is_samples, read_samples
from qlinkgen.errors import CaptureError

Read: TypeAlias = Callable[[BinaryIO, Problems], Iterator[Record]]

#: Bytes of a raw record.
_CHUNK = 1 << 16
#: Part of the lines that have a format, so that it is likelier than raw bytes.
_MOST_LINES = 0.5
#: Lines that say nothing of the format.
_REMARKS = ("#", "//", ";")


def read_raw(file: BinaryIO, problems: Problems) -> Iterator[Record]:  # noqa: ARG001  # there are none
    """Return the bytes as they arrive."""
    offset = 0
    read = getattr(file, "read1", file.read)
    while data := read(_CHUNK):
        yield Record(data, offset)
        offset += len(data)


def read_recording(file: BinaryIO, problems: Problems) -> Iterator[Record]:
    """Return a record for each packet of a pcapng file; after a damaged block, the next one is searched."""
    reader = Reader(file, problems.add)
    lines: dict[int, Line] = {}
    try:
        for packet in reader:
            kind = packet.interface.link_type
            line = lines.get(kind) or lines.setdefault(kind, Line(kind, problems))
            port = packet.interface.name
            if packet.data:
                yield line.record(Record(packet.data, reader.at, packet.at, packet.direction, port))
    except CaptureError as error:
        problems.add(reader.at, f"{error}; too much of the file is damaged, the rest is not read")
        return
    if not reader.whole:
        problems.add(reader.at, "the file ends in the middle of a block; it was cut")


class _Kind(NamedTuple):
    read: Read
    #: Whether a line has the format; None for formats that are not told by their lines.
    has: Callable[[str], bool] | None = None


_KINDS: dict[Format, _Kind] = {
    "pcapng": _Kind(read_recording),
    "pcap": _Kind(read_pcap),
    "saleae": _Kind(read_saleae),
    "sigrok": _Kind(read_annotations, is_annotation),
    "samples": _Kind(partial(read_samples, frame=Frame())),
    "dump": _Kind(read_dump, is_dump),
    "log": _Kind(read_log, is_entry),
    "hex": _Kind(read_hex, is_hex),
    "raw": _Kind(read_raw),
}


def reader_of(name: Format, frame: Frame | None = None) -> Read:
    """Return the reader of a format; `frame`: the bits of a byte in samples of levels."""
    return partial(read_samples, frame=frame) if name == "samples" and frame else _KINDS[name].read


def possible(head: bytes) -> list[Format]:
    """Return the formats that a file with this beginning can have, the likeliest first; raw is always one.

    Args:
        head: some 10,000 bytes, after decompression.
    """
    if head.startswith(SECTION.to_bytes(4, "little")):
        return ["pcapng", "raw"]
    if is_pcap(head):
        return ["pcap", "raw"]
    lines = [each for each in head_lines(head) if each.strip() and not each.startswith(_REMARKS)]
    if is_samples(lines):
        return ["samples", "raw"]
    if is_saleae(lines):
        return ["saleae", "raw"]
    shares = {name: _share(kind.has, lines) for name, kind in _KINDS.items() if kind.has}
    ranked = sorted((name for name, share in shares.items() if share), key=lambda name: -shares[name])
    likely = [name for name in ranked if shares[name] > _MOST_LINES]
    return [*likely, "raw", *ranked[len(likely) :]]


def _share(has: Callable[[str], bool], lines: list[str]) -> float:
    """Return the part of the lines that have a format."""
    return sum(map(has, lines)) / len(lines) if lines else 0.0
