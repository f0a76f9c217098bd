"""Errors not detected by the 14 transmitted bits of the 16-bit checksum: counted exhaustively."""

from __future__ import annotations

from collections.abc import Iterator
from decimal import Decimal
from itertools import combinations

from qlinkgen.codecs import trio
from tests.soak.ring import sent_crc

PAYLOAD = bytes(range(12))
#: Seven bits of each of 12 payload bytes, and of the two bytes of the checksum.
PLACES = [(byte, bit) for byte in range(14) for bit in range(7)]


def syndromes() -> list[int]:
    """The change of the comparison by flipping each bit; a CRC is linear, so any payload will do."""
    right = int.from_bytes(sent_crc(PAYLOAD), "big")
    found = []
    for byte, bit in PLACES:
        if byte >= 12:
            found.append(1 << bit << (8 if byte == 12 else 0))
            continue
        changed = bytearray(PAYLOAD)
        changed[byte] ^= 1 << bit
        found.append(int.from_bytes(sent_crc(bytes(changed)), "big") ^ right)
    return found


def test_the_checksum_that_is_sent_is_the_one_of_the_codec() -> None:
    frame = trio.DirectVariableTransfer(address=2, number=200, value=Decimal(99)).to_frame()
    assert frame[13:15] == sent_crc(frame[1:13])


def test_no_error_of_one_or_two_bits_is_missed_and_15_of_152096_of_three() -> None:
    each = syndromes()
    assert sum(one == 0 for one in each) == 0
    pairs = list(combinations(each, 2))
    assert (len(pairs), sum(one ^ two == 0 for one, two in pairs)) == (4753, 0)
    triples = list(combinations(each, 3))
    assert (len(triples), sum(a ^ b ^ c == 0 for a, b, c in triples)) == (152096, 15)


def accepted(frame: bytes) -> Iterator[trio.Message]:
    """The accepted messages among all two-bit errors of the whole frame."""
    for one, two in combinations(range(8 * len(frame)), 2):
        changed = bytearray(frame)
        for bit in (one, two):
            changed[bit // 8] ^= 1 << bit % 8
        try:
            yield trio.decode(bytes(changed))
        except trio.DecodeError:
            continue


def test_in_the_whole_frame_two_bits_can_only_change_address_or_type() -> None:
    """Of 8128 errors at most 5 are accepted: an address changed at both ends, and both bits of the type."""
    for address in (1, 5, 10, 15):
        message = trio.DirectVariableTransfer(address=address, number=77, value=Decimal("-1234.5"))
        others = list(accepted(message.to_frame()))
        variables = [other for other in others if isinstance(other, trio.DirectVariableTransfer)]
        texts = [other for other in others if isinstance(other, trio.CharacterTransfer)]
        assert len(others) == len(variables) + len(texts) <= 5
        assert len(texts) == 1
        assert all((other.number, other.value) == (77, message.value) for other in variables)
        assert all(other.address != address for other in variables)
