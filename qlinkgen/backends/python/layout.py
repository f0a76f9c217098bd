"""Lays out lines of Python like ``ruff format``: one line if it fits, otherwise one line per item."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from qlinkgen._dataclass import dataclass

#: Maximum line length of generated code.
WIDTH = 88


def indented(lines: Iterable[str], levels: int = 1) -> list[str]:
    """Indent lines."""
    return ["    " * levels + line if line else line for line in lines]


def wrapped(head: str, items: Iterable[str], tail: str, indent: int) -> list[str]:
    """``head item, item tail``; ``indent`` is the indentation of the line."""
    listed = list(items)
    line = f"{head}{', '.join(listed)}{tail}"
    if indent + len(line) <= WIDTH or not listed:
        return [line]
    return [head, *(f"    {item}," for item in listed), tail]


@dataclass(frozen=True)
class Call:
    """A call as an expression."""

    name: str
    arguments: Sequence[str]

    @property
    def flat(self) -> str:
        """The call on one line."""
        return f"{self.name}({', '.join(self.arguments)})"

    def item(self, indent: int) -> list[str]:
        """The call as an item of a display with one line per item."""
        return [*wrapped(f"{self.name}(", self.arguments, "),", indent)]


def calls(head: str, items: Sequence[Call], tail: str, indent: int) -> list[str]:
    """A tuple display of calls."""
    flat = ", ".join(item.flat for item in items) + ("," if len(items) == 1 else "")
    line = f"{head}{flat}{tail}"
    if indent + len(line) <= WIDTH:
        return [line]
    return [head, *indented(piece for item in items for piece in item.item(indent + 4)), tail]


def listing(head: str, items: Iterable[str], tail: str, indent: int) -> list[str]:
    """Like `wrapped`, for a tuple display, in which a single item has a comma."""
    listed = list(items)
    return [f"{head}{listed[0]},{tail}"] if len(listed) == 1 else wrapped(head, listed, tail, indent)


def slice_of(data: str, start: str, end: str) -> str:
    """``data[start:end]``, with blanks around the colon if an index is an expression."""
    simple = all(each.lstrip("-").isdecimal() or each.isidentifier() for each in (start, end) if each)
    if simple:
        return f"{data}[{start}:{end}]"
    return f"{data}[{start} : {end}]" if end else f"{data}[{start} :]"


def in_hex(number: int, size: int = 1) -> str:
    """A number in hex digits."""
    return f"0x{number:0{2 * size}X}"


def literal(data: bytes) -> str:
    """Bytes as a literal, with the quotes that ``ruff format`` prefers."""
    text = repr(data)
    if text.startswith('b"') or '"' in text:
        return text
    return f'b"{text[2:-1]}"'


def bare(expression: str) -> str:
    """An expression without parentheses around the whole of it."""
    depth = 0
    for at, character in enumerate(expression):
        depth += (character == "(") - (character == ")")
        if depth == 0:
            return expression[1:-1] if character == ")" and at == len(expression) - 1 else expression
    return expression
