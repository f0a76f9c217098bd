"""Codings of a run of bytes: each class encodes, reads, and bounds what it adds.

They define what every target prints. Reading is slow but says where each byte came from.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import Protocol, assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.model import coding as stated


@dataclass(frozen=True, slots=True)
class Read:
    """Decoded bytes.

    Attributes:
        plain: the bytes.
        places: offset of the last coded byte of each.
        wrong: offset of the first wrong coded byte, None if there is none; a missing one is at the end.
    """

    plain: bytes
    places: tuple[int, ...]
    wrong: int | None = None


class Source(Protocol):
    """Coded bytes that are decoded as they are read."""

    def byte(self) -> int:
        """The next coded byte."""

    def miscoded(self, byte: int) -> int:
        """The last coded byte is wrong; what it is taken as."""


@dataclass(frozen=True)
class Escaping:
    """A byte that must not occur is sent as ``escape`` and a second byte.

    If ``mask`` is not 0, other bytes may be escaped too. Bytes that should be escaped are taken as they are.
    """

    escape: int
    codes: tuple[tuple[int, int], ...]
    mask: int

    @cached_property
    def plain(self) -> dict[int, int]:
        """The byte that each second byte represents."""
        found = {second: byte for byte, second in self.codes}
        if self.mask:
            found = {byte ^ self.mask: byte for byte in range(256) if byte ^ self.mask != self.escape}
        return found

    def encode(self, data: bytes) -> bytes:
        """The coded bytes."""
        seconds = dict(self.codes)
        return b"".join(
            bytes((self.escape, seconds[byte])) if byte in seconds else bytes((byte,)) for byte in data
        )

    def read(self, sent: bytes) -> Read:
        """Decode."""
        found: list[tuple[int, int]] = []
        escaped = False
        for at, byte in enumerate(sent):
            if escaped and byte not in self.plain:
                return _read(found, at)
            if escaped or byte != self.escape:
                found.append((self.plain[byte] if escaped else byte, at))
            escaped = not escaped and byte == self.escape
        return _read(found, len(sent) if escaped else None)

    def take(self, source: Source) -> int:
        """The next byte."""
        byte = source.byte()
        if byte != self.escape:
            return byte
        second = source.byte()
        return self.plain[second] if second in self.plain else source.miscoded(second)

    def growth(self, size: int) -> int:
        """Maximum number of bytes added to ``size`` bytes."""
        return size


@dataclass(frozen=True)
class Cobs:
    """Consistent overhead byte stuffing."""

    def encode(self, data: bytes) -> bytes:
        """The coded bytes: each run up to a zero byte, or of 254 bytes, after its size plus one."""
        found, run, full = b"", b"", False
        for byte in data:
            run += bytes((byte,)) if byte else b""
            full = len(run) == 254
            if full or not byte:
                found, run = found + bytes((len(run) + 1,)) + run, b""
        return found if full else found + bytes((len(run) + 1,)) + run

    def read(self, sent: bytes) -> Read:
        """Decode."""
        found: list[tuple[int, int]] = []
        at = 0
        while at < len(sent):
            code = sent[at]
            run = sent[at + 1 : at + code]
            if code == 0 or len(run) < code - 1 or 0 in run:
                inside = run.find(b"\0")
                return _read(found, at if code == 0 else at + 1 + (inside if inside >= 0 else len(run)))
            found += ((byte, at + 1 + index) for index, byte in enumerate(run))
            at += code
            if code < 0xFF and at < len(sent):
                found.append((0, at))
        return _read(found, None)

    def growth(self, size: int) -> int:
        """Maximum number of bytes added to ``size`` bytes."""
        return size // 254 + 1


@dataclass(frozen=True)
class Digits:
    """Each byte is two hexadecimal digits."""

    def encode(self, data: bytes) -> bytes:
        """The coded bytes."""
        return data.hex().upper().encode("ascii")

    def read(self, sent: bytes) -> Read:
        """Decode; lower case is taken as well."""
        found: list[tuple[int, int]] = []
        for at in range(0, len(sent), 2):
            for place in (at, at + 1):
                if sent[place : place + 1] not in _DIGITS:
                    return _read(found, place)
            found.append((int(sent[at : at + 2], 16), at + 1))
        return _read(found, None)

    def take(self, source: Source) -> int:
        """The next byte."""
        digits = b""
        for _ in range(2):
            digit = source.byte()
            if bytes((digit,)) not in _DIGITS:
                return source.miscoded(digit)
            digits += bytes((digit,))
        return int(digits, 16)

    def growth(self, size: int) -> int:
        """Maximum number of bytes added to ``size`` bytes."""
        return size


_DIGITS = [bytes((byte,)) for byte in b"0123456789ABCDEFabcdef"]


@dataclass(frozen=True)
class Pair:
    """Each byte is followed by its complement."""

    def encode(self, data: bytes) -> bytes:
        """The coded bytes."""
        return b"".join(bytes((byte, byte ^ 0xFF)) for byte in data)

    def read(self, sent: bytes) -> Read:
        """Decode."""
        found: list[tuple[int, int]] = []
        for at in range(0, len(sent), 2):
            if sent[at + 1 : at + 2] != bytes((sent[at] ^ 0xFF,)):
                return _read(found, at + 1)
            found.append((sent[at], at + 1))
        return _read(found, None)

    def take(self, source: Source) -> int:
        """The next byte."""
        byte, second = source.byte(), source.byte()
        return byte if second == byte ^ 0xFF else source.miscoded(second)

    def growth(self, size: int) -> int:
        """Maximum number of bytes added to ``size`` bytes."""
        return size


@dataclass(frozen=True)
class Add:
    """A number is added to each byte, modulo 256."""

    number: int

    def encode(self, data: bytes) -> bytes:
        """The coded bytes."""
        return bytes((byte + self.number) % 256 for byte in data)

    def read(self, sent: bytes) -> Read:
        """Decode; every byte is right."""
        return Read(bytes((byte - self.number) % 256 for byte in sent), tuple(range(len(sent))))

    def take(self, source: Source) -> int:
        """The next byte."""
        return (source.byte() - self.number) % 256

    def growth(self, size: int) -> int:
        """Maximum number of bytes added to ``size`` bytes."""
        del size
        return 0


@dataclass(frozen=True, slots=True)
class Insertion:
    """Inserts an ``insert`` byte after each occurrence of ``after``; occurrences do not overlap."""

    after: bytes
    insert: int

    @property
    def inserted(self) -> bytes:
        """``after`` and the inserted byte."""
        return self.after + bytes((self.insert,))

    def encode(self, data: bytes) -> bytes:
        """The bytes with inserted ones."""
        return data.replace(self.after, self.inserted)

    def read(self, sent: bytes) -> Read:
        """Decode."""
        due = set(self.places(sent))
        wrong = next((at for at in sorted(due) if sent[at : at + 1] != bytes((self.insert,))), None)
        return _read([(byte, at) for at, byte in enumerate(sent[:wrong]) if at not in due], wrong)

    def places(self, sent: bytes) -> Iterator[int]:
        """Offsets at which an inserted byte is due; the last may be the end of the data."""
        at = sent.find(self.after)
        while at >= 0:
            at += len(self.after)
            yield at
            at = sent.find(self.after, at + (sent[at : at + 1] == bytes((self.insert,))))

    def growth(self, size: int) -> int:
        """Maximum number of bytes inserted into ``size`` bytes."""
        return size // len(self.after)


Stage = Escaping | Insertion | Cobs | Digits | Pair | Add
#: Codings that represent each byte on its own, so that a receiver can decode as it reads.
Bytewise = Escaping | Digits | Pair | Add


def stage(coding: stated.Coding) -> Stage:
    """The coding that a schema states."""
    match coding:
        case stated.Escape():
            return Escaping(coding.escape, coding.codes, coding.mask)
        case stated.Insert():
            return Insertion(coding.after, coding.insert)
        case stated.Cobs():
            return Cobs()
        case stated.Digits():
            return Digits()
        case stated.Pair():
            return Pair()
        case stated.Add():
            return Add(coding.number)
        case _:
            assert_never(coding)


def _read(found: list[tuple[int, int]], wrong: int | None) -> Read:
    return Read(bytes(byte for byte, _ in found), tuple(at for _, at in found), wrong)
