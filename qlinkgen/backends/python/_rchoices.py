"""Rules for values whose type an earlier value of the message decides.

Copied next to modules that use it, unchanged.
"""

from __future__ import annotations

from _operator import index

from ._support import REFUSALS, Rule

TYPE_CHECKING = False  # as typing.TYPE_CHECKING; importing `typing` costs 5 ms
if TYPE_CHECKING:
    from ._support import Value

    #: Ranges of the numbers of a case, whether it is that of all others, its rule.
    Case = tuple[tuple[tuple[int, int], ...], bool, Rule]


class ChoiceRule(Rule):
    """A value with a rule for each case."""

    __slots__ = ("cases", "tested")

    def __init__(self, name: str, tested: str, *cases: Case) -> None:
        self.tested = tested
        self.cases = cases
        super().__init__(name, " or ".join(rule.legal for _, _, rule in cases))

    def of(self, message: object) -> Rule:
        """The rule of the case that the tested value of a message selects."""
        try:
            number = index(getattr(message, self.tested))
        except REFUSALS:  # another rule complains
            return self
        for ranges, others, rule in self.cases:
            if any(first <= number <= last for first, last in ranges) != others:
                return rule
        return self

    def allows(self, value: Value) -> bool:
        """Whether the value is absent, as in a case without a value."""
        return value is None
