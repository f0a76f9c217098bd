"""A tree of constructor calls, which can be evaluated to live structures or printed as source.

Both use the same tree, so the tests run the structures that readers review.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from qlinkgen._dataclass import dataclass
from qlinkgen.backends import python_text
from qlinkgen.model.texts import one_line

#: Line length of the source.
WIDTH = 88


@dataclass(frozen=True, slots=True)
class Ref:
    """The name of a class or of an earlier definition."""

    name: str


@dataclass(frozen=True, slots=True)
class Number:
    """An integer, and its most readable form."""

    value: int
    text: str


@dataclass(frozen=True, slots=True)
class Call:
    """``name(*args, **kwargs)``."""

    name: str
    args: tuple[Node, ...] = ()
    kwargs: tuple[tuple[str, Node], ...] = ()


@dataclass(frozen=True, slots=True)
class Named:
    """``"name" / node``, a named field in construct; the doc is printed as a comment."""

    name: str
    node: Node
    doc: str = ""


@dataclass(frozen=True, slots=True)
class Sequence:
    """A list."""

    items: tuple[Node, ...]


#: Numbers, text, bytes and tuples of them are printed by `repr`.
Node = Ref | Number | Call | Named | Sequence | int | float | str | bytes | bool | None | tuple["Node", ...]


#: An evaluated node.
Value = Any  # construct has no type hints


def hexadecimal(value: int, digits: int = 2) -> Number:
    """An integer in ``digits`` hexadecimal digits."""
    return Number(value, f"0x{value:0{digits}X}")


@dataclass(frozen=True, slots=True)
class Definition:
    """``name = node`` with a comment above."""

    name: str
    node: Node
    comment: str = ""
    #: It is printed directly below the definition above, without an empty line.
    attached: bool = False


# Evaluation


def evaluate(definitions: tuple[Definition, ...], names: Mapping[str, Value]) -> dict[str, Value]:
    """Evaluate the definitions; they may refer to ``names``."""
    known = dict(names)
    return {each.name: known.setdefault(each.name, _value(each.node, known)) for each in definitions}


def _value(node: Node, known: Mapping[str, Value]) -> Value:
    match node:
        case Call():
            args = [_value(each, known) for each in node.args]
            return known[node.name](*args, **{key: _value(each, known) for key, each in node.kwargs})
        case Named():
            return node.name / _value(node.node, known)
        case Sequence():
            return [_value(each, known) for each in node.items]
        case Ref():
            return known[node.name]
        case Number():
            return node.value
        case _:
            return node


def used(node: Node) -> Iterator[str]:
    """All names that a node refers to."""
    if isinstance(node, Ref | Call):
        yield node.name
    for child in _children(node):
        yield from used(child)


def _children(node: Node) -> tuple[Node, ...]:
    match node:
        case Call():
            return node.args + tuple(each for _, each in node.kwargs)
        case Named():
            return (node.node,)
        case Sequence():
            return node.items
        case _:
            return ()


# Printing


def printed(definition: Definition) -> str:
    """The source of a definition, preceded by an empty line and its comment."""
    lines = python_text.comment(definition.comment, WIDTH - 4)
    comment = "".join(f"# {line}\n" for line in lines)
    gap = "" if definition.attached else "\n"
    return f"{gap}{comment}{definition.name} = {_text(definition.node, len(definition.name) + 3, 0)}\n"


def _text(node: Node, column: int, indent: int) -> str:
    """The source of a node that begins in a column; if it does not fit, each part gets a line."""
    flat = _flat(node)
    if column + len(flat) < WIDTH and not _documented(node):
        return flat
    inner = indent + 4
    match node:
        case Named():
            return f'"{node.name}"\n{" " * indent}/ {_text(node.node, indent + 2, indent)}'
        case Call():
            parts = [_part("", each, inner) for each in node.args]
            parts += [_part(f"{key}=", each, inner) for key, each in node.kwargs]
            return f"{node.name}(\n{''.join(parts)}{' ' * indent})"
        case Sequence():
            return f"[\n{''.join(_part('', each, inner) for each in node.items)}{' ' * indent}]"
        case tuple() if node:
            return f"(\n{''.join(_part('', each, inner) for each in node)}{' ' * indent})"
        case _:
            return flat


def _part(prefix: str, node: Node, indent: int) -> str:
    line = f"{' ' * indent}{prefix}{_text(node, indent + len(prefix), indent)},"
    doc = one_line(node.doc) if isinstance(node, Named) else ""
    if not doc:
        return f"{line}\n"
    if "\n" not in line and len(line) + len(doc) + 4 <= WIDTH:
        return f"{line}  # {doc}\n"
    return f"{' ' * indent}# {doc}\n{line}\n"


def _documented(node: Node) -> bool:
    return isinstance(node, Call) and any(
        isinstance(part, Named) and (part.doc or _documented(part.node)) for part in node.args
    )


def _flat(node: Node) -> str:
    match node:
        case Call():
            parts = [_flat(each) for each in node.args] + [
                f"{key}={_flat(each)}" for key, each in node.kwargs
            ]
            return f"{node.name}({', '.join(parts)})"
        case Named():
            return f'"{node.name}" / {_flat(node.node)}'
        case Sequence():
            return f"[{', '.join(map(_flat, node.items))}]"
        case Ref():
            return node.name
        case Number():
            return node.text
        case _:
            return _literal(node)


def _literal(value: Node) -> str:
    """Like `repr`, in double quotes."""
    if isinstance(value, tuple):
        return f"({', '.join(map(_literal, value))}{',' if len(value) == 1 else ''})"
    if isinstance(value, str):
        return python_text.literal(value)
    if isinstance(value, float):
        return python_text.real(value)
    text = repr(value)
    if isinstance(value, bytes) and '"' not in text and text.endswith("'"):
        text = text.replace("'", '"', 1)[:-1] + '"'
    return text
