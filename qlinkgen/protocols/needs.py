"""What the hand-written behaviour of a protocol needs from its schema, checked in one place.

The numbers are read from the generated module, so that a schema that changes one of them changes the
behaviour as well. A schema that no longer states one is refused when the behaviour is imported.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from types import ModuleType

from qlinkgen.codecs._support import ArrayRule, BaseMessage, BytesRule, IntRule, Rule, ScaledRule
from qlinkgen.errors import UnsuitableSchema
from qlinkgen.link.codec import Bus


@dataclass(frozen=True, slots=True)
class Cycle:
    """Numbers of a counter: 0 to `most`, then 0 again."""

    most: int

    def after(self, number: int) -> int:
        """Return the number that follows another."""
        return (number + 1) % (self.most + 1)

    def before(self, number: int) -> int:
        """Return the number that precedes another."""
        return (number - 1) % (self.most + 1)

    def between(self, earlier: int, later: int) -> int:
        """Return how many numbers come between two, 0 if the later one follows."""
        return (later - earlier - 1) % (self.most + 1)


@dataclass(frozen=True, slots=True)
class Needs:
    """The needs of one protocol.

    Attributes:
        schema: its file, for errors.
        user: the package that has them.
    """

    schema: str
    user: str

    def fields(self, messages: Mapping[str, type[BaseMessage]], needed: Mapping[str, str]) -> None:
        """Check that messages have fields.

        Args:
            messages: messages of the schema by name.
            needed: names of fields, separated by blanks, by message.

        Raises:
            UnsuitableSchema: a message or a field is missing.
        """
        for name, fields in needed.items():
            if name not in messages:
                raise self._unsuitable(f"has no {name}")
            for field in fields.split():
                self._rule(messages[name], field)

    def names(self, codec: ModuleType, needed: Mapping[str, str]) -> None:
        """Check that enums and flags have names.

        Args:
            codec: the generated module.
            needed: names of values in the schema, separated by blanks, by class of the module.

        Raises:
            UnsuitableSchema: a class or a name is missing.
        """
        for kind, names in needed.items():
            if not hasattr(codec, kind):
                raise self._unsuitable(f"has no {kind}")
            for name in names.split():
                if not hasattr(getattr(codec, kind), name.upper()):
                    raise self._unsuitable(f"{kind} has no {name}")

    def commands(self, commands: Collection[str], handled: Collection[str]) -> None:
        """Check that a simulation handles the commands of the schema, and no others.

        Raises:
            UnsuitableSchema: it does not.
        """
        for name in sorted({*commands} ^ {*handled}):
            if name in handled:
                raise self._unsuitable(f"has no command {name}")
            raise UnsuitableSchema(
                f"{self.schema} has the command {name}, which {self.user} does not know; change both together"
            )

    def number(self, message: type[BaseMessage], field: str) -> int:
        """Return the largest value of a field that holds whole numbers from 0.

        Raises:
            UnsuitableSchema: it is not such a field.
        """
        rule = self._rule(message, field)
        if not isinstance(rule, IntRule) or len(rule.ranges) != 1 or rule.ranges[0][0] != 0:
            raise self._unsuitable(f"{message.NAME}: {field} must hold the whole numbers from 0 to a limit")
        return rule.ranges[0][1]

    def largest(self, message: type[BaseMessage], field: str) -> float:
        """Return the largest value of a scaled field, in its unit.

        Raises:
            UnsuitableSchema: it is not such a field.
        """
        rule = self._rule(message, field)
        if not isinstance(rule, ScaledRule):
            raise self._unsuitable(f"{message.NAME}: {field} must be scaled")
        ends: tuple[float, float] = (rule.scale.value(rule.scale.low), rule.scale.value(rule.scale.high))
        return max(ends)

    def cycle(self, message: type[BaseMessage], field: str) -> Cycle:
        """Return the numbers of a counter.

        Raises:
            UnsuitableSchema: the field does not hold whole numbers from 0.
        """
        return Cycle(self.number(message, field))

    def items(self, message: type[BaseMessage], field: str) -> int:
        """Return the largest number of items of a field.

        Raises:
            UnsuitableSchema: it has no items.
        """
        rule = self._rule(message, field)
        if not isinstance(rule, ArrayRule | BytesRule):
            raise self._unsuitable(f"{message.NAME}: {field} must hold several items")
        return rule.most

    def bus(self, facts: Bus, name: str) -> int:
        """Return a number of the bus.

        Raises:
            UnsuitableSchema: the schema does not state it.
        """
        number = getattr(facts, name)
        if not isinstance(number, int):
            raise self._unsuitable(f"does not state {name.replace('_', ' ')} of the bus")
        return number

    def _rule(self, message: type[BaseMessage], field: str) -> Rule:
        for rule in message.RULES:
            if rule.name == field:
                return rule
        raise self._unsuitable(f"{message.NAME} has no {field}")

    def _unsuitable(self, what: str) -> UnsuitableSchema:
        return UnsuitableSchema(f"{self.schema} {what}, which {self.user} needs; change both together")
