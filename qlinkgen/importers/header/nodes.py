"""Turns the syntax tree of pycparser, which has no types, into typed classes."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from pycparser import c_ast

CType: TypeAlias = "Basic | Named | Structure | Enumeration | Pointer"
Place: TypeAlias = tuple[int, int]

#: Limits of constant expressions.
_MOST = 1 << 64
_MOST_SHIFT = 64
_LONGEST = 80
_NUMBER = re.compile(r"(?P<digits>0[xX][0-9a-fA-F]+|0[bB][01]+|[0-9]+)[uUlL]*\Z")
_CHARACTER = re.compile(r"'(?P<one>[^'\\])'\Z")


@dataclass(frozen=True, slots=True)
class Basic:
    """A type of C itself: its words, sorted."""

    words: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Named:
    """A type by the name that a typedef gave it, or by its tag."""

    name: str
    tag: bool = False


@dataclass(frozen=True, slots=True)
class Pointer:
    """A pointer or a function."""


@dataclass(frozen=True, slots=True)
class Member:
    """A member of a structure.

    Attributes:
        name: Name, empty for unnamed bits and structures.
        counts: Sizes of an array, outermost first; 0 for one without size.
        bits: Width of a bit field.
    """

    name: str
    type: CType
    line: int
    counts: tuple[int, ...] = ()
    bits: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Structure:
    """A structure or union with its members; equal only to itself."""

    tag: str
    members: tuple[Member, ...]
    line: int
    packed: bool
    pack: int | None
    union: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Enumeration:
    """An enum with the names and numbers of its constants, and their lines."""

    tag: str
    values: tuple[tuple[str, int, int], ...]
    line: int
    packed: bool


@dataclass(frozen=True, slots=True)
class Declared:
    """What a declaration defines: a type, and the name that a typedef gives it."""

    type: CType
    name: str
    line: int
    counts: tuple[int, ...] = ()


class Refused(Exception):
    """A construct that is not taken."""

    def __init__(self, line: int, text: str) -> None:
        """Keep line and text for a note."""
        super().__init__(text)
        self.line = line
        self.text = text


_BINARY: Mapping[str, Callable[[int, int], int]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "|": lambda a, b: a | b,
    "&": lambda a, b: a & b,
    "^": lambda a, b: a ^ b,
}


class Reader:
    """Reads the nodes of one declaration.

    Args:
        constants: Constants of enums by name; those of this declaration are added.
        packed: Places of packed structures, unions and enums.
        pack: Greatest alignment, None for that of the machine.
    """

    def __init__(self, constants: dict[str, int], packed: set[Place], pack: int | None) -> None:
        self._constants = constants
        self._packed = packed
        self._pack = pack

    def declared(self, node: c_ast.Node) -> Declared | None:
        """What a declaration defines, None if that is not a type."""
        kind = type(node).__name__
        line = node.coord.line if node.coord else 0
        if kind == "Typedef":
            found, counts = self._type(node.type, line)
            return Declared(found, node.name, line, counts)
        if kind == "Decl" and (node.name is None or "typedef" in node.storage):
            return Declared(self._type(node.type, line)[0], "", line)
        if kind == "Decl":
            # A variable may define the type that it has.
            found, _ = self._type(node.type, line)
            return Declared(found, "", line) if isinstance(found, Structure | Enumeration) else None
        return None

    def _type(self, node: c_ast.Node, line: int) -> tuple[CType, tuple[int, ...]]:
        """A type, and the sizes of an array of it."""
        counts: list[int] = []
        while type(node).__name__ in ("ArrayDecl", "TypeDecl"):
            if type(node).__name__ == "ArrayDecl":
                counts.append(0 if node.dim is None else self._positive(node.dim, line))
            node = node.type
        return self._bare(node, line), tuple(counts)

    def _bare(self, node: c_ast.Node, line: int) -> CType:
        match type(node).__name__:
            case "PtrDecl" | "FuncDecl":
                return Pointer()
            case "IdentifierType":
                words = tuple(sorted(node.names))
                single = len(words) == 1 and words[0] not in _WORDS
                return Named(words[0]) if single else Basic(words)
            case "Struct" | "Union":
                return self._structure(node)
            case "Enum":
                return self._enumeration(node)
            case other:
                raise Refused(line, f"this declaration is left out: {other} is not understood")

    def _structure(self, node: c_ast.Node) -> CType:
        if node.decls is None:
            return Named(node.name, tag=True)
        members = tuple(
            self._member(each, node.coord.line) for each in node.decls if type(each).__name__ == "Decl"
        )
        union = type(node).__name__ == "Union"
        return Structure(node.name or "", members, node.coord.line, self._is_packed(node), self._pack, union)

    def _member(self, node: c_ast.Node, outer: int) -> Member:
        line = _line(node, outer)
        found, counts = self._type(node.type, line)
        bits = None if node.bitsize is None else self.value(node.bitsize, line)
        return Member(node.name or "", found, line, counts, bits)

    def _enumeration(self, node: c_ast.Node) -> CType:
        if node.values is None:
            return Named(node.name, tag=True)
        values: list[tuple[str, int, int]] = []
        following = 0
        for each in node.values.enumerators:
            number = following if each.value is None else self.value(each.value, each.coord.line)
            values.append((each.name, number, each.coord.line))
            self._constants[each.name] = number
            following = number + 1
        return Enumeration(node.name or "", tuple(values), node.coord.line, self._is_packed(node))

    def _is_packed(self, node: c_ast.Node) -> bool:
        return (node.coord.line, node.coord.column) in self._packed

    # Constant expressions -------------------------------------------------------------------------------

    def _positive(self, node: c_ast.Node, line: int) -> int:
        number = self.value(node, line)
        if number < 0:
            raise Refused(line, f"this declaration is left out: {number} is not a size")
        return number

    def value(self, node: c_ast.Node, line: int) -> int:
        """The value of a constant expression. Raises Refused."""
        match type(node).__name__:
            case "Constant":
                return _constant(node.value, line)
            case "ID" if node.name in self._constants:
                return self._constants[node.name]
            case "UnaryOp" if node.op in ("-", "+", "~"):
                inner = self.value(node.expr, line)
                return {"-": -inner, "+": inner, "~": ~inner}[node.op]
            case "BinaryOp":
                return _binary(node.op, self.value(node.left, line), self.value(node.right, line), line)
            case "Cast":
                return self.value(node.expr, line)
            case "ID":
                raise Refused(line, f"this declaration is left out: the constant {node.name} is not known")
            case _:
                raise Refused(line, "this declaration is left out: the constant expression is not understood")


def _line(node: c_ast.Node, otherwise: int) -> int:
    """The line of a declaration; unnamed bits have only that of their type."""
    while node is not None:
        if node.coord is not None:
            return int(node.coord.line)
        node = getattr(node, "type", None)
    return otherwise


_WORDS = frozenset({"char", "short", "int", "long", "signed", "unsigned", "float", "double", "_Bool", "void"})


def _constant(text: str, line: int) -> int:
    if found := _CHARACTER.match(text):
        return ord(found["one"])
    found = _NUMBER.match(text.replace("'", ""))
    if found is None or len(text) > _LONGEST:
        raise Refused(line, f"this declaration is left out: {text[:20]} is not a whole number of 64 bits")
    digits = found["digits"]
    octal = digits.isdecimal() and digits[0] == "0"
    try:
        return int(digits, 8 if octal else 0)
    except ValueError:
        raise Refused(line, f"this declaration is left out: {digits} is not an octal number") from None


def _binary(operator: str, left: int, right: int, line: int) -> int:
    if operator in _BINARY:
        result = _BINARY[operator](left, right)
    elif operator in ("<<", ">>") and 0 <= right <= _MOST_SHIFT:
        result = left << right if operator == "<<" else left >> right
    elif operator in ("/", "%") and right:
        quotient = abs(left) // abs(right) * (1 if (left < 0) is (right < 0) else -1)
        result = quotient if operator == "/" else left - quotient * right
    else:
        raise Refused(line, f"this declaration is left out: {left} {operator} {right} is not a constant")
    if abs(result) > _MOST:
        raise Refused(line, "this declaration is left out: a constant exceeds 64 bits")
    return result
