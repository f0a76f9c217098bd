"""Two sides that encode and decode the same messages: a schema of the library, and somebody else's library.

Both build objects of plain values and encode them; both decode a stream and read every field. What a library
reads from a port gets the stream in the same pieces as the generated decoder.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from types import ModuleType
from typing import Any

from benchmarks import messages
from benchmarks.peer import PeerMissing
from qlinkgen.backends.python import load as load_module
from qlinkgen.schema import find
from qlinkgen.schema import load as load_schema

#: Times that the messages of a pair are in its stream.
REPEATS = 4

Values = Mapping[str, Any]
Encode = Callable[[], list[bytes]]
Decode = Callable[[], Sequence[object]]


@dataclass(frozen=True)
class Side:
    """The frames of all messages, built of values; and the fields of all messages in the stream."""

    encode: Encode
    decode: Decode


@dataclass(frozen=True)
class Pair:
    """A protocol, its library, the number of messages, and the goal: times as fast."""

    protocol: str
    peer: str
    count: int
    limit: float
    ours: Side
    theirs: Side

    def work(self, side: str, name: str) -> Callable[[], object]:
        """What is timed: "ours" or "theirs", "encode" or "decode"."""
        each = self.ours if side == "ours" else self.theirs
        return each.encode if name == "encode" else each.decode


def checked(pair: Pair) -> Pair:
    """The pair, if both sides make the same frames and find every message."""
    ours, theirs = (list(map(bytes, side.encode())) for side in (pair.ours, pair.theirs))
    if ours != theirs:
        raise PeerMissing(f"{pair.peer} encodes other bytes than expected")
    counts = len(pair.ours.decode()), len(pair.theirs.decode())
    if counts != (pair.count, pair.count):
        raise PeerMissing(f"{pair.peer} decodes {counts[1]} of {pair.count} messages, this {counts[0]}")
    return pair


# The generated module ---------------------------------------------------------------------------------------


def module_of(name: str) -> ModuleType:
    return load_module(load_schema(find(name)))


def own(module: ModuleType, listed: Iterable[tuple[str, Values]], direction: str = "") -> Side:
    """Encodes the messages, and decodes their stream in pieces of 1 to 64 bytes."""
    built = [(module.MESSAGES[name], values) for name, values in listed] * REPEATS
    encode = encoder(built)
    return Side(encode, decoder(module, messages.chunks(b"".join(encode())), direction))


def encoder(built: Sequence[tuple[Any, Values]]) -> Encode:
    kinds = {f"f{index}": kind for index, (kind, _) in enumerate(built)}
    calls = (
        f"{name}({arguments(values)}).to_frame()" for name, (_, values) in zip(kinds, built, strict=True)
    )
    return spelled(calls, kinds)


def arguments(values: Values) -> str:
    """Values as arguments with keywords."""
    return ", ".join(f"{name}={value!r}" for name, value in values.items())


def spelled(calls: Iterable[str], names: Mapping[str, Any]) -> Encode:
    """A function of these calls, with their arguments spelled as in a program."""
    found: Encode = eval(f"lambda: [{', '.join(calls)}]", dict(names))  # our own text
    return found


def decoder(
    module: ModuleType, pieces: Sequence[bytes], direction: str = "", beside: Sequence[str] = ()
) -> Decode:
    """Decodes pieces of a stream, and reads all fields and some values of the frame."""
    readers = {kind: reader(*beside, *kind.FIELDS) for kind in module.MESSAGES.values()}
    arguments = (direction,) if direction else ()

    def decode() -> list[object]:
        feed = module.StreamDecoder(*arguments).feed
        return [readers[type(each)](each) for piece in pieces for each in feed(piece)]

    return decode


def reader(*names: str) -> Callable[[Any], object]:
    """A function that reads these attributes of an object."""
    return attrgetter(*names) if names else lambda _: ()
