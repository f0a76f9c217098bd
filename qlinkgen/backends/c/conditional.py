"""Parts of a frame that only some frames have: what decides, and what writes them."""

from __future__ import annotations

from dataclasses import dataclass

from qlinkgen.backends.c.conditions import condition
from qlinkgen.backends.c.places import Places
from qlinkgen.model.condition import Test
from qlinkgen.model.naming import member
from qlinkgen.model.types import Scalar
from qlinkgen.plan.conditional import Conditional, Selector


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
    numbers = {each.name: each.number for each in conditional.values}
    defaults = {name: number.default for name, number in numbers.items()}
    tests = [Test(name, ((default, default),), negated=True) for name, default in defaults.items()]
    return [condition((test,), numbers, lambda name: f"parts->{member(name)}") for test in tests]
