"""Parses YAML text to plain data, with the line and column of every key and value.

Follows the YAML 1.2 core schema: ``on``, ``off``, ``yes`` and ``no`` are text. A number with a decimal point
is a Decimal (``7.10`` stays 7.10), and a duplicate key is reported instead of overwriting the first.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from decimal import Decimal
from typing import Final, TypeAlias

import yaml

from qlinkgen.model.texts import CONTROL
from qlinkgen.schema.characters import CONTROL_CHARACTER, HINT, control_character, written
from qlinkgen.schema.notation import DecimalNumber

Path: TypeAlias = tuple[str | int, ...]
#: Contents of a file; numbers with a decimal point are Decimal.
Data: TypeAlias = "str | int | Decimal | list[Data] | dict[str, Data] | None"

_INTEGER = re.compile(
    r"[-+]?(?:0|[1-9][0-9]*(?:_[0-9]+)*|0x[0-9a-fA-F]+(?:_[0-9a-fA-F]+)*|0b[01]+(?:_[01]+)*)\Z"
)
_DECIMAL = re.compile(r"[-+]?[0-9]+\.[0-9]+\Z")
_WORDS: Final = {"true": True, "false": False, "null": None, "~": None, "": None}
#: Longer plain numbers are text: they fit no field, and Python refuses to convert thousands of digits.
_MAX_DIGITS = 100
_MAX_DEPTH = 50
#: The depth of a text is determined only if its upper bound exceeds this.
_SAFE_DEPTH = 1000
#: Limits the number of nodes, because a chain of aliases can expand to any amount of data.
_NODES_PER_CHARACTER = 2
_CORE_TAGS = ("bool", "float", "int", "map", "merge", "null", "seq", "str", "timestamp", "value")
_TAG = "tag:yaml.org,2002:"

_Loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


@dataclass(frozen=True, slots=True)
class Position:
    """A position; line and column count from 1, and the file is "" unless it was included."""

    line: int
    column: int
    file: str = ""


@dataclass(frozen=True, slots=True)
class SyntaxFault:
    """A syntax error."""

    rule: str
    position: Position
    message: str
    hint: str = ""


@dataclass
class Source:
    """A parsed file: its data, and the position of each node."""

    data: Data = None
    keys: dict[Path, Position] = field(default_factory=dict)
    values: dict[Path, Position] = field(default_factory=dict)
    faults: list[SyntaxFault] = field(default_factory=list)

    def position(self, path: Path, *, of_key: bool = False) -> Position:
        """The position of a key or value; for a missing one, of its nearest parent."""
        for end in range(len(path), -1, -1):
            part = path[:end]
            if of_key and part in self.keys:
                return self.keys[part]
            if part in self.values:
                return self.values[part]
        return Position(1, 1)


def parse(text: str) -> Source:
    """Parse YAML text. Syntax errors are collected in the result, not raised."""
    source = Source()
    text = text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    fault = _forbidden(text)
    if fault is None:
        source.faults += [
            SyntaxFault(CONTROL_CHARACTER, Position(line, column), control_character(character), HINT)
            for line, column, character in written(text)
        ]
        if source.faults:
            # They have been reported, and some would end a line for the parser but not for an editor.
            text = CONTROL.sub(" ", text)
        fault = _too_deep(text)
    node = None
    if fault is None:
        try:
            node = yaml.compose(text, Loader=_Loader)
        except yaml.MarkedYAMLError as error:
            fault = _marked(error)
    if fault is not None:
        source.faults.append(fault)
    elif node is not None:
        source.data = _Builder(source, len(text)).build(node, (), ())
    return source


def _forbidden(text: str) -> SyntaxFault | None:
    """Find a character that YAML does not allow; the position given by the parser counts bytes."""
    if not (match := yaml.reader.Reader.NON_PRINTABLE.search(text)):
        return None
    at = match.start()
    position = Position(text.count("\n", 0, at) + 1, at - text.rfind("\n", 0, at))
    return SyntaxFault(
        "yaml-syntax", position, f"character #x{ord(match[0]):04x} is not allowed in YAML", "remove it"
    )


def _too_deep(text: str) -> SyntaxFault | None:
    """Find excessive nesting, at which the recursive C parser would crash."""
    if _depth_bound(text) <= _SAFE_DEPTH:
        return None
    depth = 0
    try:
        for event in yaml.parse(text, Loader=_Loader):
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if depth > _MAX_DEPTH:
                return _depth_fault(event)
    except yaml.MarkedYAMLError as error:
        return _marked(error)
    return None


def _depth_bound(text: str) -> int:
    """A cheap upper bound of the depth of a text."""
    opened, longest = text.count("[") + text.count("{"), max(map(len, text.splitlines()), default=0)
    if opened + 2 * longest <= _SAFE_DEPTH:
        return opened + 2 * longest
    opened = 0
    for line in text.splitlines():
        brackets = line.count("[") + line.count("{")
        # A closing bracket counts only if it cannot be quoted.
        plain = not any(quote in line for quote in "\"'#")
        opened += max(0, brackets - line.count("]") - line.count("}")) if plain else brackets
    return opened + 2 * longest


def _depth_fault(at: yaml.Event | yaml.Node) -> SyntaxFault:
    what = f"mappings and lists are nested more than {_MAX_DEPTH} deep"
    return SyntaxFault("yaml-syntax", _mark(at), what, "reduce the nesting")


def _marked(error: yaml.MarkedYAMLError) -> SyntaxFault:
    mark = error.problem_mark or error.context_mark
    position = Position(mark.line + 1, mark.column + 1) if mark else Position(1, 1)
    what = "a second document begins" if _another(error) else error.problem or "this is not YAML"
    return SyntaxFault("yaml-syntax", position, what, _syntax_hint(error))


def _another(error: yaml.MarkedYAMLError) -> bool:
    return "another document" in (error.problem or "")


def _syntax_hint(error: yaml.MarkedYAMLError) -> str:
    problem = error.problem or ""
    if "character that cannot start any token" in problem:
        return "indent with spaces, not tabs; put text that begins with a special character in quotes"
    if "mapping values are not allowed" in problem:
        return "put text that contains ': ' in quotes"
    if _another(error):
        return "write one file for each, and no --- between keys"
    if "could not find expected ':'" in problem:
        return "write a colon and a space after the key"
    return f"it was read {error.context}" if error.context else "check the text before it"


def _mark(node: yaml.Node | yaml.Event) -> Position:
    mark: yaml.Mark = node.start_mark  # type: ignore[assignment]  # set for text
    return Position(mark.line + 1, mark.column + 1)


class _Builder:
    """Converts a node graph to plain data and records positions."""

    def __init__(self, source: Source, characters: int) -> None:
        self._source = source
        self._nodes_left = _NODES_PER_CHARACTER * characters + 10

    def build(self, node: yaml.Node, path: Path, parents: tuple[yaml.Node, ...]) -> Data:
        self._source.values[path] = _mark(node)
        self._nodes_left -= 1
        if fault := self._refused(node, parents):
            self._source.faults.append(fault)
            return None
        inner = (*parents, node)
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node, path, inner)
        if isinstance(node, yaml.SequenceNode):
            return [self.build(item, (*path, index), inner) for index, item in enumerate(node.value)]
        assert isinstance(node, yaml.ScalarNode)
        return _scalar(node)

    def _refused(self, node: yaml.Node, parents: tuple[yaml.Node, ...]) -> SyntaxFault | None:
        if len(parents) >= _MAX_DEPTH:
            return _depth_fault(node)
        if any(node is parent for parent in parents):
            return SyntaxFault(
                "yaml-syntax", _mark(node), "an alias refers to a node that contains it", "remove it"
            )
        if self._nodes_left == 0:
            what = "the aliases of this file expand to too much data"
            return SyntaxFault("yaml-syntax", _mark(node), what, "use named types instead of aliases")
        if not node.tag.startswith(_TAG) or node.tag.removeprefix(_TAG) not in _CORE_TAGS:
            tag = node.tag.replace(_TAG, "!!")
            return SyntaxFault("yaml-syntax", _mark(node), f"unknown tag '{tag}'", "remove it")
        return None

    def _mapping(self, node: yaml.MappingNode, path: Path, parents: tuple[yaml.Node, ...]) -> dict[str, Data]:
        result: dict[str, Data] = {}
        for key_node, value_node in node.value:
            if self._nodes_left < 0:
                break
            if not isinstance(key_node, yaml.ScalarNode):
                fault = SyntaxFault(
                    "yaml-syntax",
                    _mark(key_node),
                    "a key cannot be a mapping or a list",
                    "write a plain word",
                )
                self._source.faults.append(fault)
                continue
            key = key_node.value
            if key in result:
                first = self._source.keys[(*path, key)]
                hint = f"it first occurs in line {first.line}; remove or rename one of them"
                fault = SyntaxFault("duplicate-key", _mark(key_node), f"duplicate key '{key}'", hint)
                self._source.faults.append(fault)
                continue
            self._source.keys[(*path, key)] = _mark(key_node)
            result[key] = self.build(value_node, (*path, key), parents)
        return result


def _scalar(node: yaml.ScalarNode) -> Data:
    text: str = node.value
    if node.style:  # quoted or block text; the parsers give None or "" for a plain word
        return text
    if text.lower() in _WORDS:
        return _WORDS[text.lower()]
    if len(text) > _MAX_DIGITS:
        return text
    if _INTEGER.match(text):
        return DecimalNumber(text) if text.isdecimal() and len(text) > 1 else int(text, 0)
    return Decimal(text) if _DECIMAL.match(text) else text
