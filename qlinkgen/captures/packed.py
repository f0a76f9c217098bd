"""Captures as they are stored: compressed by gzip or Zstandard, or text in UTF-16."""

from __future__ import annotations

import codecs
import io
import zlib
from collections.abc import Iterator
from typing import BinaryIO

from qlinkgen.captures.records import Problems
from qlinkgen.errors import ExtraMissing

_CHUNK = 1 << 16
#: Most bytes of a compressed file that are unpacked at once: a block of 4 bytes can become 128 KiB.
_PACKED = 512
_GZIP, _ZSTD = b"\x1f\x8b", b"\x28\xb5\x2f\xfd"
_WIDE = {codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}


def opened(file: BinaryIO, problems: Problems) -> io.BufferedReader:
    """Return a file as it was before it was compressed, in UTF-8 if it is text in UTF-16.

    Where the file was cut or damaged, what precedes that place can be read, and a problem is added. Reads
    return what there is, without waiting until a buffer is full.

    Raises:
        ExtraMissing: Zstandard is used and its package is not installed.
    """
    read = file if isinstance(file, io.BufferedReader) else _buffered(_pieces(file))
    while (head := read.peek(4)[:4]).startswith((_GZIP, _ZSTD)):
        read = _buffered((_gzip if head.startswith(_GZIP) else _zstandard)(read, problems))
    if encoding := _WIDE.get(head[:2]):
        read.read(2)
        read = _buffered(_transcoded(read, encoding))
    return read


def _buffered(pieces: Iterator[bytes]) -> io.BufferedReader:
    return io.BufferedReader(_Raw(pieces), _CHUNK)


class _Raw(io.RawIOBase):
    """A file made of pieces, none of which is empty."""

    def __init__(self, pieces: Iterator[bytes]) -> None:
        self._pieces = pieces
        self._rest = memoryview(b"")

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: memoryview | bytearray) -> int:  # type: ignore[override]
        if not self._rest:
            self._rest = memoryview(next(self._pieces, b""))
        size = min(len(buffer), len(self._rest))
        buffer[:size] = self._rest[:size]
        self._rest = self._rest[size:]
        return size


def _pieces(file: BinaryIO) -> Iterator[bytes]:
    while piece := file.read(_CHUNK):
        yield piece


def _gzip(file: io.BufferedReader, problems: Problems) -> Iterator[bytes]:
    """Unpack one or several members of gzip."""
    data, place = b"", 0
    while data or (data := file.read1(_CHUNK)):
        member = zlib.decompressobj(31)
        try:
            while not member.eof and (data or (data := file.read1(_CHUNK))):
                piece = member.decompress(data, _CHUNK)
                data = member.unconsumed_tail
                place += len(piece)
                if piece:
                    yield piece
        except zlib.error as error:
            _damaged(problems, place, error)
            return
        if not member.eof:
            _cut(problems, place)
            return
        data = member.unused_data.lstrip(b"\0")  # tapes and archives pad members


def _zstandard(file: io.BufferedReader, problems: Problems) -> Iterator[bytes]:
    """Unpack one or several frames of Zstandard."""
    try:
        import zstandard  # noqa: PLC0415  # an extra, imported where used
    except ImportError:
        raise ExtraMissing(
            "the capture is compressed by Zstandard, which needs the package zstandard; "
            "`pip install 'qlinkgen[captures]'` installs it, and `zstd -d` unpacks the file"
        ) from None
    place, whole = 0, True
    frame = zstandard.ZstdDecompressor().decompressobj()
    data = b""
    while data or (data := file.read(_PACKED)):
        try:
            piece = frame.decompress(data)
        except zstandard.ZstdError as error:
            _damaged(problems, place, error)
            return
        place += len(piece)
        if piece:
            yield piece
        whole = frame.eof
        data = frame.unused_data if whole else b""
        if whole:
            frame = zstandard.ZstdDecompressor().decompressobj()
    if not whole:
        _cut(problems, place)


def _damaged(problems: Problems, place: int, error: Exception) -> None:
    problems.add(place, f"the compressed file is damaged ({error}); the rest is not read")


def _cut(problems: Problems, place: int) -> None:
    problems.add(place, "the compressed file ends too early; it was cut")


def _transcoded(file: io.BufferedReader, encoding: str) -> Iterator[bytes]:
    """Return text in UTF-16 as UTF-8."""
    decoder = codecs.getincrementaldecoder(encoding)("replace")
    while data := file.read1(_CHUNK):
        if piece := decoder.decode(data).encode("utf-8", "replace"):
            yield piece
    if piece := decoder.decode(b"", final=True).encode("utf-8", "replace"):
        yield piece
