"""Any value of any kind of field is encoded to the right bytes, or raises EncodeError.

Encoders accept integers of other libraries: those that only have `__index__`, and those of a fixed width,
like numpy's, which lose bits when shifted.
"""

from __future__ import annotations

import functools
import itertools
import random
from collections.abc import Callable, Iterator
from decimal import Decimal
from fractions import Fraction
from operator import index
from typing import Any

import pytest

from qlinkgen.backends import python
from qlinkgen.schema import loads
from tests.python.protocols import module as shipped
from tests.support import field_kinds
from tests.support.field_kinds import KINDS, LENGTH, STUFFED, BitFields, Edge, Layout, Row

#: Kinds that can precede other fields.
CLOSED = tuple(kind for kind in KINDS if not isinstance(kind, Row) or not kind.open)
#: Each kind alone, then several fields in a message.
LAYOUTS = (
    *(Layout((kind,)) for kind in KINDS),
    *(Layout(CLOSED[at : at + 5]) for at in range(0, len(CLOSED), 5)),
)
FRAMES = {"length": (LENGTH, {}), "stuffed": (STUFFED, {"node": 3})}
EDGES: tuple[Edge, ...] = ("least", "most", "any")


class Bare:
    """An integer that only has `__index__`."""

    def __init__(self, number: int) -> None:
        self._number = number

    def __index__(self) -> int:
        return self._number

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self._number if abs(self._number) < 2**70 else '...'})"


@functools.total_ordering
class Narrow(Bare):
    """An integer like numpy's: of the minimum width, also in the results of computations."""

    def __eq__(self, other: object) -> bool:
        return self._number == other

    def __lt__(self, other: int) -> bool:
        return self._number < other

    def __hash__(self) -> int:
        return hash(self._number)

    def _wrapped(self, number: int) -> Narrow:
        signed = self._number < 0
        bits = next(bits for bits in (8, 16, 32, 64) if self._number.bit_length() + signed <= bits)
        low = -(1 << bits - 1) if signed else 0
        return Narrow((number - low) % (1 << bits) + low)

    def __lshift__(self, other: int) -> Narrow:
        return self._wrapped(self._number << other)

    def __rshift__(self, other: int) -> Narrow:
        return self._wrapped(self._number >> other)

    def __and__(self, other: int) -> Narrow:
        return self._wrapped(self._number & index(other))

    def __or__(self, other: int) -> Narrow:
        return self._wrapped(self._number | index(other))

    __rand__, __ror__ = __and__, __or__


@functools.cache
def module(frame: str) -> Any:
    """The generated module of all layouts."""
    protocol, faults = loads(field_kinds.schema(LAYOUTS, FRAMES[frame][0]), "values.yaml")
    assert protocol, faults
    return python.load(protocol)


def drawn() -> Iterator[tuple[str, Layout, dict[str, Any], bytes]]:
    """Values and payload of each message, by name."""
    for number, layout in enumerate(LAYOUTS):
        rng = random.Random(number)
        for edge in EDGES:
            values, payload = layout.draw(rng, edge)
            yield f"m{number}", layout, values, payload


def wrapped(value: Any, kind: Callable[[int], Any]) -> Any:
    """A value with its whole numbers as instances of a class."""
    if isinstance(value, list):
        return [kind(item) for item in value]
    if isinstance(value, int | float | Decimal) and value == int(value):
        return kind(int(value))
    return value


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("kind", [Bare, Narrow])
def test_integers_of_other_libraries_are_sent_unchanged(frame: str, kind: Callable[[int], Any]) -> None:
    for name, layout, values, payload in drawn():
        plain = {name: wrapped(value, kind) for name, value in values.items()}
        address = {name: kind(number) for name, number in FRAMES[frame][1].items()}
        message = module(frame).MESSAGES[name](**plain, **address)
        assert message.to_bytes().hex() == payload.hex(), layout
        same = module(frame).MESSAGES[name](**values, **FRAMES[frame][1])
        assert message.to_frame() == same.to_frame(), layout


@pytest.mark.parametrize("kind", [Bare, Narrow, bool])
def test_an_address_in_a_header_is_an_integer_of_any_kind(kind: Callable[[int], Any]) -> None:
    message = shipped("trio").KeypadMode
    assert message(address=kind(1), mode=kind(1)).to_frame() == message(address=1, mode=1).to_frame()
    with pytest.raises(shipped("trio").EncodeError):
        message(address=Bare(16), mode=1).to_frame()


NUMBERS = (0, -1, 5, 20, 1 << 31, (1 << 63) - 1, 1 << 64, 10**5000, -(10**5000))
WRONG: tuple[Any, ...] = (
    *(
        None,
        "",
        "3",
        "é",
        "\ud800",
        b"",
        b"x",
        b"\xff\xff",
        bytearray(3),
        memoryview(b"abcd"),
        ...,
        int,
        object(),
    ),
    *(True, False, 0.0, 5.0, 0.5, 1e300, float("nan"), float("inf"), -float("inf"), 1j),
    *(Decimal(5), Decimal("0.5"), Decimal("NaN"), Decimal("sNaN"), Decimal("-Infinity")),
    *(Decimal("1E+999999"), Decimal("1E-999999"), Fraction(5), Fraction(1, 3), Fraction(10**400)),
    *NUMBERS,
    *map(Bare, NUMBERS),
    *([number] for number in NUMBERS),
    *([1, 2], (1, 2), [True, False], [Bare(1)], [Bare(1 << 64)], range(2), {1, 2}, {}, iter([1])),
    *([1.0], [None], ["a"], "ab", [[1]], [Decimal(1)], [float("nan")], [b"a"]),
)


@pytest.mark.parametrize("frame", FRAMES)
def test_any_value_is_sent_unchanged_or_refused_with_its_field(frame: str) -> None:
    codec = module(frame)
    rng = random.Random(7)
    for number, kind in enumerate(KINDS):
        values, _ = Layout((kind,)).draw(rng, "any")
        for field, wrong in itertools.product(values, WRONG):
            message = codec.MESSAGES[f"m{number}"](**values, **FRAMES[frame][1])
            setattr(message, field, wrong)
            payload = sent(codec, message)
            if isinstance(payload, codec.EncodeError):
                assert payload.field == field, (kind.name, wrong)
                assert field in str(payload)
                continue
            back = codec.MESSAGES[f"m{number}"].from_bytes(payload, **FRAMES[frame][1])
            assert stands_for(wrong, getattr(back, field)), (kind.name, wrong, payload)
            others = [name for name in values if name != field]
            assert [getattr(back, name) for name in others] == [values[name] for name in others]


def sent(codec: Any, message: Any) -> Any:
    """The payload, or the codec's error."""
    try:
        return message.to_bytes()
    except codec.EncodeError as error:
        return error


def stands_for(given: Any, value: Any) -> bool:
    """Whether a decoded value is the given one, or its nearest step."""
    if isinstance(value, list):
        return [index(item) for item in given] == value
    if isinstance(value, str):
        return bool(given == value)
    if isinstance(value, bytes):
        return bytes(memoryview(given)) == value
    number = index(given) if hasattr(given, "__index__") else given
    whole = isinstance(value, int) and isinstance(number, int)
    return bool(number == value) if whole else abs(Fraction(number) - Fraction(value)) <= 5


def test_the_kinds_have_fields_of_more_than_32_bits_in_bits() -> None:
    """Layouts in which shifting a narrow integer loses all bits."""
    wide = [kind for kind in KINDS if isinstance(kind, BitFields)]
    assert any(at >= 32 for kind in wide for at, _, _ in kind.members.values())
