"""What the hand-written behaviour of a protocol needs from its schema, checked in one place.

The numbers are read from the generated module, so that a schema that changes one of them changes the
behaviour as well. A schema that lacks something is refused when the behaviour is imported, with the
place in the file.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType, ModuleType
from typing import TYPE_CHECKING, Final, TypeAlias

from qlinkgen import _resources
from qlinkgen.codecs._support import ArrayRule, BaseMessage, BytesRule, Command, IntRule, Rule, ScaledRule
from qlinkgen.errors import UnsuitableSchema
from qlinkgen.link.codec import Bus
from qlinkgen.model.naming import pascal
from qlinkgen.model.texts import schema_hash

if TYPE_CHECKING:
    import yaml

#: Keys that lead to a place in a schema.
Path: TypeAlias = tuple[str, ...]

#: What a generated module is made from.
_ORIGIN: Final = re.compile(r"from (?P<file>[\w.-]+)\s\((?P<hash>[0-9a-f]+)\)")


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
        codec: its generated module.
        user: the package that has them.
    """

    codec: ModuleType
    user: str

    def check(
        self,
        fields: Mapping[str, str],
        *,
        enums: Mapping[str, str] = MappingProxyType({}),
        attributes: Collection[str] = (),
    ) -> None:
        """Check that messages have fields, enums and flags have names, and commands have attributes.

        Args:
            fields: names of fields, separated by blanks, by message.
            enums: names of values, separated by blanks, by enum or flags of the schema.
            attributes: attributes that the schema gives to every command.

        Raises:
            UnsuitableSchema: something is missing; a line for each.
        """
        missing = [*self._fields(fields), *self._values(enums), *self._attributes(attributes)]
        if missing:
            raise UnsuitableSchema("\n".join(self._sentence(*each) for each in missing))

    def _fields(self, needed: Mapping[str, str]) -> Iterator[tuple[str, Path]]:
        messages: Mapping[str, type[BaseMessage]] = self.codec.MESSAGES
        for name, fields in needed.items():
            if name not in messages:
                yield f"the schema has no {name}", path_of(name)
                continue
            known = {rule.name for rule in messages[name].RULES}
            for field in fields.split():
                if field not in known:
                    yield f"{name} has no {field}", path_of(name, field)

    def _values(self, needed: Mapping[str, str]) -> Iterator[tuple[str, Path]]:
        messages: Collection[type[BaseMessage]] = self.codec.MESSAGES.values()
        for name, values in needed.items():
            # A message of the same name leaves it the longer one.
            own = (f"{pascal(name)}Enum", f"{pascal(name)}Flags", pascal(name))
            kinds = [getattr(self.codec, each, None) for each in own]
            found = next((kind for kind in kinds if kind and kind not in messages), None)
            kind = "enums" if hasattr(found, "members") else "flags"
            if found is None:
                yield f"the schema has no enum or flags {name}", ("enums", name)
                continue
            for value in values.split():
                if not hasattr(found, value.upper()):
                    yield f"{name} has no {value}", (kind, name, "values", value)

    def _attributes(self, needed: Collection[str]) -> Iterator[tuple[str, Path]]:
        commands: Mapping[str, Command] = self.codec.COMMANDS
        for attribute in needed:
            if not all(attribute in each.attributes for each in commands.values()):
                yield f"commands have no attribute {attribute}", ("attributes", attribute)

    def commands(self, handled: Collection[str]) -> None:
        """Check that a simulation handles the commands of the schema, and no others.

        Raises:
            UnsuitableSchema: it does not; a line for each.
        """
        known: Collection[str] = self.codec.COMMANDS
        faults = [
            self._sentence(f"the schema has no command {name}", ("commands", name))
            if name in handled
            else f"{self._place(('commands', name))}: command {name}, which {self.user} does not know; "
            "change both together"
            for name in sorted({*known} ^ {*handled})
        ]
        if faults:
            raise UnsuitableSchema("\n".join(faults))

    def number(self, message: type[BaseMessage], field: str) -> int:
        """Return the largest value of a field that holds whole numbers from 0.

        Raises:
            UnsuitableSchema: it is not such a field.
        """
        rule = self._rule(message, field)
        if not isinstance(rule, IntRule) or len(rule.ranges) != 1 or rule.ranges[0][0] != 0:
            raise self._unsuitable(
                f"{message.NAME}: {field} must hold the whole numbers from 0 to a limit", message, field
            )
        return rule.ranges[0][1]

    def largest(self, message: type[BaseMessage], field: str) -> float:
        """Return the largest value of a scaled field, in its unit.

        Raises:
            UnsuitableSchema: it is not such a field.
        """
        rule = self._rule(message, field)
        if not isinstance(rule, ScaledRule):
            raise self._unsuitable(f"{message.NAME}: {field} must be scaled", message, field)
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
            raise self._unsuitable(f"{message.NAME}: {field} must hold several items", message, field)
        return rule.most

    def bus(self, name: str) -> int:
        """Return a number of the bus.

        Raises:
            UnsuitableSchema: the schema does not state it.
        """
        facts: Bus = self.codec.BUS
        number = getattr(facts, name)
        if not isinstance(number, int):
            stated = f"the bus does not state {name.replace('_', ' ')}"
            raise UnsuitableSchema(self._sentence(stated, ("bus", name)))
        return number

    def _rule(self, message: type[BaseMessage], field: str) -> Rule:
        for rule in message.RULES:
            if rule.name == field:
                return rule
        raise self._unsuitable(f"{message.NAME} has no {field}", message, field)

    def _unsuitable(self, what: str, message: type[BaseMessage], field: str) -> UnsuitableSchema:
        return UnsuitableSchema(self._sentence(what, path_of(message.NAME, field)))

    def _sentence(self, what: str, path: Path) -> str:
        return f"{self._place(path)}: {what}, which {self.user} needs; change both together"

    def _place(self, path: Path) -> str:
        """Return file, line and column of what is at a path, or of the nearest that encloses it.

        Only the file if it is not the one that the module is generated from.
        """
        origin = _ORIGIN.search(self.codec.__doc__ or "")
        if origin is None:
            return "its schema"
        file = _resources.schemas_dir() / origin["file"]
        name = f"schemas/{origin['file']}"
        text = file.read_text(encoding="utf-8") if file.is_file() else ""
        if schema_hash(text) != origin["hash"]:
            return name
        line, column = position(text, path)
        return f"{name}:{line}:{column}"


def path_of(message: str, field: str = "") -> Path:
    """Return the keys of a message, or of one of its fields, in a schema."""
    command, dot, part = message.rpartition(".")
    own = ("commands", command, part) if dot else ("messages", message, "fields")
    return (*own, field) if field else own


def position(text: str, path: Path) -> tuple[int, int]:
    """Return line and column, from 1, of the key at a path in YAML text, or of the last key on the way."""
    import yaml  # noqa: PLC0415  # only faults need the text

    node, at = _root(text), (1, 1)
    for step in path:
        pairs = node.value if isinstance(node, yaml.MappingNode) else []
        found = next((pair for pair in pairs if pair[0].value == step), None)
        if found is None:
            break
        mark, node = found[0].start_mark, found[1]
        at = (mark.line + 1, mark.column + 1)
    return at


@lru_cache(maxsize=1)
def _root(text: str) -> yaml.Node | None:
    import yaml  # noqa: PLC0415  # only faults need the text

    node: yaml.Node | None = yaml.compose(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    return node
