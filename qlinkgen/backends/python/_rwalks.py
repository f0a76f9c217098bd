"""Messages in which fields may be absent: what their encoders raise, and rules for their values.

Copied next to modules that use it, unchanged.
"""

from __future__ import annotations

from ._support import BaseMessage, EncodeError, Rule, shown

TYPE_CHECKING = False  # as typing.TYPE_CHECKING; importing `typing` costs 5 ms
if TYPE_CHECKING:
    from ._support import Value

#: Default of a field that a new message has: each message gets an object of its own.
NEW: Value = object()


class Misplaced(EncodeError):
    """A field is given that must be absent, or the reverse."""


def misplaced(message: BaseMessage, name: str, condition: str) -> Misplaced:
    """The error for a field that is present only on a condition."""
    value = getattr(message, name, None)
    seen = "is missing" if value is None else f"{shown(value)} cannot be sent"
    text = f"{message.NAME}: {name}: {seen}; it is present only if {condition}"
    return Misplaced(text, name, value)


class MaybeRule(Rule):
    """The legal values of a field that may be absent."""

    __slots__ = ("rule",)

    def __init__(self, rule: Rule) -> None:
        self.rule = rule
        super().__init__(rule.name, f"{rule.legal}, or None")

    def allows(self, value: Value) -> bool:
        """Whether the field is absent, or its value is legal."""
        return value is None or self.rule.allows(value)

    def complaint(self, value: object) -> str:
        """The error text for a value, "" if it is legal or absent."""
        return "" if value is None else self.rule.complaint(value)

    def plain(self, value: Value) -> Value:
        """The value converted to the types that encoders accept."""
        return None if value is None else self.rule.plain(value)
