"""Conditions on earlier values of a message."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from qlinkgen.backends.c.names import literal, storage
from qlinkgen.model import naming
from qlinkgen.model.condition import Test
from qlinkgen.model.types import Scalar
from qlinkgen.plan.payload import PayloadPlan


def numbers_of(payload: PayloadPlan) -> dict[str, Scalar]:
    """The numbers that conditions may test, by name."""
    holding = (*payload.decided_by, *payload.settable)
    found = {each.name: getattr(each, "number", None) for each in holding}
    return {name: number for name, number in found.items() if isinstance(number, Scalar)}


def place_of(payload: PayloadPlan, inside: str = "", parts: str = "parts->") -> Callable[[str], str]:
    """What prints a tested value of a struct, or of its frame.

    ``inside`` precedes the members of the struct, ``parts`` those of the frame.
    """
    beside = {each.name for each in payload.decided_by}

    def place(name: str) -> str:
        return (parts if name in beside else f"message->{inside}") + naming.member(name)

    return place


def condition(tests: Sequence[Test], numbers: dict[str, Scalar], value: Callable[[str], str]) -> str:
    """The expression of a condition; ``value`` prints a tested value."""
    terms = [_test(each, numbers[each.value], value(each.value)) for each in tests]
    return terms[0] if len(terms) == 1 else " && ".join(f"({term})" for term in terms)


def _test(test: Test, number: Scalar, value: str) -> str:
    if number.meaning == "bool":
        outcome = test.holds(1), test.holds(0)
        return {(True, False): value, (False, True): f"!{value}"}.get(outcome, str(outcome[0]).lower())
    terms = [_within(first, last, number, value) for first, last in test.ranges]
    whole = terms[0] if len(terms) == 1 else " || ".join(f"({term})" for term in terms)
    return f"!({whole})" if test.negated else whole


def _within(first: int, last: int, number: Scalar, value: str) -> str:
    def constant(bound: int) -> str:
        return literal(bound, number.bits, signed=number.signed)

    if first == last:
        return f"{value} == {constant(first)}"
    width = storage(number.bits)
    low = -(1 << (width - 1)) if number.signed else 0
    high = (1 << (width - number.signed)) - 1
    terms = [f"{value} >= {constant(first)}"] if first > low else []
    terms += [f"{value} <= {constant(last)}"] if last < high else []
    return " && ".join(f"({term})" for term in terms) if len(terms) > 1 else (terms or ["true"])[0]
