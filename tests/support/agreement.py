"""A C program and the interpreter of the plan agree on frames and streams with any damage."""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator, Sequence

from qlinkgen.model.message import Direction
from qlinkgen.plan import Plan
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.coding import Insertion
from qlinkgen.plan.content import Raw, Unsendable
from qlinkgen.plan.ends import Rescan
from qlinkgen.plan.parts import ConstantPart
from qlinkgen.plan.reading import BadFrame
from qlinkgen.plan.receive import Event, receiver
from qlinkgen.plan.transparency import FrameStuffing, PayloadStuffing, SevenBit
from qlinkgen.plan.tree import MessagePlan
from tests.support.cdriver import Driver
from tests.support.random_raw import damaged, random_address, random_values


def marks(plan: Plan) -> bytes:
    """The bytes that are significant to a receiver."""
    found = b"".join(part.data for part in plan.frame.envelope.parts if isinstance(part, ConstantPart))
    transparency = plan.frame.transparency
    if isinstance(transparency, FrameStuffing | PayloadStuffing) and isinstance(transparency.rule, Insertion):
        found += transparency.rule.inserted * 3
    if isinstance(transparency, SevenBit):
        found += bytes((transparency.marker, 0x8A, 0x99, 0x88))
    return found + bytes((0, 1, 3, 16)) + bytes(message.id & 0xFF for message in plan.messages[:4])


def wire(plan: Plan, message: MessagePlan, rng: random.Random, request: bytes = b"") -> bytes:
    """A valid frame of random values, or one with wrong contents."""
    values: dict[str, Raw] = {
        value.name: raw
        for value, raw in zip(message.message.values, random_values(message.message, rng), strict=True)
    }
    codec, address = Codec(plan), random_address(message.message, rng)
    try:
        frame = codec.encode(message.name, values, address if message.allowed else None, request)
    except Unsendable:
        frame = b""
    if frame and rng.random() < 0.9:
        return frame
    payload = rng.randbytes(rng.choice((message.payload.least, message.payload.most)))
    if isinstance(plan.frame.transparency, SevenBit):
        payload = bytes(byte & 0x7F for byte in payload)
    return codec.wrap(message.name, payload, rng.choice((address, 0)), request)


def streams(plan: Plan, direction: Direction, rng: random.Random, number: int) -> Iterator[bytes]:
    """Frames, most of them damaged, and noise."""
    messages, alphabet = plan.received(direction), marks(plan)
    for each in range(number if messages else 0):
        stream = b"".join(wire(plan, rng.choice(messages), rng) for _ in range(rng.randint(1, 6)))
        if each % 8 == 7:
            stream = bytes(rng.choices(alphabet + bytes(range(8)), k=rng.randint(0, 300)))
        yield damaged(stream, rng, alphabet) if each % 8 else stream


def event_text(event: Event) -> str:
    """An event in the format of the program."""
    if event.decoded is None:
        return f"{event.at}:{event.kind}"
    decoded = event.decoded
    address = "-" if decoded.address is None else decoded.address
    return f"{event.at}:message:{decoded.message.name}:{address}:{decoded.payload.hex() or '-'}"


def events(plan: Plan, direction: Direction, stream: bytes) -> list[str]:
    """The events of a receiver; one without a buffer reports nothing at the end."""
    machine = receiver(plan, direction)
    found = [event_text(event) for byte in stream for event in machine.feed(byte)]
    ends = machine.finish() if isinstance(plan.frame.receiver, Rescan) else ()
    return found + [event_text(event) for event in ends]


def kind(plan: Plan, direction: Direction, frame: bytes, request: bytes = b"") -> str:
    """The kind of fault of bytes decoded as one whole frame."""
    try:
        Codec(plan).decode(frame, direction, request)
    except BadFrame as bad:
        return bad.kind
    return "intact"


def compare(plan: Plan, direction: Direction, driver: Driver, rng: random.Random, number: int) -> None:
    """Compare streams in the receiver, and all prefixes of valid and damaged frames as whole ones."""
    for stream in streams(plan, direction, rng, number):
        said = driver.ask("stream", direction, stream.hex() or "-").split()[1:]
        due = events(plan, direction, stream)
        assert said == due, (direction, stream.hex(), _difference(said, due))
    for each in range(number // 2 if plan.received(direction) else 0):
        frame = wire(plan, rng.choice(plan.received(direction)), rng)
        frame = damaged(frame, rng, marks(plan)) if each % 4 else frame
        expected = [kind(plan, direction, frame[:end]) for end in range(len(frame) + 1)]
        assert driver.ask("cuts", direction, frame.hex() or "-").split()[1:] == expected, frame.hex()


def _difference(said: Sequence[str], due: Sequence[str]) -> str:
    """The first different events of C and the interpreter."""
    pairs = itertools.zip_longest(said, due, fillvalue="nothing")
    return next(f"{one} instead of {other}" for one, other in pairs if one != other)
