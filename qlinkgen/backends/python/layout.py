"""Lines of Python as ``ruff format`` leaves them: one line where it fits, else an item a line and a last comma."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

#: Longest line of generated code.
WIDTH = 88


def indented(lines: Iterable[str], levels: int = 1) -> list[str]:
    """Lines moved to the right."""
    return ["    " * levels + line if line else line for line in lines]


def wrapped(head: str, items: Iterable[str], tail: str, indent: int) -> list[str]:
    """``head item, item tail``; ``indent`` is that of the line."""
    listed = list(items)
    line = f"{head}{', '.join(listed)}{tail}"
    if indent + len(line) <= WIDTH or not listed:
        return [line]
    return [head, *(f"    {item}," for item in listed), tail]


def listing(head: str, items: Iterable[str], tail: str, indent: int) -> list[str]:
    """The same for a tuple display: a single item has its comma."""
    listed = list(items)
    return [f"{head}{listed[0]},{tail}"] if len(listed) == 1 else wrapped(head, listed, tail, indent)


def joined(head: str, terms: Sequence[str], operator: str, indent: int, *, always: bool = False) -> list[str]:
    """``head term operator term``; in parentheses where it takes several lines, or ``always``."""
    flat = f" {operator} ".join(terms)
    line = f"{head}({flat})" if always and len(terms) > 1 else f"{head}{flat}"
    if indent + len(line) <= WIDTH:
        return [line]
    first, *others = terms
    return [f"{head}(", f"    {first}", *(f"    {operator} {term}" for term in others), ")"]


def condition(terms: Sequence[str], indent: int) -> list[str]:
    """``if not all of the terms:``."""
    lines = joined("if not ", terms, "and", indent + 1, always=True)
    return [*lines[:-1], f"{lines[-1]}:"]


def comprehension(head: str, element: str, clause: str, tail: str, indent: int) -> list[str]:
    """``head element clause tail``, the clause on a line of its own where it must be."""
    line = f"{head}{element} {clause}{tail}"
    if indent + len(line) <= WIDTH:
        return [line]
    if indent + 4 + len(element) + 1 + len(clause) <= WIDTH:
        return [head, f"    {element} {clause}", tail]
    return [head, f"    {element}", f"    {clause}", tail]


def in_hex(number: int, size: int = 1) -> str:
    """A number in hex digits."""
    return f"0x{number:0{2 * size}X}"


def literal(data: bytes) -> str:
    """Bytes as source text, with the quotes that ``ruff format`` prefers."""
    text = repr(data)
    if text.startswith('b"') or '"' in text:
        return text
    return f'b"{text[2:-1]}"'
