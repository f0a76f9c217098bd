"""Frames recovered from a corrupted stream, by the generated stream decoders and by a peer."""

from __future__ import annotations

import functools
import importlib
import importlib.util
import random
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from tests.proof import cases
from tests.proof.corruption import LookAlike, Stream, corrupted

FRAMES = 4000


@dataclass(frozen=True)
class Result:
    """One decoder on one stream.

    Attributes:
        intact: frames that arrived complete.
        recovered: intact frames that the decoder delivered.
        strange: delivered frames that were not sent; errors outside of a checksum are undetectable.
    """

    intact: int
    recovered: int
    strange: int


@dataclass(frozen=True, eq=False)
class Subject:
    """A protocol and its decoder.

    Attributes:
        frames: distinct frames, as sent.
        look_alike: makes bytes that look like the beginning of a frame.
        decoded: the frames that a decoder delivers from chunks of a stream.
        silent: chunks are what lies between two silences.
    """

    frames: Sequence[bytes]
    look_alike: LookAlike
    decoded: Callable[[Iterable[bytes]], Sequence[bytes]]
    silent: bool = False

    def stream(self, kind: str) -> Stream:
        """The frames under one kind of corruption."""
        return corrupted(self.frames, kind, self.look_alike)

    @functools.lru_cache  # noqa: B019  # there are few subjects, and a result takes a while
    def delivered(self, kind: str) -> Counter[bytes]:
        """The frames that the decoder delivers from a stream."""
        stream = self.stream(kind)
        return Counter(self.decoded(stream.pieces if self.silent else stream.chunks()))

    def lost(self, kind: str) -> Sequence[int]:
        """Where the intact frames of a stream begin that are not delivered."""
        stream, left = self.stream(kind), self.delivered(kind).copy()
        found = []
        for frame, offset in zip(stream.intact, stream.offsets, strict=True):
            left[frame] -= 1
            if left[frame] < 0:
                found.append(offset)
        return found

    def result(self, kind: str) -> Result:
        """The result of the decoder."""
        intact = len(self.stream(kind).intact)
        strange = sum((self.delivered(kind) - Counter(self.frames)).values())
        return Result(intact, intact - len(self.lost(kind)), strange)


@functools.cache
def qlink() -> Subject:
    """Distinct responses of slaves of all sizes."""
    live, chance = cases.reference("qlink"), random.Random("qlink")
    frames: list[bytes] = []
    fields: dict[str, Any]
    for number in range(FRAMES):
        node = chance.randint(1, 16)
        if number % 2:
            name, fields = "motion.response", {"position": number, "inputs": 0xA5, "fifo_space": node}
        else:
            data = number.to_bytes(2, "big") + chance.randbytes(chance.randint(0, 23))
            name, fields = "loop_back.response", {"offset": 0xA5, "data": data}
        frames.append(live.wrap(name, live.payload(name, fields), node))
    return Subject(
        frames, lambda each: bytes([0xA5, 0xA5, each.randint(4, 30)]), _delivered("qlink", "response")
    )


@functools.cache
def trio() -> Subject:
    """Distinct texts and variables."""
    live, chance = cases.reference("trio"), random.Random("trio")
    frames: list[bytes] = []
    fields: dict[str, Any]
    for number in range(FRAMES):
        if number % 2:
            name, fields = (
                "direct_variable_transfer",
                {"number": number, "value": chance.randint(-1000, 1000)},
            )
        else:
            name, fields = "character_transfer", {"characters": f"{number:04}" + "x" * chance.randint(0, 20)}
        frames.append(live.wrap(name, live.payload(name, fields), chance.randint(1, 15)))
    return Subject(
        frames, lambda each: bytes([0x80 | each.randint(1, 15) << 3 | each.randint(1, 4)]), _delivered("trio")
    )


def _delivered(name: str, *direction: str) -> Callable[[Iterable[bytes]], Sequence[bytes]]:
    def decoded(chunks: Iterable[bytes]) -> Sequence[bytes]:
        module = cases.module(name)
        decoder = module.StreamDecoder(*direction)
        events = [event for chunk in chunks for event in decoder.feed(chunk)] + decoder.finish()
        return [event.to_frame() for event in events if not isinstance(event, module.Fault)]

    return decoded


def has_pymavlink() -> bool:
    """Whether the peer is installed."""
    return importlib.util.find_spec("pymavlink") is not None


@functools.cache
def mavlink() -> Subject:
    """MAVLink 2 frames of similar sizes, with the robust decoder of pymavlink."""
    dialect = importlib.import_module("pymavlink.dialects.v20.common")
    sender, chance = dialect.MAVLink(None, srcSystem=1), random.Random("mavlink")
    frames = []
    for number in range(FRAMES):
        message = sender.system_time_encode(chance.getrandbits(64), number)
        if number % 2 == 0:
            message = sender.statustext_encode(6, f"{number:04}".encode() + b"x" * chance.randint(0, 20))
        frames.append(bytes(message.pack(sender)))
        sender.seq = (sender.seq + 1) % 256
    return Subject(
        frames, lambda each: bytes([0xFD, each.randint(4, 30)]), functools.partial(_mavlink_decoded, dialect)
    )


def _mavlink_decoded(dialect: Any, chunks: Iterable[bytes]) -> Sequence[bytes]:
    receiver = dialect.MAVLink(None)
    receiver.robust_parsing = True
    events = [event for chunk in chunks for event in receiver.parse_buffer(chunk) or ()]
    # It passes on messages with an unknown id without verifying their checksum; these do not count.
    return [
        bytes(each.get_msgbuf()) for each in events if not each.get_type().startswith(("BAD_DATA", "UNKNOWN"))
    ]
