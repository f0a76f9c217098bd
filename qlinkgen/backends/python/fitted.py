"""Splits the statements of generated Python that are too long for a line, as ``ruff format`` does.

Printers write a statement on one line where they know no better. This pass reads it as brackets and operators
and splits it at the outermost ones first. It changes only blanks and line ends, parentheses around an
expression, and the comma after the last of several items.
"""

from __future__ import annotations

import io
import tokenize
from collections.abc import Iterator, Sequence
from dataclasses import field
from tokenize import TokenInfo

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.python.layout import WIDTH

_CLOSING = {"(": ")", "[": "]", "{": "}"}
#: Operators before which a line is split, those that bind least first.
_PRECEDENCE = (
    frozenset({"for"}),
    frozenset({"if", "else"}),
    frozenset({"or"}),
    frozenset({"and"}),
    frozenset({"<", "<=", ">", ">=", "==", "!=", "in", "is"}),
    frozenset({"|"}),
    frozenset({"^"}),
    frozenset({"&"}),
    frozenset({"<<", ">>"}),
    frozenset({"+", "-"}),
    frozenset({"*", "/", "//", "%"}),
)
#: Words that an expression follows.
_BEFORE_EXPRESSION = frozenset({"if", "elif", "while", "return", "raise", "assert", "not"})
_ASSIGNMENTS = frozenset({"=", "+=", "-=", "|=", "^="})
#: What a line of a class begins with where a method does.
_METHODS = ("    def ", "    async def ", "    @")
_NO_TOKENS = (tokenize.NEWLINE, tokenize.NL, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER)


@dataclass(frozen=True, slots=True)
class Word:
    """A token, and whether a blank precedes it."""

    text: str
    blank: bool

    @property
    def flat(self) -> str:
        """The token."""
        return self.text


@dataclass(frozen=True, slots=True)
class Group:
    """Brackets with their contents."""

    opening: str
    blank: bool
    #: A tuple, list, dict or parentheses around an expression, not the arguments of a call nor an index.
    display: bool
    nodes: list[Node] = field(default_factory=list)

    @property
    def closing(self) -> str:
        """The bracket at the end."""
        return _CLOSING[self.opening]

    @property
    def flat(self) -> str:
        """On one line; without a comma after the last item, unless it makes the tuple."""
        pieces = _items(self.nodes)
        alone = self.display and self.opening == "(" and len(pieces) == 2
        inner = _flat(self.nodes[:-1] if len(pieces) > 1 and not pieces[-1] and not alone else self.nodes)
        return f"{self.opening}{inner}{self.closing}"


Node = Word | Group


def fitted(source: str) -> str:
    """The source of a module with its long statements split."""
    lines = source.split("\n")
    for begin, end in reversed(_blocks(lines)):
        for statement in reversed(list(_statements("\n".join([*lines[begin:end], ""])))):
            first, last = begin + statement[0].start[0] - 1, begin + statement[-1].end[0]
            if any(len(line) > WIDTH for line in lines[first:last]):
                lines[first:last] = _split(_nodes(statement), statement[0].start[1])
    return "\n".join(lines)


def _blocks(lines: Sequence[str]) -> list[tuple[int, int]]:
    """Outermost statements and methods with a long line, as ranges of lines: only they are read by token.

    Long comments and docstrings cannot be split.
    """
    starts: list[int] = []
    found: list[tuple[int, int]] = []
    inside, long = False, False
    for at, line in enumerate(lines):
        text = line.lstrip(" ")
        if inside or text.startswith('"""'):
            inside = not (text.endswith('"""') and (inside or len(text) > 3))
            continue
        if line[:1] not in ("", *" )]}#") or line.startswith(_METHODS):
            if long:
                found.append((starts[-1], at))
            starts.append(at)
            long = False
        long = long or (len(line) > WIDTH and text[0] != "#")
    return [*found, (starts[-1], len(lines))] if long else found


def _statements(source: str) -> Iterator[list[TokenInfo]]:
    """The tokens of each statement that can be split."""
    tokens: list[TokenInfo] = []
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.NEWLINE:
            kinds = {each.type for each in tokens}
            if tokenize.COMMENT not in kinds and len(tokens) > 1:
                yield tokens
            tokens = []
        elif token.type not in _NO_TOKENS and (tokens or token.type != tokenize.COMMENT):
            tokens.append(token)


def _nodes(tokens: Sequence[TokenInfo]) -> list[Node]:
    stack: list[list[Node]] = [[]]
    end = tokens[0].start
    for token in tokens:
        if token.string in _CLOSING.values():
            stack.pop()
        else:
            inside = stack[-1]
            blank = token.start != end and bool(inside)
            if token.string in _CLOSING:
                keyword = bool(inside) and inside[-1].flat == "="  # of an argument: no blank follows it
                group = Group(token.string, blank, display=blank or keyword or not inside)
                inside.append(group)
                stack.append(group.nodes)
            else:
                inside.append(Word(token.string, blank))
        end = token.end
    return stack[0]


def _flat(nodes: Sequence[Node]) -> str:
    text = "".join(" " * each.blank + each.flat for each in nodes)
    return text.removeprefix(" ")


# Splitting


def _split(nodes: list[Node], indent: int) -> list[str]:
    """A statement: its expression gets parentheses where it has no brackets at an end."""
    if indent + len(_flat(nodes)) <= WIDTH:
        return [" " * indent + _flat(nodes)]
    if _flat(nodes[:1]) in ("async", "def", "class"):
        parameters = next(at for at, each in enumerate(nodes) if isinstance(each, Group))
        return _bracketed(nodes, indent, "", parameters, parameters + 1)
    start = _expression(nodes)
    end = len(nodes) - _is(nodes[-1], ":")
    head, body, tail = nodes[:start], nodes[start:end], nodes[end:]
    several = any(_is(each, ",") or _has_content(each) for each in head)
    places = [at for at in range(start, end) if _has_content(nodes[at])]
    if _splits_itself(body):
        # Parentheses around it are worth a line only if its first line fits there.
        long = len(_flat(nodes[start : places[0]])) + indent + 4 >= WIDTH and not several
        if long or indent + len(_flat(nodes[: places[0]])) < WIDTH:
            return _bracketed(nodes, indent, "", start)
    united = any(_is(each, "|") for each in head)
    if _is(body[0], "await") and not united and any(_has_content(each) for each in head[:-1]):
        return _bracketed(nodes, indent, "", 0, start)  # an annotation is split before what is awaited
    margin = " " * indent
    rest = [Word(")", blank=False), *nodes[start - 1 :]]
    if any(_is(each, ",") for each in head):
        return [f"{margin}(", *_inside(head[:-1], indent + 4, joined=False), *_split(rest, indent)]
    opening = f"{margin}{_flat([*head, Word('(', blank=True)])}"
    if united and (_is(body[0], "await") or len(opening) > WIDTH):
        first = f"{margin}{_flat(head[:2])} ("  # the alternatives of an annotation
        return [first, *_inside(head[2:-1], indent + 4), *_split(rest, indent)]
    if len(opening) > WIDTH:
        return _bracketed(nodes, indent, "")
    return [opening, *_inside(body, indent + 4), f"{margin}){_flat(tail)}"]


def _expression(nodes: Sequence[Node]) -> int:
    """Where the expression of a statement begins: after keywords or the last equals sign."""
    assigned = [at for at, each in enumerate(nodes) if isinstance(each, Word) and each.text in _ASSIGNMENTS]
    if assigned:
        return assigned[-1] + 1
    start = 0
    while isinstance(each := nodes[start], Word) and each.text in _BEFORE_EXPRESSION:
        start += 1
    return start


def _splits_itself(body: Sequence[Node]) -> bool:
    """An expression that is split inside of its own brackets: a call, or brackets beside one operator."""
    for operators in _PRECEDENCE:
        found = sum(isinstance(each, Word) and each.text in operators for each in body[1:])
        if found == 1:
            return _has_content(body[-1]) or _has_content(body[0])
        if found:
            return False
    return any(_has_content(each) for each in body)


def _has_content(node: Node) -> bool:
    return isinstance(node, Group) and bool(node.nodes)


def _bracketed(
    nodes: list[Node], indent: int, end: str, start: int = 0, stop: int | None = None
) -> list[str]:
    """Split inside of the last brackets, from start to stop, that leave a first line which fits."""
    places = [at for at in range(start, len(nodes) if stop is None else stop) if _has_content(nodes[at])]
    if not places:
        return [f"{' ' * indent}{_flat(nodes)}{end}"]
    at = next((at for at in reversed(places) if indent + len(_opening(nodes, at)) <= WIDTH), places[0])
    group, margin = nodes[at], " " * indent
    assert isinstance(group, Group)
    tail = [Word(group.closing, blank=False), *nodes[at + 1 :]]
    return [
        f"{margin}{_opening(nodes, at)}",
        *_inside(group.nodes, indent + 4, joined=not group.display),
        *_tail(tail, indent, end),
    ]


def _opening(nodes: Sequence[Node], at: int) -> str:
    """The line up to the brackets at an index."""
    group = nodes[at]
    assert isinstance(group, Group)
    return _flat([*nodes[:at], Word(group.opening, group.blank)])


def _tail(nodes: list[Node], indent: int, end: str) -> list[str]:
    """What follows brackets, from the closing one on; alternatives of a result get parentheses."""
    margin, words = " " * indent, [each.flat for each in nodes]
    if indent + len(_flat(nodes)) + len(end) <= WIDTH:
        return [f"{margin}{_flat(nodes)}{end}"]
    if "->" in words and "|" in words:
        start = words.index("->") + 1
        inner = _inside(nodes[start:-1], indent + 4)
        return [f"{margin}{_flat(nodes[:start])} (", *inner, f"{margin}){_flat(nodes[-1:])}{end}"]
    return _bracketed(nodes, indent, end)


def _inside(nodes: list[Node], indent: int, end: str = "", *, joined: bool = True) -> list[str]:
    """The contents of brackets: on one line, else a line for each item or operand.

    Only the arguments of a call may be ``joined`` on one line; the items of a display are not.
    """
    items = _items(nodes)
    many = len(items) > 1
    if not (many and not (joined and items[-1])) and indent + len(_flat(nodes)) + len(end) <= WIDTH:
        return [f"{' ' * indent}{_flat(nodes)}{end}"]
    if many:
        return [line for item in items if item for line in _inside(item, indent, ",")]
    if any(_is(each, "lambda") for each in nodes):
        return _function(nodes, indent, end)
    colon = next((at for at, each in enumerate(nodes) if _is(each, ":") and each.blank), None)
    if colon is not None:
        return _slice(nodes, colon, indent, end)
    pieces = _operands(nodes)
    if len(pieces) == 1:
        return _bracketed(nodes, indent, end)
    lines = [line for piece in pieces[:-1] for line in _inside(piece, indent)]
    return [*lines, *_inside(pieces[-1], indent, end)]


def _slice(nodes: list[Node], colon: int, indent: int, end: str) -> list[str]:
    """A slice: its bounds are split one by one, and the end of one shares a line with the next."""
    after = colon + 1
    # The first place after the colon where a line can end: what precedes it stays with the first bound.
    places = (at for at in range(after, len(nodes)) if _has_content(nodes[at]) or nodes[at].blank)
    cut = next((at for at in places if at > after or _has_content(nodes[at])), None)
    if cut is None:
        return _inside(nodes[:colon], indent, f" {_flat(nodes[colon:])}{end}")
    shared, follows = f" {_flat(nodes[colon:cut])}", nodes[cut]
    opening = " " * follows.blank + follows.opening if isinstance(follows, Group) else ""
    *lines, last = _inside(nodes[:colon], indent, shared + opening)
    start = Word(last.strip().removesuffix(opening), blank=False)
    return [*lines, *_inside([start, *nodes[cut:]], indent, end)]


def _function(nodes: list[Node], indent: int, end: str) -> list[str]:
    """An argument that is a function of one expression, which gets parentheses."""
    body = next(at for at, each in enumerate(nodes) if _is(each, ":")) + 1
    margin = " " * indent
    return [f"{margin}{_flat(nodes[:body])} (", *_inside(nodes[body:], indent + 4), f"{margin}){end}"]


def _items(nodes: Sequence[Node]) -> list[list[Node]]:
    """Cut at commas; an empty one follows a comma at the end."""
    items: list[list[Node]] = [[]]
    for each in nodes:
        if _is(each, ","):
            items.append([])
        else:
            items[-1].append(each)
    return items


def _operands(nodes: list[Node]) -> list[list[Node]]:
    """Cut before each of the operators that bind least; an operator at the beginning is none of them."""
    # A loop of a comprehension is split inside of its brackets, but its condition begins a line.
    for operators in ({"if"},) if _is(nodes[0], "for") else _PRECEDENCE:
        cuts = [
            at for at, each in enumerate(nodes) if at and isinstance(each, Word) and each.text in operators
        ]
        if cuts:
            return [nodes[a:b] for a, b in zip([0, *cuts], [*cuts, len(nodes)], strict=True)]
    return [nodes]


def _is(node: Node, text: str) -> bool:
    return isinstance(node, Word) and node.text == text
