"""Encoded messages are decoded to equal ones; any bytes result in a message or the documented error."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qlinkgen.model.types import Scalar
from tests.python.protocols import EVERY, build, decode, module, protocol, wire_of
from tests.support import strategies

MESSAGES = [
    pytest.param(name, message.name, id=f"{name}-{message.name}")
    for name in EVERY
    for message in protocol(name).messages
]


@pytest.mark.parametrize(("name", "called"), MESSAGES)
@settings(max_examples=15)
@given(data=st.data())
def test_every_message_survives(name: str, called: str, data: st.DataObject) -> None:
    message = protocol(name).by_name[called]
    arguments = data.draw(strategies.arguments(protocol(name), message))
    kind = module(name).MESSAGES[message.name]
    built = kind(**arguments)
    payload = built.to_bytes()
    assert message.min_size <= len(payload) <= message.max_size
    address = {name: value for name, value in arguments.items() if name == kind.ADDRESS}
    assert kind.from_bytes(payload, **address) == built
    wire = wire_of(name, message, built)
    assert len(wire) <= kind.MAX_WIRE_SIZE
    back = decode(name, message, wire)
    assert type(back) is kind
    assert back == built
    for field, value in arguments.items():
        assert getattr(back, field) == value
        assert type(getattr(back, field)) is type(value) or isinstance(value, int)


KINDS = {"crc", "stuffing", "length", "range", "unknown", "truncated", "frame", "illegal"}


@pytest.mark.slow
@pytest.mark.parametrize("name", EVERY)
@settings(max_examples=100)
@given(data=st.data())
def test_any_bytes_give_a_message_or_the_documented_error(name: str, data: st.DataObject) -> None:
    codec = module(name)
    message, arguments = data.draw(strategies.messages(protocol(name)))
    good = wire_of(name, message, codec.MESSAGES[message.name](**arguments))
    wire = data.draw(st.one_of(strategies.junk(protocol(name)), changed(good)))
    for attempt in (
        lambda: decode(name, message, wire),
        lambda: codec.MESSAGES[message.name].from_bytes(wire),
    ):
        found = outcome(codec, attempt)
        if not isinstance(found, codec.Message):
            assert found.kind in KINDS
            assert str(found)
            assert 0 <= found.offset <= max(len(found.data), 1)


def outcome(codec: Any, attempt: Callable[[], Any]) -> Any:
    """The result, or the error of the codec."""
    try:
        return attempt()
    except codec.CodecError as error:
        return error


def changed(wire: bytes) -> st.SearchStrategy[bytes]:
    """A frame with one byte replaced, or cut short."""
    places = st.tuples(st.integers(0, len(wire) - 1), st.integers(0, 255)) if wire else st.just((0, 0))
    replaced = places.map(lambda both: wire[: both[0]] + bytes((both[1],)) + wire[both[0] + 1 :])
    return st.one_of(replaced, st.integers(0, len(wire)).map(lambda end: wire[:end]))


@pytest.mark.parametrize("name", EVERY)
def test_decoders_take_anything_bytes_like_and_nothing_else(name: str) -> None:
    for message in protocol(name).messages:
        kind = module(name).MESSAGES[message.name]
        built = build(name, message)
        wire = wire_of(name, message, built)
        scattered = memoryview(bytes(byte for pair in zip(wire, wire, strict=True) for byte in pair))[::2]
        for data in (bytearray(wire), memoryview(wire), scattered):
            assert decode(name, message, data) == built  # type: ignore[arg-type]
        back = decode(name, message, memoryview(wire))  # type: ignore[arg-type]
        assert all(type(getattr(back, each)) is not memoryview for each in kind.FIELDS)
        wrong: Any
        for wrong in (None, 5, "text", 1.5, [1, 2], {}):
            with pytest.raises(TypeError):
                decode(name, message, wrong)
            with pytest.raises(TypeError):
                kind.from_bytes(wrong)


WRONG = [
    None,
    "3",
    b"x",
    float("nan"),
    1e400,
    -1e400,
    10**5000,
    -(10**5000),
    [1],
    ["a"],
    [None],
    {},
    object(),
]


@pytest.mark.parametrize("name", EVERY)
def test_whatever_a_field_holds_an_encode_error_names_it(name: str) -> None:
    codec = module(name)
    for message in protocol(name).messages:
        kind = codec.MESSAGES[message.name]
        fields = [value.name for value in message.values] + ([kind.ADDRESS] if message.addresses else [])
        for field in fields:
            for value in WRONG:
                refused(codec, name, message, field, value)


def refused(codec: Any, name: str, message: Any, field: str, value: object) -> None:
    """The value is legal (text, bytes, a list), or the error has all details."""
    built = build(name, message, **{field: value})
    wire = outcome(codec, lambda: wire_of(name, message, built))
    if isinstance(wire, codec.EncodeError):
        assert wire.field == field
        assert field in str(wire)
        assert message.name in str(wire)
    else:
        again = decode(name, message, wire)
        if isinstance(getattr(again, field), list):  # bytes and an empty dict are also sequences of numbers
            setattr(built, field, list(getattr(built, field)))
        assert again == built, f"{message.name}.{field} = {value!r} was sent as something else"


@pytest.mark.parametrize("name", EVERY)
def test_ranges_are_checked_both_ways(name: str) -> None:
    codec = module(name)
    for message in protocol(name).messages:
        for value in message.values:
            scalar = value.type
            if not isinstance(scalar, Scalar) or scalar.full_range or scalar.scaling is not None:
                continue
            for raw in (scalar.minimum - 1, scalar.maximum + 1):
                with pytest.raises(codec.EncodeError, match=value.name) as caught:
                    wire_of(name, message, build(name, message, **{value.name: raw}))
                assert caught.value.value == raw


def test_an_error_has_the_value_the_rule_and_the_unit() -> None:
    qlink = module("qlink")
    with pytest.raises(
        qlink.EncodeError, match=r"t1_delay: 30 cannot be sent; give a number, 0\.0\.\.25\.5 s"
    ):
        qlink.NodeSetupRequest(node=1, node_number=1, t1_delay=30).to_frame()
    with pytest.raises(qlink.EncodeError, match=r"segments: .* give a list of 0\.\.12 items"):
        qlink.MotionRequest(node=1, segments=[0] * 13).to_frame()
    with pytest.raises(
        qlink.DecodeError, match=r"node_number: received 17, expected a whole number, 1\.\.16"
    ) as caught:
        qlink.NodeSetupRequest.from_bytes(bytes((17, 0, 0, 0)))
    assert (caught.value.kind, caught.value.field, caught.value.offset) == ("range", "node_number", 0)
    with pytest.raises(qlink.DecodeError) as caught:
        qlink.MotionResponse.from_bytes(b"123")
    assert caught.value.kind == "length"


@pytest.mark.parametrize("kind", ["EncodeError", "DecodeError"])
def test_errors_can_be_pickled(kind: str) -> None:
    error = getattr(module("qlink"), kind)("text", "a", "b")
    assert vars(pickle.loads(pickle.dumps(error))) == vars(error)
