"""Construct structures and the interpreter of the plan agree on frames, values and errors."""

from __future__ import annotations

import random
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, assert_never

import pytest
from construct import ConstructError

from qlinkgen.backends import construct
from qlinkgen.model.fields import Record, Records, Value, applies, chosen
from qlinkgen.model.message import Direction, Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.types import Array, Blob, Float, Scalar
from qlinkgen.model.values import native_from_raw
from qlinkgen.plan import plan_of
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.content import BadContent, Raw, Unsendable, pack, unpack
from qlinkgen.plan.reading import BadFrame
from qlinkgen.schema import loads
from qlinkgen.schema.loader import load
from tests.proof.outputs import plain_numbers
from tests.support.random_raw import damaged, random_address, random_values
from tests.support.whole.schemas import generate

_ROOT = Path(__file__).resolve().parents[2]
_FILES = sorted([*(_ROOT / "schemas").glob("*.yaml"), *(_ROOT / "tests" / "schemas").glob("*.yaml")])
_SEEDS = range(40)
#: Random payloads and frames of each message, half of them damaged.
_TRIES = 12

every_schema = pytest.mark.parametrize("name", [*(path.stem for path in _FILES), *map(str, _SEEDS)])


class Both:
    """The interpreter and the structures of one protocol."""

    def __init__(self, protocol: Protocol) -> None:
        self.protocol = protocol
        self.plan = plan_of(protocol)
        self.codec = Codec(self.plan)
        self.live = construct.live(protocol)

    def natives(self, message: Message, raws: Mapping[str, Raw]) -> dict[str, Any]:
        """Raw values in the types of construct."""
        return _natives((value for value in chosen(message.values, raws.get) if value.name in raws), raws)

    def frame(self, message: Message) -> Direction:
        """The direction of the frame of the message."""
        return message.direction if message.direction in self.live.frames else "request"

    def same_payload(self, message: Message, payload: bytes) -> None:
        """Check that structures and interpreter decode a payload to the same result."""
        try:
            expected: object = self.natives(message, unpack(self.plan.message(message.name).payload, payload))
        except BadContent:
            expected = None
        try:
            found: object = plain_numbers(self.live.messages[message.name].parse(payload))
        except ConstructError:
            found = None
        assert repr(found) == repr(expected), (message.name, payload.hex())  # NaN does not equal itself

    def same_frame(self, direction: Direction, wire: bytes, request: bytes) -> None:
        """Check that both decode a frame to the same result, or reject it for the same reason."""
        found, expected = self._parsed(direction, wire, request), self._decoded(direction, wire, request)
        assert repr(found) == repr(expected), (direction, wire.hex())

    def _decoded(self, direction: Direction, wire: bytes, request: bytes) -> object:
        try:
            decoded = self.codec.decode(wire, direction, request)
        except BadFrame as bad:
            return bad.kind
        message = decoded.message.message
        return message.name, decoded.address, self.natives(message, decoded.values)

    def _parsed(self, direction: Direction, wire: bytes, request: bytes) -> object:
        try:
            found = self.live.parse(direction, wire, request)
        except ConstructError as error:
            return getattr(error, "kind", "")
        return found["message"], found.get(self.plan.frame.address), plain_numbers(found["fields"])


def _natives(values: Iterable[Value], raws: Mapping[str, Raw]) -> dict[str, Any]:
    return {value.name: _native(value, raws[value.name]) for value in values}


def _native(value: Value, raw: Raw) -> Any:
    kind = value.type
    if raw is None:  # left out
        return None
    match kind:
        case Scalar():
            assert isinstance(raw, int)
            return native_from_raw(kind, raw)
        case Blob():
            assert isinstance(raw, bytes)
            return raw.decode("ascii") if kind.text else raw
        case Array():
            assert isinstance(raw, list)
            return [native_from_raw(kind.item, each) for each in raw if isinstance(each, int)]
        case Record():
            assert isinstance(raw, Mapping)
            return _natives(chosen(kind.layout.values, raw.get), raw)
        case Records():
            assert isinstance(raw, list)
            records = [each for each in raw if isinstance(each, Mapping)]
            return [_natives(chosen(kind.layout.values, each.get), each) for each in records]
        case _:
            assert_never(kind)


@cache
def both(name: str) -> Both | None:
    """The pair of a file or of a random schema; None if lint rejects it."""
    path = next((path for path in _FILES if path.stem == name), None)
    protocol = load(path) if path else loads(generate(int(name)), "random.yaml")[0]
    return Both(protocol) if protocol else None


def _random_raws(message: Message, chance: random.Random) -> dict[str, Raw]:
    """Legal raw values by name; of a choice those of the case for its number, None if it has none."""
    drawn = list(zip(message.values, random_values(message, chance), strict=True))
    numbers = {value.name: raw for value, raw in drawn if not value.field.slot}
    sent = chosen(message.values, numbers.get)
    return {
        value.name: raw if not value.field.slot or applies(value.field.when, numbers.get) else None
        for value, raw in drawn
        if any(value is each for each in sent)
    }


@every_schema
def test_payloads_and_frames_are_decoded_as_by_the_plan(name: str) -> None:
    one = both(name)
    if one is None:
        return
    for message in one.protocol.messages:
        chance = random.Random(f"{name} {message.name}")
        steps, direction = one.plan.message(message.name).payload, one.frame(message)
        for _ in range(_TRIES):
            raws = _random_raws(message, chance)
            try:
                payload = pack(steps, raws)
            except Unsendable:  # more items than their count can tell
                continue
            address = random_address(message, chance)
            request = b""
            if one.plan.frame.needs_request and direction == "response":
                request = bytes((message.id,)) + chance.randbytes(chance.randrange(5))
            wire = one.codec.wrap(message.name, payload, address, request)
            assert one.live.payload(message.name, one.natives(message, raws)) == payload
            assert one.live.wrap(message.name, payload, address, request) == wire
            spoilt = damaged(payload, chance, payload or b"\0")[: one.plan.frame.max_payload]
            for each in (payload, spoilt, payload[:-1]):
                one.same_payload(message, each)
                wrapped = one.codec.wrap(message.name, each, address, request)
                one.same_frame(direction, wrapped, request)
            for each in (
                wire,
                damaged(wire, chance, wire),
                wire[: chance.randrange(len(wire))],
                wire + b"\0",
            ):
                one.same_frame(direction, each, request)


@every_schema
def test_illegal_values_are_refused_as_by_the_plan(name: str) -> None:
    one = both(name)
    for message in one.protocol.messages if one else ():
        assert one is not None
        for value in message.values:
            kind = value.type.item if isinstance(value.type, Array) else value.type
            if value.field.slot:  # the number of another field selects the case: see test_choices
                continue
            if not isinstance(kind, Scalar) or kind.meaning == "bool" or isinstance(kind.meaning, Float):
                continue
            for raw in (kind.minimum - 1, kind.minimum, kind.maximum, kind.maximum + 1):
                given: Raw = (
                    [raw] * max(1, value.type.length.minimum) if isinstance(value.type, Array) else raw
                )
                assert _sends(one, message, {value.name: given}), (message.name, value.name, given)


def _sends(one: Both, message: Message, raws: Mapping[str, Raw]) -> bool:
    """Check that both encode the same bytes, or reject the values."""
    natives = one.natives(message, raws)
    try:
        expected = pack(one.plan.message(message.name).payload, raws)
    except Unsendable:
        with pytest.raises(ConstructError):
            one.live.payload(message.name, natives)
        return True
    return one.live.payload(message.name, natives) == expected
