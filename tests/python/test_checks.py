"""The check values that generated modules compute."""

from __future__ import annotations

import random

import pytest

from qlinkgen.backends.python._checks import find_crc
from qlinkgen.model.checksum import Algorithm, catalogue


@pytest.mark.parametrize("algorithm", catalogue(16), ids=lambda each: each.name)
def test_crcs_of_16_bits(algorithm: Algorithm) -> None:
    """Of data of every size, in any buffer that a message may come in."""
    found, rng = find_crc(algorithm.name), random.Random(16)
    for size in range(12):
        data = rng.randbytes(size)
        value = algorithm.compute(data)
        assert found.compute(data, found.start) == value
        whole = data + value.to_bytes(2, "big")
        for buffer in (whole, bytearray(whole), memoryview(whole)):
            assert found.verifier(2)(buffer, found.start) == 0  # type: ignore[arg-type]
