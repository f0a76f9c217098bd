"""Choices of a type by an earlier field."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from qlinkgen.importers import cells
from qlinkgen.importers.document import Notation, Value
from qlinkgen.importers.ksy.conditions import Tested
from qlinkgen.importers.ksy.enums import number_of
from qlinkgen.importers.ksy.expressions import runs, sliced
from qlinkgen.importers.ksy.lookup import Lookup
from qlinkgen.importers.ksy.scalars import scalar
from qlinkgen.importers.ksy.sizes import bits_of_type
from qlinkgen.importers.ksy.tree import Attribute, Node, Refused, Type
from qlinkgen.importers.names import schema_name


@dataclass(frozen=True, slots=True)
class _Decision:
    """What decides a choice: a reference, and the numbers of the cases in it.

    Attributes:
        numbers: The number of each case.
        limits: Least and greatest number.
        named: Whether they have names.
    """

    reference: str
    numbers: dict[int, int]
    limits: tuple[int, int]
    named: bool


class Choices:
    """The choices of a sequence.

    Args:
        lookup: Its fields.
        tested: Gives what a condition may say of a field.
        record: Gives the name of a record.
    """

    def __init__(
        self, lookup: Lookup, tested: Callable[[str], Tested | None], record: Callable[[Type], str]
    ) -> None:
        self._lookup = lookup
        self._tested = tested
        self._record = record

    def keys(self, attribute: Attribute) -> dict[str, Value]:
        """The keys of a choice. Raises Refused."""
        switch = attribute.switch
        assert switch is not None
        size = attribute.text("size")
        decision = self._decision(attribute)
        cases: dict[str, Value] = {}
        default: Value = "bytes" if attribute.text("size-eos") == "true" or size else {}
        if cells.integer(size) is not None:
            default = f"bytes[{cells.integer(size)}]"
        stated = False
        covered: set[int] = set()
        for key, value in switch.mapping("cases"):
            type_ = self._case(value, attribute, size)
            if key == "_":
                default, stated = type_, True
                continue
            number = decision.numbers[number_of_case(key, value, attribute.scope)]
            if number in covered:
                continue
            covered.add(number)
            called = schema_name(key.rpartition("::")[2]) if decision.named and "::" in key else str(number)
            cases[called] = type_
        if not cases:
            raise Refused(switch, f"the choice by '{switch.text('switch-on')[:60]}' has no cases")
        low, high = decision.limits
        found: dict[str, Value] = {"switch": decision.reference, "cases": cases}
        return found if len(covered) > high - low and not stated else {**found, "default": default}

    def condition(self, choice: Attribute, numbers: Sequence[int]) -> dict[str, Value]:
        """The condition under which a choice has a case. Raises Refused."""
        decision = self._decision(choice)
        values: list[Value] = list(dict.fromkeys(decision.numbers[each] for each in numbers))
        if not values:
            values = list(_others(decision))
        return {decision.reference: values[0] if len(values) == 1 else values}

    def _decision(self, attribute: Attribute) -> _Decision:
        switch = attribute.switch
        assert switch is not None
        on = switch.text("switch-on")
        expression = self._lookup.expression(on, attribute)
        found = sliced(expression) if expression is not None else None
        tested = self._tested(found.name) if found is not None and found.name in self._lookup.known else None
        if found is None or tested is None:
            raise Refused(switch, f"the choice by '{on[:60]}' is not one by a field before it")
        numbers = [
            number_of_case(key, value, attribute.scope)
            for key, value in switch.mapping("cases")
            if key != "_"
        ]
        high = tested.limits[1]
        if found.mask is None and not found.shift:
            named = bool(self._lookup.known[found.name].text("enum"))
            return _Decision(tested.name, {each: each for each in numbers}, tested.limits, named)
        mask = (high if found.mask is None else found.mask) >> found.shift << found.shift
        placed = {each: each << found.shift for each in numbers}
        types = {
            placed[number_of_case(key, value, attribute.scope)]: value.word
            for key, value in switch.mapping("cases")
            if key != "_"
        }
        for first, last in runs(mask):
            name = tested.bit(first, last)
            others = mask & ~(((1 << (last - first + 1)) - 1) << first)
            if name is not None and _alone(types, first, last, others):
                width = (1 << (last - first + 1)) - 1
                return _Decision(
                    name, {each: at >> first & width for each, at in placed.items()}, (0, width), named=False
                )
        raise Refused(switch, f"the choice by '{on[:60]}' is not one by bits in a row")

    def _case(self, node: Node, attribute: Attribute, size: str) -> Value:
        text = node.word
        if (found := scalar(text, attribute.scope.endian)) is not None:
            type_: Value = found.type
            bits: int | None = 8 * found.size
        else:
            inner = attribute.scope.find_type(text) if text else None
            if inner is None:
                raise Refused(node, f"the type '{text[:60]}' of a case is not in this file")
            bits = bits_of_type(inner)
            type_ = self._record(inner) if inner.attributes else {}
        if cells.integer(size) is not None and bits != 8 * (cells.integer(size) or 0):
            raise Refused(node, f"the case {text[:60]} has not the {size[:20]} bytes of the choice")
        return type_


def _others(decision: _Decision) -> Iterator[Value]:
    """The numbers without a case, as ranges."""
    low, high = decision.limits
    for number in (*sorted(set(decision.numbers.values())), high + 1):
        if low < number - 1:
            yield Notation(f"{low}..{number - 1}")
        elif low == number - 1:
            yield low
        low = number + 1


def _alone(types: dict[int, str], first: int, last: int, others: int) -> bool:
    """Whether bits in a row decide a choice, whatever the other bits of it are."""
    run = ((1 << (last - first + 1)) - 1) << first
    found: dict[int, set[tuple[int, str]]] = {}
    for number, type_ in types.items():
        found.setdefault(number & run, set()).add((number & others, type_))
    return all(
        len({type_ for _, type_ in each}) == 1 and len(each) == 1 << others.bit_count()
        for each in found.values()
    )


def number_of_case(key: str, node: Node, scope: Type) -> int:
    """The number of a case. Raises Refused."""
    number = cells.integer(key) if "::" not in key else number_of(scope, key)
    if number is None:
        raise Refused(node, f"the case '{key[:60]}' is not a number or a value of an enum")
    return number
