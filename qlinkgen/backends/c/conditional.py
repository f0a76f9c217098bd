"""Parts of a frame that only some frames have: what decides, and what writes them."""

from __future__ import annotations

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.c.conditions import condition
from qlinkgen.backends.c.names import unsigned
from qlinkgen.backends.c.places import Places
from qlinkgen.model.condition import Test
from qlinkgen.model.naming import member
from qlinkgen.model.types import Characters, Scalar
from qlinkgen.plan.conditional import Conditional, Selector
from qlinkgen.plan.payload import Member


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionalView:
    """Parts before the payload, or at the end, that only some frames have.

    Attributes:
        sent: the condition for a frame that is written, whose header is complete.
        received: the condition for a received header.
        size: bytes of all parts.
        put: statements that write them.
        refused: conditions on values that a frame without the parts cannot have.
    """

    sent: str
    received: str
    size: int
    put: list[str]
    refused: list[str]


def holds(places: Places, conditional: Conditional, place: str) -> str:
    """The condition for the presence of parts; ``place`` is the body."""
    selectors = {f"{at}": each for at, each in enumerate(conditional.selectors)}
    tests = [Test(name, each.test.ranges, each.test.negated) for name, each in selectors.items()]
    numbers = {name: _number(each) for name, each in selectors.items()}
    return condition(tests, numbers, lambda name: _bits(places, selectors[name], place))


def _number(selector: Selector) -> Scalar:
    return Scalar(bits=selector.bits, chunks=(), minimum=0, maximum=selector.mask)


def _bits(places: Places, selector: Selector, place: str) -> str:
    whole = selector.bits == selector.part.integer.bits
    return places.taken(places.get(selector.part, place), selector, whole=whole)


def refused(conditional: Conditional) -> list[str]:
    """Conditions that hold if a value is not its default."""
    return [test for each in conditional.values for test in _changed(each, f"parts->{member(each.name)}")]


def _changed(each: Member, value: str) -> list[str]:
    """Conditions that hold if a value is not its default."""
    default = each.number.default
    if isinstance(text := each.number.meaning, Characters):
        octets = (unsigned(byte, 8, hexadecimal=True) for byte in default.to_bytes(text.number, "big"))
        return [f"{value}[{at}] != {octet}" for at, octet in enumerate(octets)]
    test = Test(each.name, ((default, default),), negated=True)
    return [condition((test,), {each.name: each.number}, lambda _: value)]
