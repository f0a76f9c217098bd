"""Generated Python agrees with the reference for random input."""

from __future__ import annotations

import functools
from collections.abc import Callable
from decimal import Decimal
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from qlinkgen.model.frame import DelimitedFrame
from qlinkgen.model.message import Message, Value
from qlinkgen.model.types import Array, Blob, Count, Scalar
from qlinkgen.model.values import native_from_raw
from tests.proof import cases
from tests.proof.outputs import OUTPUTS, Decoded, Output, Refused

every_protocol = pytest.mark.parametrize("name", cases.PROTOCOLS)


@functools.cache
def output(name: str, kind: str) -> Output:
    return OUTPUTS[kind](name)


def outcome(call: Callable[[], Any]) -> Any:
    """The result, or a refusal."""
    try:
        return call()
    except Refused as error:
        return Refused, error.kind


def both(name: str, call: Callable[[Output], Any]) -> tuple[Any, Any]:
    """The results of the reference and of generated Python."""
    return outcome(lambda: call(output(name, "construct"))), outcome(lambda: call(output(name, "python")))


# Values


def numbers(scalar: Scalar) -> st.SearchStrategy[Any]:
    """Mostly legal, sometimes one step past the range, or between two steps."""
    low, high = scalar.minimum, scalar.maximum
    raw = st.integers(low, high) | st.sampled_from([low, high, low - 1, high + 1])
    native = raw.map(lambda number: native_from_raw(scalar, number))
    if scalar.number == "float":
        first, last = sorted([float(scalar.physical(low - 1)), float(scalar.physical(high + 1))])
        return native | st.floats(first, last)
    if scalar.number == "decimal":
        return native | native.map(lambda number: Decimal(str(number)) + Decimal("1e-12"))
    return native


def items(value: Value) -> st.SearchStrategy[Any]:
    """Any legal value of a field, and a few that are not."""
    kind = value.type
    if isinstance(kind, Scalar):
        return st.booleans() if kind.meaning == "bool" else numbers(kind)
    assert isinstance(kind, Array | Blob)
    longest = kind.length.maximum + 1
    if isinstance(kind, Array):
        return st.lists(numbers(kind.item), min_size=kind.length.minimum, max_size=longest)
    if kind.text:
        return st.text(st.characters(max_codepoint=130), min_size=kind.length.minimum, max_size=longest)
    return st.binary(min_size=kind.length.minimum, max_size=longest)


def some_message(name: str) -> st.SearchStrategy[Message]:
    return st.sampled_from(cases.protocol(name).messages)


@every_protocol
@given(data=st.data())
def test_any_values_become_the_same_bytes_or_are_refused(name: str, data: st.DataObject) -> None:
    message = data.draw(some_message(name))
    fields = {value.name: data.draw(items(value)) for value in message.values}
    address = data.draw(st.integers(0, 0xFF)) if message.addresses else 0
    request = request_of(name, message)
    expected, found = both(name, lambda each: each.encode(message, fields, address, request))
    assert found == expected


# Bytes


@every_protocol
@given(data=st.data())
def test_any_payload_becomes_the_same_values_or_is_refused(name: str, data: st.DataObject) -> None:
    message = data.draw(some_message(name))
    payload = data.draw(st.binary(max_size=message.max_size + 1) | mutated(payloads(name, message)))
    expected, found = both(name, lambda each: dict(each.decode_payload(message, payload)))
    assert without_kind(found) == without_kind(expected)


@every_protocol
@given(data=st.data())
def test_any_frame_becomes_the_same_message_or_is_refused(name: str, data: st.DataObject) -> None:
    message = data.draw(some_message(name))
    wire = data.draw(st.binary(max_size=40) | mutated(wires(name, message)))
    expected, found = both(name, lambda each: plain(each.decode(message, wire, request_of(name, message))))
    assert without_kind(found) == without_kind(expected)


@every_protocol
@given(data=st.data())
def test_any_wrapped_payload_is_refused_for_the_same_reason(name: str, data: st.DataObject) -> None:
    message = data.draw(some_message(name))
    payload = data.draw(mutated(payloads(name, message)))
    request = request_of(name, message)
    wire = cases.reference(name).wrap(message.name, payload, message.default_address, request)
    expected, found = both(name, lambda each: plain(each.decode(message, wire, request)))
    assert as_reason(name, message, found) == as_reason(name, message, expected)


def as_reason(name: str, message: Message, found: Any) -> Any:
    """A refusal in which indistinguishable reasons are equal.

    Without a length, a frame that is cut short and a payload of the wrong size are indistinguishable. After a
    wrong count the fields are shifted: size and a value can be wrong at once, and either may be reported.
    """
    kinds = [field.type for field in message.fields if isinstance(field.type, Scalar)]
    counted = any(isinstance(kind.role, Count) for kind in kinds)
    if counted and found in ((Refused, "length"), (Refused, "range"), (Refused, "truncated")):
        return Refused
    frame = cases.protocol(name).frame
    if isinstance(frame, DelimitedFrame) and frame.part("length") is None and found == (Refused, "truncated"):
        return Refused, "length"
    return found


def plain(found: Decoded) -> tuple[str, int, dict[str, Any]]:
    return found.message, found.address, dict(found.fields)


def without_kind(found: Any) -> Any:
    """Reasons are compared if only one is possible."""
    return Refused if isinstance(found, tuple) and found[0] is Refused else found


@functools.cache
def wires(name: str, message: Message) -> tuple[bytes, ...]:
    return tuple(case.wire for case in cases.cases(name) if case.message is message)


@functools.cache
def payloads(name: str, message: Message) -> tuple[bytes, ...]:
    return tuple(case.payload for case in cases.cases(name) if case.message is message)


@functools.cache
def request_of(name: str, message: Message) -> bytes:
    return next((case.request for case in cases.cases(name) if case.message is message), b"")


@st.composite
def mutated(draw: st.DrawFn, originals: tuple[bytes, ...]) -> bytes:
    """One of several byte strings, unchanged or with a byte changed, lost or added."""
    data = bytearray(draw(st.sampled_from(originals)))
    for change in draw(st.lists(st.sampled_from(["change", "lose", "add"]), max_size=2)):
        at = draw(st.integers(0, len(data)))
        if change == "add":
            data.insert(at, draw(st.sampled_from([0x00, 0x01, 0x80, 0xA5, 0xFF]) | st.integers(0, 0xFF)))
        elif at < len(data):
            if change == "lose":
                del data[at]
            else:
                data[at] = draw(st.integers(0, 0xFF))
    return bytes(data)
