"""Variables, and the table of keys, of a Motion Coordinator."""

from __future__ import annotations

from collections.abc import Iterator
from decimal import Decimal
from fractions import Fraction

from qlinkgen.protocols.trio.facts import LAST_VARIABLE
from qlinkgen.protocols.trio.printing import Number


class Variables:
    """VR(0) to VR(250).

    Values are read as floats, as in BASIC. A value received over the ring has up to 63 bits, more than a
    float holds: `exact` returns all of them.
    """

    def __init__(self) -> None:
        self._values: list[Number] = [0] * (LAST_VARIABLE + 1)

    def __getitem__(self, number: int) -> float:
        return float(self._values[self._place(number)])

    def __setitem__(self, number: int, value: Number) -> None:
        if isinstance(value, bool) or not isinstance(value, Number):
            raise TypeError(f"VR({number}): {value!r} was given; a variable holds a number")
        self._values[self._place(number)] = value

    def __len__(self) -> int:
        return len(self._values)

    def __iter__(self) -> Iterator[float]:
        return map(float, self._values)

    def exact(self, number: int) -> Decimal:
        """Return a variable without loss."""
        value = self._values[self._place(number)]
        if isinstance(value, Fraction):
            return Decimal(value.numerator) / Decimal(value.denominator)
        return Decimal(value)

    def _place(self, number: int) -> int:
        if type(number) is not int or not 0 <= number <= LAST_VARIABLE:
            raise IndexError(
                f"VR({number!r}): a Motion Coordinator has the variables VR(0) to VR({LAST_VARIABLE})"
            )
        return number


class KeyTable:
    """Values of characters on channel 3: DEFKEY.

    The value of an undefined character is its own number.
    """

    def __init__(self) -> None:
        self._values = list(range(128))

    def define(self, key: int, *values: int) -> None:
        """Define the values of a key and of the following ones: `DEFKEY(key, value, value, ...)`.

        Raises:
            ValueError: the key is out of range.
        """
        if type(key) is not int or not values or not 0 <= key <= key + len(values) - 1 <= 127:
            raise ValueError(
                f"defkey: key {key!r} and {len(values)} values were given; keys have the numbers 0 to 127"
            )
        self._values[key : key + len(values)] = values

    def __getitem__(self, character: int) -> int:
        return self._values[character]
