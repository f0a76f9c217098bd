"""YAML text to plain data, with the line and column of every key and value.

Only the YAML 1.2 core notation is understood: ``on``, ``off``, ``yes`` and ``no`` are text, a number with a
point is a Decimal (``7.10`` stays 7.10), and a key that stands twice in a mapping is reported instead of
being overwritten.
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
#: What a file holds; numbers with a point are Decimal.
Data: TypeAlias = "str | int | Decimal | list[Data] | dict[str, Data] | None"

_INTEGER = re.compile(
    r"[-+]?(?:0|[1-9][0-9]*(?:_[0-9]+)*|0x[0-9a-fA-F]+(?:_[0-9a-fA-F]+)*|0b[01]+(?:_[01]+)*)\Z"
)
_DECIMAL = re.compile(r"[-+]?[0-9]+\.[0-9]+\Z")
_WORDS: Final = {"true": True, "false": False, "null": None, "~": None, "": None}
#: A plain number longer than this is text: no field holds it, and Python refuses to convert thousands of
#: digits.
_MAX_DIGITS = 100
_MAX_DEPTH = 50
#: Below this bound on its depth a text is composed without a look at its real depth.
_SAFE_DEPTH = 1000
#: A chain of aliases can stand for more data than a computer holds; each node has at least this many
#: characters.
_NODES_PER_CHARACTER = 2
_CORE_TAGS = ("bool", "float", "int", "map", "merge", "null", "seq", "str", "timestamp", "value")
_TAG = "tag:yaml.org,2002:"

_Loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


@dataclass(frozen=True, slots=True)
class Position:
    """A place in the file; line and column count from 1."""

    line: int
    column: int


@dataclass(frozen=True, slots=True)
class SyntaxFault:
    """A fault of the notation itself."""

    rule: str
    position: Position
    message: str
    hint: str = ""


@dataclass
class Source:
    """A parsed file: its data, and where each part of it stands."""

    data: Data = None
    keys: dict[Path, Position] = field(default_factory=dict)
    values: dict[Path, Position] = field(default_factory=dict)
    faults: list[SyntaxFault] = field(default_factory=list)

    def position(self, path: Path, *, of_key: bool = False) -> Position:
        """Where a key or value stands; for one that is not there, its nearest parent."""
        for end in range(len(path), -1, -1):
            part = path[:end]
            if of_key and part in self.keys:
                return self.keys[part]
            if part in self.values:
                return self.values[part]
        return Position(1, 1)


def parse(text: str) -> Source:
    """Parse YAML text. Faults of notation are collected in the result, not raised."""
    source = Source()
    text = text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    fault = _forbidden(text)
    if fault is None:
        source.faults += [
            SyntaxFault(CONTROL_CHARACTER, Position(line, column), control_character(character), HINT)
            for line, column, character in written(text)
        ]
        if source.faults:
            # Reported once; and some of them would end a line for the parser, but not for an editor.
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
    """YAML allows no control characters; the parser's own position of one counts bytes."""
    if not (match := yaml.reader.Reader.NON_PRINTABLE.search(text)):
        return None
    at = match.start()
    position = Position(text.count("\n", 0, at) + 1, at - text.rfind("\n", 0, at))
    return SyntaxFault(
        "yaml-syntax", position, f"character #x{ord(match[0]):04x} is not allowed in YAML", "remove it"
    )


def _too_deep(text: str) -> SyntaxFault | None:
    """The parser recurses in C, where too much of it ends the process."""
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
    """Cheaply found number that the depth of a text cannot exceed."""
    opened, longest = text.count("[") + text.count("{"), max(map(len, text.splitlines()), default=0)
    if opened + 2 * longest <= _SAFE_DEPTH:
        return opened + 2 * longest
    opened = 0
    for line in text.splitlines():
        brackets = line.count("[") + line.count("{")
        # Only where no bracket can be quoted does a closing one surely close something.
        plain = not any(quote in line for quote in "\"'#")
        opened += max(0, brackets - line.count("]") - line.count("}")) if plain else brackets
    return opened + 2 * longest


def _depth_fault(at: yaml.Event | yaml.Node) -> SyntaxFault:
    what = f"mappings and lists are nested more than {_MAX_DEPTH} deep"
    return SyntaxFault("yaml-syntax", _mark(at), what, "no schema needs that")


def _marked(error: yaml.MarkedYAMLError) -> SyntaxFault:
    mark = error.problem_mark or error.context_mark
    position = Position(mark.line + 1, mark.column + 1) if mark else Position(1, 1)
    return SyntaxFault("yaml-syntax", position, error.problem or "this is not YAML", _syntax_hint(error))


def _syntax_hint(error: yaml.MarkedYAMLError) -> str:
    problem = error.problem or ""
    if "character that cannot start any token" in problem:
        return "indent with spaces, not tabs; put text that begins with a special character in quotes"
    if "mapping values are not allowed" in problem:
        return "put text that contains ': ' in quotes"
    if "could not find expected ':'" in problem:
        return "a key needs a colon and a space behind it"
    return f"it was read {error.context}" if error.context else "see what stands in front of it"


def _mark(node: yaml.Node | yaml.Event) -> Position:
    mark: yaml.Mark = node.start_mark  # type: ignore[assignment]  # set in whatever was parsed from text
    return Position(mark.line + 1, mark.column + 1)


class _Builder:
    """Makes plain data of a node graph, and notes where everything stands."""

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
                "yaml-syntax", _mark(node), "an alias stands inside what it refers to", "remove it"
            )
        if self._nodes_left == 0:
            what = "the aliases of this file stand for far more data than it has"
            return SyntaxFault("yaml-syntax", _mark(node), what, "use named types in place of aliases")
        if not node.tag.startswith(_TAG) or node.tag.removeprefix(_TAG) not in _CORE_TAGS:
            tag = node.tag.replace(_TAG, "!!")
            return SyntaxFault("yaml-syntax", _mark(node), f"tag '{tag}' means nothing here", "remove it")
        return None

    def _mapping(self, node: yaml.MappingNode, path: Path, parents: tuple[yaml.Node, ...]) -> dict[str, Data]:
        result: dict[str, Data] = {}
        for key_node, value_node in node.value:
            if self._nodes_left < 0:
                break
            if not isinstance(key_node, yaml.ScalarNode):
                fault = SyntaxFault(
                    "yaml-syntax", _mark(key_node), "a mapping or list is no key", "write a plain word"
                )
                self._source.faults.append(fault)
                continue
            key = key_node.value
            if key in result:
                first = self._source.keys[(*path, key)]
                hint = f"it stands first in line {first.line}; remove or rename one of them"
                fault = SyntaxFault("duplicate-key", _mark(key_node), f"key '{key}' stands twice", hint)
                self._source.faults.append(fault)
                continue
            self._source.keys[(*path, key)] = _mark(key_node)
            result[key] = self.build(value_node, (*path, key), parents)
        return result


def _scalar(node: yaml.ScalarNode) -> Data:
    text: str = node.value
    if node.style:  # quoted or block text; the two parsers give None or "" for a plain word
        return text
    if text.lower() in _WORDS:
        return _WORDS[text.lower()]
    if len(text) > _MAX_DIGITS:
        return text
    if _INTEGER.match(text):
        return DecimalNumber(text) if text.isdecimal() and len(text) > 1 else int(text, 0)
    return Decimal(text) if _DECIMAL.match(text) else text
