"""A fixed set of corruptions of a stream of frames, and the frames that remain intact."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

#: Bytes that look like the beginning of a frame.
LookAlike = Callable[[random.Random], bytes]

#: One in this number of frames or gaps is corrupted.
_ONE_IN = 4
_LONGEST_NOISE = 40
_LONGEST_CHUNK = 64


@dataclass(frozen=True)
class Stream:
    """A received stream.

    Attributes:
        data: the bytes.
        intact: the complete frames, in order.
        offsets: where each of them begins.
        pieces: the bytes of each frame, and those between frames, as a line with silences has them.
    """

    data: bytes
    intact: Sequence[bytes]
    offsets: Sequence[int]
    pieces: Sequence[bytes]

    def chunks(self) -> Iterator[bytes]:
        """The bytes in pieces, as a port returns them."""
        chance, at = random.Random(len(self.data)), 0
        while at < len(self.data):
            size = chance.randint(1, _LONGEST_CHUNK)
            yield self.data[at : at + size]
            at += size


def corrupted(frames: Sequence[bytes], kind: str, look_alike: LookAlike) -> Stream:
    """A stream of frames with one kind of corruption, a mixture of all, or none."""
    chance = random.Random(kind)
    pieces: list[bytes] = []
    intact, offsets, end = [], [], 0
    for frame in frames:
        if chance.randrange(_ONE_IN):
            arrived = [frame]
        else:
            chosen = chance.choice(KINDS) if kind == "all" else kind
            arrived = [_between(chosen, chance, look_alike), _inside(chosen, frame, chance)]
        end += sum(map(len, arrived))
        if b"".join(arrived).endswith(frame):
            intact.append(frame)
            offsets.append(end - len(frame))
        pieces += arrived
    return Stream(b"".join(pieces), intact, offsets, pieces)


def _inside(kind: str, frame: bytes, chance: random.Random) -> bytes:
    at = chance.randrange(1, len(frame))
    if kind == "bit flip":
        return frame[:at] + bytes([frame[at] ^ 1 << chance.randrange(8)]) + frame[at + 1 :]
    if kind == "byte lost":
        return frame[:at] + frame[at + 1 :]
    if kind == "byte inserted":
        return frame[:at] + chance.randbytes(1) + frame[at:]
    return frame[:at] if kind == "cut short" else frame


def _between(kind: str, chance: random.Random, look_alike: LookAlike) -> bytes:
    if kind == "noise between":
        return chance.randbytes(chance.randint(1, _LONGEST_NOISE))
    return look_alike(chance) if kind == "false preamble" else b""


KINDS = ("bit flip", "byte lost", "byte inserted", "cut short", "noise between", "false preamble")
EVERY_KIND = ("none", *KINDS, "all")
