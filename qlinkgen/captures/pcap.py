"""Reads pcap files, those of before pcapng, also where they are cut or damaged.

A header of 24 bytes tells byte order, unit of fractions of seconds and link type. Packets follow: seconds,
fraction, number of bytes in the file, number of bytes on the line, the bytes.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

from qlinkgen.captures.links import Line
from qlinkgen.captures.pcapng import MOST
from qlinkgen.captures.records import NANO, Problems, Record
from qlinkgen.captures.window import Window

#: The first word of a file, by nanoseconds of a unit of fractions.
_MAGIC = {0xA1B2C3D4: 1000, 0xA1B23C4D: 1}
_HEADER = 24
_PACKET = 16
#: Bytes of a damaged file that are searched first for the next packet.
_SEARCHED = 1 << 12
#: Seconds between packets that follow one another, at most, for bytes to be taken as one after damage.
_NEAR = 7 * 86_400


class _Head(NamedTuple):
    order: str
    nanoseconds: int
    #: Longest packet that is stored.
    longest: int
    link_type: int


def is_pcap(head: bytes) -> bool:
    """Whether a file begins as a pcap file."""
    return any(head.startswith(struct.pack(f"{order}I", magic)) for order in "<>" for magic in _MAGIC)


def read_pcap(file: BinaryIO, problems: Problems) -> Iterator[Record]:
    """Return a record for each packet. Where the file is damaged, the next packet is searched."""
    window = Window(file)
    header = _head(window.take(_HEADER))
    if header is None:
        problems.add(0, f"the header of the pcap file has {window.at} bytes of {_HEADER}; the file was cut")
        return
    line = Line(header.link_type, problems)
    last: int | None = None  # seconds of the last packet
    while True:
        window.keep()
        start = window.at
        head = window.take(_PACKET)
        seconds = _plausible(header, head, last)
        if seconds is None:
            if head:
                problems.add(start, "no packet begins here; the next one is searched")
            if not _search(window, header, start + 1, last):
                return
            continue
        fraction, size = struct.unpack_from(f"{header.order}II", head, 4)
        at = (seconds * NANO + fraction * header.nanoseconds) if seconds or fraction else None
        data = _data(window, header, size, seconds)
        if len(data) < size:
            problems.add(start, f"a packet states {size} bytes and has {len(data)}")
        if data:
            yield line.record(Record(data, start, at))
        last = seconds


def _data(window: Window, header: _Head, size: int, seconds: int) -> bytes:
    """Return the data of a packet, up to the next packet if that begins in them."""
    start = window.at
    data = window.take(size)
    end = window.at
    after = window.take(_PACKET)
    window.go(end)
    whole = len(data) == size
    if whole and (len(after) < _PACKET or _plausible(header, after, seconds) is not None):
        return data
    # The size may be damaged, and include further packets.
    if _search(window, header, start, seconds) and window.at < end:
        return data[: window.at - start]
    window.go(end)
    return data


def _head(data: bytes) -> _Head | None:
    if len(data) < _HEADER:
        return None
    for order in "<>":
        magic, _, _, _, longest, link_type = struct.unpack(f"{order}IIIIII", data)
        if magic in _MAGIC:
            return _Head(order, _MAGIC[magic], min(longest or MOST, MOST), link_type & 0xFFFF)
    return None


def _plausible(header: _Head, head: bytes, last: int | None) -> int | None:
    """Return the seconds of a packet whose header this can be, None if it cannot."""
    if len(head) < _PACKET:
        return None
    seconds, fraction, size, whole = struct.unpack(f"{header.order}IIII", head)
    near = last is None or abs(seconds - last) <= _NEAR
    fits = size <= header.longest and size <= whole and fraction * header.nanoseconds < 10**9
    return seconds if near and fits else None


def _search(window: Window, header: _Head, start: int, last: int | None) -> bool:
    """Go to the next packet from a place on; return False without one in as many bytes as one can have."""
    window.go(start)
    size = _SEARCHED
    while len(data := window.take(size)) >= _PACKET:
        for at in range(size // 2 if size > _SEARCHED else 0, len(data) - _PACKET + 1):
            if _followed(header, data, at, last):
                window.go(start + at)
                return True
        if len(data) < size or size > MOST:
            return False
        window.go(start)
        size *= 2
    return False


def _followed(header: _Head, data: bytes, start: int, last: int | None) -> bool:
    """Whether a packet can begin here: another one follows it, or the file ends."""
    seconds = _plausible(header, data[start : start + _PACKET], last)
    if seconds is None:
        return False
    (size,) = struct.unpack_from(f"{header.order}I", data, start + 8)
    after = data[start + _PACKET + size :]
    if not size:
        return False
    return not after or len(after) < _PACKET or _plausible(header, after[:_PACKET], seconds) is not None
