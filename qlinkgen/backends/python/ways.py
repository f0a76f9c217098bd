"""Merges the code for the frames of both directions: what differs between them is printed twice.

The name of what is printed twice ends with its direction.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Mapping, Sequence

from qlinkgen._dataclass import dataclass


@dataclass(frozen=True)
class Ways:
    """The names that have a definition for each direction."""

    names: frozenset[str]

    def of(self, text: str, way: str) -> str:
        """Code that uses the definitions of a direction; "" for code that both have in common."""
        if not way or not self.names:
            return text
        return re.sub(rf"\b({'|'.join(sorted(self.names))})\b", lambda found: _named(found[1], way), text)


def _named(name: str, way: str) -> str:
    return f"{name}_{way.upper()}" if name.isupper() else f"{name}_{way}"


def definitions(text: str) -> dict[str, str]:
    """The definitions of a module by name, each with the comments before it."""
    lines, found, start = text.splitlines(), dict[str, str](), 0
    for node in ast.parse(text).body:
        match node:
            case ast.FunctionDef(name=name) | ast.AnnAssign(target=ast.Name(id=name)):
                pass
            case ast.Assign(targets=[ast.Name(id=name)]):
                pass
            case _:
                raise AssertionError(ast.dump(node))
        found[name] = "\n".join(lines[start : node.end_lineno]).strip("\n")
        start = node.end_lineno or start
    return found


def differing(texts: Sequence[Mapping[str, str]]) -> Ways:
    """The names whose definitions differ, or use such names; ``texts`` are definitions of each direction."""
    first, other = texts
    names = {name for name in {*first, *other} if first.get(name) != other.get(name)}
    while more := {name for name in {*first, *other} - names if _uses(first[name], names)}:
        names |= more
    return Ways(frozenset(names))


def _uses(text: str, names: Iterable[str]) -> bool:
    return any(re.search(rf"\b{name}\b", text) for name in names)


def needed(texts: Mapping[str, str], roots: Iterable[str]) -> dict[str, str]:
    """The definitions that those with these names use, with themselves, in their order."""
    names = set(roots) & texts.keys()
    while more := {name for name in texts.keys() - names if any(_uses(texts[n], [name]) for n in names)}:
        names |= more
    return {name: text for name, text in texts.items() if name in names}


def merged(texts: Mapping[str, Mapping[str, str]], ways: Ways) -> str:
    """The definitions of each direction; those that they have in common once."""
    printed: dict[str, str] = {}
    for name in _order(*map(list, texts.values())):
        for way, found in texts.items():
            if name in found:
                text = ways.of(found[name], way)
                printed.setdefault(ways.of(name, way), text)
    whole, last = "", ""
    for text in printed.values():
        apart = any(each.startswith("def ") for each in (last, text))
        whole, last = f"{whole}\n\n\n{text}" if apart else f"{whole}\n{text}", text
    return whole


def _order(first: list[str], other: Sequence[str] = ()) -> list[str]:
    """The names of both lists, each before those that follow it in either; one role receives from one."""
    found: list[str] = []
    for name in first:
        if name in other:
            found += [each for each in other[: other.index(name)] if each not in found and each not in first]
        found.append(name)
    return found + [each for each in other if each not in found]
