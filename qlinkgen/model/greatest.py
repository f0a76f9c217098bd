"""The greatest size of fields of which conditions decide whether they are present."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import product

from qlinkgen.model.condition import Condition, Test, turning_points

#: A condition and the size of what is present where it holds.
Sized = tuple[Condition, int]
#: Values that conditions may connect with each other so that all of their combinations are tried.
_MOST_VALUES = 4


def greatest(sized: Iterable[Sized]) -> int:
    """The greatest size that is present at once; an upper bound where conditions connect many values."""
    kept = list(sized)
    always = sum(size for when, size in kept if not when)
    return always + sum(map(_greatest, _connected([each for each in kept if each[0]])))


def _connected(sized: Sequence[Sized]) -> Iterator[list[Sized]]:
    """Those whose conditions test values in common, directly or by way of others."""
    groups: list[tuple[set[str], list[Sized]]] = []
    for each in sized:
        names, own = {test.value for test in each[0]}, [each]
        for group in [group for group in groups if group[0] & names]:
            groups.remove(group)
            names |= group[0]
            own = group[1] + own
        groups.append((names, own))
    return (own for _, own in groups)


def _greatest(sized: Sequence[Sized]) -> int:
    tests = [test for when, _ in sized for test in when]
    names = list(dict.fromkeys(test.value for test in tests))
    if len(names) > _MOST_VALUES:
        firsts = [(when[:1], size) for when, size in sized]
        return sum(map(_greatest, _connected(firsts)))
    outcomes = [_outcomes({test for test in tests if test.value == name}) for name in names]
    sizes = Counter[frozenset[Test]]()
    for when, size in sized:
        sizes[frozenset(when)] += size
    found = 0
    for each in product(*outcomes):
        true = frozenset[Test]().union(*each)
        found = max(found, sum(size for when, size in sizes.items() if true >= when))
    return found


def _outcomes(tests: Collection[Test]) -> set[frozenset[Test]]:
    """Which tests of one value hold for any number that it may have."""
    return {frozenset(test for test in tests if test.holds(raw)) for raw in turning_points(tests)}
