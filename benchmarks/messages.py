"""The messages of all benchmarks: one motion.response, one motion.request, and seeded traffic of them.

Also the frame of Q.link by hand, for peers without frames.
"""

from __future__ import annotations

import random
from binascii import crc_hqx
from collections.abc import Iterator
from struct import Struct
from typing import NamedTuple

NODE = 3
MOTION = 0x20
PREAMBLE = b"\xa5\xa5"

RESPONSE_STRUCT = Struct(">BBiHB")
REQUEST_STRUCT = Struct(">BB12H")
WORDS = tuple(range(1000, 13000, 1000))
REQUEST_VALUES = (1, 2, *WORDS)


class ResponseFields(NamedTuple):
    """The five fields of motion.response, nine bytes."""

    counter: int = 1
    inputs: int = 2
    position: int = -746455
    motor_status: int = 3
    fifo_space: int = 200


RESPONSE = ResponseFields()
RESPONSE_DATA = RESPONSE_STRUCT.pack(*RESPONSE)
REQUEST_DATA = REQUEST_STRUCT.pack(*REQUEST_VALUES)


def wrap(command: int, node: int, data: bytes) -> bytes:
    """Q.link's frame by hand, optimised: length, CRC and stuffing by C code of the standard library."""
    body = bytes((len(data) + 4, command, node)) + data
    body += crc_hqx(body, 0xFFFF).to_bytes(2, "big")
    if 0xA5 in body:
        body = body.replace(b"\xa5", b"\xa5\x00")
    return PREAMBLE + body


def unwrap(wire: bytes) -> tuple[int, int, bytes]:
    """Command, node and data of a frame; the counterpart of `wrap`."""
    body = wire[2:]
    if 0xA5 in body:
        body = body.replace(b"\xa5\x00", b"\xa5")
    if wire[:2] != PREAMBLE or body[0] != len(body) - 1 or crc_hqx(body, 0xFFFF):
        raise ValueError(wire.hex())
    return body[1], body[2], body[3:-2]


RESPONSE_WIRE = wrap(MOTION, NODE, RESPONSE_DATA)
REQUEST_WIRE = wrap(MOTION, NODE, REQUEST_DATA)


def motion(count: int, seed: int = 1) -> Iterator[ResponseFields]:
    """Answers of moving axes: counters increment, positions change slowly, few bits change."""
    chance = random.Random(seed)
    position = RESPONSE.position
    for i in range(count):
        position += chance.randint(-2000, 5000)
        yield ResponseFields(i // 16 & 0xFF, chance.randrange(4), position, 3, chance.randint(100, 255))


def anything(count: int, seed: int = 2) -> Iterator[ResponseFields]:
    """Every field over its whole range: more A5 than on a usual line."""
    chance = random.Random(seed)
    for _ in range(count):
        yield ResponseFields(*RESPONSE_STRUCT.unpack(chance.randbytes(9)))


def noisy(frames: list[bytes], seed: int = 3) -> bytes:
    """Frames with stray bytes between every tenth pair, and a corrupted byte in every twentieth frame."""
    chance = random.Random(seed)
    stream = bytearray()
    for frame in frames:
        start = len(stream)
        stream += frame
        if chance.random() < 0.05:
            stream[start + chance.randrange(len(frame))] ^= 1 << chance.randrange(8)
        if chance.random() < 0.1:
            stream += bytes(chance.choices((0xA5, 0x00, 0x55, chance.randrange(256)), k=chance.randint(1, 8)))
    return bytes(stream)


def chunks(stream: bytes, seed: int = 4) -> list[bytes]:
    """The stream in pieces of 1 to 64 bytes, as read from a port."""
    chance = random.Random(seed)
    pieces, at = [], 0
    while at < len(stream):
        size = chance.randint(1, 64)
        pieces.append(stream[at : at + size])
        at += size
    return pieces
