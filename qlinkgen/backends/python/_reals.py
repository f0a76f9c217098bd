"""Floating-point numbers as text with a decimal exponent.

Copied next to the modules that need it, unchanged.
"""

from __future__ import annotations

from struct import pack, unpack

_NAN = float("nan")


def real(number: float, single: bool) -> bytes:
    """The text of a number with the fewest digits with which it is read as the same.

    The number is rounded if it is ``single``. Raises OverflowError if it is too large then.
    """
    if single:
        number = unpack(">f", pack(">f", number))[0]
    for after in range(16):
        text = b"%.*E" % (after, number)
        if read_real(text, single) == number:
            return text
    return b"%.16E" % number


def read_real(text: bytes, single: bool) -> float:
    """The nearest number to a text, ties to even; NaN if it is none or is too large."""
    if text.strip(b"+-.0123456789Ee"):
        return _NAN
    try:
        number = float(text)
        if single and number:
            number = unpack(">f", pack(">f", _to_odd(text, number)))[0]
    except (ValueError, OverflowError):
        return _NAN
    return number if number - number == 0 else _NAN


def _to_odd(text: bytes, number: float) -> float:
    """The number beside the value of a text that is odd, if it is between two.

    That is not between two singles of a double, so it is rounded only once.
    """
    mantissa, _, exponent = text.lower().partition(b"e")
    whole, _, fraction = mantissa.partition(b".")
    digits, power = int(whole + fraction), int(exponent or b"0") - len(fraction)
    top, bottom = number.as_integer_ratio()
    left, right = digits * bottom * 10 ** max(power, 0), top * 10 ** max(-power, 0)
    raw = int.from_bytes(pack(">d", number), "big")
    if left != right and raw % 2 == 0:
        raw += 1 if (left > right) == (number > 0) else -1
    return float(unpack(">d", raw.to_bytes(8, "big"))[0])
