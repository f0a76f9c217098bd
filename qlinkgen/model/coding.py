"""Codings: how a run of parts of a frame travels, so that a terminator cannot occur in it."""

from __future__ import annotations

from qlinkgen._dataclass import dataclass

#: The bytes that can occur somewhere.
Alphabet = frozenset[int]

ALL_BYTES: Alphabet = frozenset(range(256))
_HEX = frozenset(b"0123456789ABCDEF")


@dataclass(frozen=True, slots=True)
class Escape:
    """A byte that must not occur is sent as ``escape`` and a second byte.

    Attributes:
        codes: pairs of a byte and its second byte; ``escape`` itself is one of these bytes.
        mask: the second byte is any byte XOR this; 0 if only the pairs of ``codes`` are legal.
    """

    escape: int
    codes: tuple[tuple[int, int], ...]
    mask: int = 0

    def alphabet(self, before: Alphabet) -> Alphabet:
        """The bytes that can occur in coded bytes."""
        codes = {byte: second for byte, second in self.codes if byte in before}
        return (before - codes.keys()) | frozenset(codes.values()) | ({self.escape} if codes else set())


@dataclass(frozen=True, slots=True)
class Insert:
    """Inserts a byte after each occurrence of a byte sequence."""

    after: bytes
    insert: int

    def alphabet(self, before: Alphabet) -> Alphabet:
        """The bytes that can occur in coded bytes."""
        return before | {self.insert} if before.issuperset(self.after) else before


@dataclass(frozen=True, slots=True)
class Cobs:
    """Consistent overhead byte stuffing: codes replace the zero bytes, so none is sent."""

    def alphabet(self, before: Alphabet) -> Alphabet:
        """The bytes that can occur in coded bytes."""
        del before
        return ALL_BYTES - {0}


@dataclass(frozen=True, slots=True)
class Digits:
    """Each byte is sent as two hexadecimal digits, in upper case; lower case is received as well."""

    def alphabet(self, before: Alphabet) -> Alphabet:
        """The bytes that can occur in coded bytes."""
        return _HEX if before else before


@dataclass(frozen=True, slots=True)
class Pair:
    """Each byte is followed by its complement."""

    def alphabet(self, before: Alphabet) -> Alphabet:
        """The bytes that can occur in coded bytes."""
        return before | {byte ^ 0xFF for byte in before}


@dataclass(frozen=True, slots=True)
class Add:
    """A number is added to each byte, modulo 256."""

    number: int

    def alphabet(self, before: Alphabet) -> Alphabet:
        """The bytes that can occur in coded bytes."""
        return frozenset((byte + self.number) % 256 for byte in before)


Coding = Escape | Insert | Cobs | Digits | Pair | Add
