"""Which values a vector carries: integers on the wire, chosen by one rule for each kind of vector."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from qlinkgen.model.message import Message, Value
from qlinkgen.model.types import Array, Bits, Blob, Flags, Length, Scalar
from qlinkgen.model.values import Native, native_from_raw

Raw = int | bytes | list[int]

#: Byte that the a5 vectors are filled with, so that all that can be stuffed is.
_PATTERN = 0xA5


class Chance:
    """Numbers that look random and are the same in every run: xorshift64*, seeded with a text (FNV-1a)."""

    def __init__(self, seed: str) -> None:
        """Different texts give different sequences."""
        self._state = 0xCBF29CE484222325
        for byte in seed.encode():
            self._state = (self._state ^ byte) * 0x100000001B3 & _MASK
        self._state |= 1

    def between(self, first: int, last: int) -> int:
        """A number from first to last."""
        self._state ^= self._state >> 12
        self._state ^= self._state << 25 & _MASK
        self._state ^= self._state >> 27
        wide = self._state * 0x2545F4914F6CDD1D & _MASK
        # The high bits are the good ones; a range of 2^64 takes them all.
        return first + (wide * (last - first + 1) >> 64)


_MASK = (1 << 64) - 1


class Rule:
    """How the values of one kind of vector are chosen."""

    def __init__(
        self, number: Callable[[Scalar, int], int], count: Callable[[Length], int], octet: Callable[[], int]
    ) -> None:
        """``number`` is told the integer and the pattern's bits in its place."""
        self._number = number
        self._count = count
        self._octet = octet

    def raw(self, value: Value) -> Raw:
        """The value on the wire."""
        kind = value.type
        if isinstance(kind, Blob):
            mask = 0x7F if kind.text else 0xFF
            return bytes(self._octet() & mask for _ in range(self._count(kind.length)))
        if isinstance(kind, Array):
            return [self._scalar(kind.item, _pattern(kind.item)) for _ in range(self._count(kind.length))]
        return self._scalar(kind, _pattern_of(value))

    def _scalar(self, scalar: Scalar, pattern: int) -> int:
        number = self._number(scalar, pattern)
        meaning = scalar.meaning
        return number & meaning.mask if isinstance(meaning, Flags) and meaning.reserved_zero else number


def _fitting(scalar: Scalar, pattern: int) -> int:
    """The pattern in as many low bytes as the range allows; the default where it allows none."""
    for bits in range(scalar.bits, 0, -8):
        number = pattern & (1 << bits) - 1
        number -= number >> (scalar.bits - 1) << scalar.bits if scalar.signed else 0
        if scalar.minimum <= number <= scalar.maximum:
            return number
    return scalar.default


MINIMUM = Rule(lambda scalar, _: scalar.minimum, lambda length: length.minimum, lambda: 0x00)
MAXIMUM = Rule(lambda scalar, _: scalar.maximum, lambda length: length.maximum, lambda: 0xFF)
A5 = Rule(_fitting, lambda length: length.maximum, lambda: _PATTERN)


def random(chance: Chance) -> Rule:
    """Anything that may be sent."""
    return Rule(
        lambda scalar, _: chance.between(scalar.minimum, scalar.maximum),
        lambda length: chance.between(length.minimum, length.maximum),
        lambda: chance.between(0, 0xFF),
    )


def default(value: Value) -> Raw:
    """What is sent when nothing is given."""
    kind = value.type
    return list(kind.default) if isinstance(kind, Array) else kind.default


def native(value: Value, raw: Raw) -> Native:
    """A value on the wire as Python holds it."""
    kind = value.type
    if isinstance(kind, Scalar):
        assert isinstance(raw, int)
        return native_from_raw(kind, raw)
    if isinstance(kind, Blob) and kind.text:
        assert isinstance(raw, bytes)
        return raw.decode("ascii")
    assert not isinstance(raw, int)
    return raw


def natives(message: Message, raws: Mapping[str, Raw]) -> dict[str, Native]:
    """All values of a message as Python holds them."""
    return {value.name: native(value, raws[value.name]) for value in message.values}


def _pattern(scalar: Scalar) -> int:
    return sum((_PATTERN & chunk.mask) << chunk.shift for chunk in scalar.chunks)


def _pattern_of(value: Value) -> int:
    assert isinstance(value.type, Scalar)
    if value.bits is None:
        return _pattern(value.type)
    assert isinstance(value.field.type, Bits)
    return _pattern(value.field.type.container) >> value.bits.shift & (1 << value.type.bits) - 1
