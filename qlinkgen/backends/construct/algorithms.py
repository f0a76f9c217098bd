"""The constructor calls of algorithms of check values."""

from __future__ import annotations

from typing import assert_never

from qlinkgen.backends.construct.tree import Call, hexadecimal
from qlinkgen.model import checksum as catalogue


def algorithm(algorithm: catalogue.Checksum) -> Call:
    """The constructor of an algorithm of check values."""
    init = (("init", algorithm.init),) if algorithm.init else ()
    match algorithm:
        case catalogue.Sum():
            form = () if algorithm.form == "plain" else (algorithm.form,)
            carry = (("carry", True),) if algorithm.carry else ()
            return Call("Sum", (algorithm.width, *form), (*init, *carry))
        case catalogue.Xor():
            width = (("width", 16),) if algorithm.width == 16 else ()
            return Call("Xor", (), (*init, *width))
        case catalogue.Fletcher():
            return Call("Fletcher", (algorithm.half, algorithm.modulus), init)
        case catalogue.Algorithm():
            return _crc(algorithm)
        case _:
            assert_never(algorithm)


def _crc(algorithm: catalogue.Algorithm) -> Call:
    digits = (algorithm.width + 3) // 4
    return Call(
        "CRC",
        (),
        (
            ("width", algorithm.width),
            ("poly", hexadecimal(algorithm.poly, digits)),
            ("init", hexadecimal(algorithm.init, digits)),
            ("refin", algorithm.refin),
            ("refout", algorithm.refout),
            ("xorout", hexadecimal(algorithm.xorout, digits)),
        ),
    )
