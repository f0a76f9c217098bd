"""Parses one declaration of a header with pycparser."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from importlib import import_module
from types import ModuleType

from qlinkgen.errors import ExtraMissing
from qlinkgen.importers.header.nodes import Declared, Place, Reader, Refused
from qlinkgen.importers.header.pieces import COMPOUND, Piece
from qlinkgen.importers.notes import Notes
from qlinkgen.model.texts import one_line

_KEYWORDS = COMPOUND | frozenset(
    """auto break case char const continue default do double else extern float for goto if inline int long
    register restrict return short signed sizeof static switch typedef unsigned void volatile while _Bool
    _Complex _Noreturn _Static_assert _Thread_local _Atomic""".split()  # noqa: SIM905
)
_BEFORE_TYPES = frozenset({"{", ";", "typedef", "const", "volatile", "static", "extern"})
_WHERE = re.compile(r":(?P<line>\d+):\d+:\s*(?P<what>.*)", re.DOTALL)


def parser() -> ModuleType:
    """The package pycparser."""
    try:
        import_module("pycparser.c_parser")
        return import_module("pycparser")
    except ImportError:
        raise ExtraMissing(
            "importing a C header needs the package pycparser: pip install 'qlinkgen[import]'"
        ) from None


@dataclass
class Trees:
    """Parses declarations; knows the types and constants of those before.

    Attributes:
        types: Names of typedefs.
        constants: Constants of enums.
    """

    notes: Notes
    types: set[str] = field(default_factory=set)
    constants: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._c = parser()

    def read(self, piece: Piece) -> list[Declared]:
        """What a declaration defines; nothing, with a note, if it is not understood."""
        try:
            return self._read(piece)
        except Refused as error:
            self.notes.add(error.line, error.text)
        except RecursionError:
            self.notes.add(piece.line, "this declaration is nested too deep and left out")
        except self._c.c_parser.ParseError as error:
            found = _WHERE.search(str(error))
            line, what = (
                (int(found["line"]), found["what"]) if found else (piece.line, str(error).partition(":")[2])
            )
            self.notes.add(line, f"this declaration is left out: not understood ({one_line(what)[:60]})")
        return []

    def _read(self, piece: Piece) -> list[Declared]:
        text, keywords = _laid_out(piece)
        words = {each.text for each in piece.tokens if each.kind == "word"}
        own = _own_names(piece)
        before = sorted(((words & self.types) | _type_like(piece)) - own)
        prelude = "".join(f"typedef int {name};" for name in before)
        text = f'{prelude}\n#line {piece.line} "x"\n{text}\n'
        declarations = self._c.c_parser.CParser().parse(text, "x").ext[len(before) :]
        packed = {place for at in piece.packed for place in keywords[at]}
        reader = Reader(self.constants, packed, piece.pack)
        found = [reader.declared(each) for each in declarations]
        if piece.trouble is not None:
            what, line = piece.trouble
            raise Refused(line, f"this declaration is left out: {what} changes the layout")
        self.types |= {each.name for each in found if each is not None and each.name}
        return [each for each in found if each is not None]


def _laid_out(piece: Piece) -> tuple[str, dict[int, set[Place]]]:
    """The text of a declaration on its lines, and the places of its keywords by their index.

    pycparser gives the place of the keyword or of the token after it.
    """
    parts: list[str] = []
    places: dict[int, set[Place]] = {}
    line, column = piece.line, 1
    for index, token in enumerate(piece.tokens):
        if token.line > line:
            parts.append("\n" * (token.line - line))
            line, column = token.line, 1
        if token.text in COMPOUND:
            places[index] = {(line, column)}
        if index - 1 in places:
            places[index - 1].add((line, column))
        parts.append(f"{token.text} ")
        column += len(token.text) + 1
    return "".join(parts), places


def _own_names(piece: Piece) -> set[str]:
    """Names that the declaration itself defines."""
    texts = [each.text for each in piece.tokens]
    last = len(texts) - 1 - texts[::-1].index("}") if "}" in texts else 0
    return set(texts[last:]) if texts[0] == "typedef" and last else set()


def _type_like(piece: Piece) -> set[str]:
    """Words in the place of a type."""
    tokens = piece.tokens
    return {
        each.text
        for at, each in enumerate(tokens[:-1])
        if each.kind == "word"
        and each.text not in _KEYWORDS
        and at > 0
        and tokens[at - 1].text in _BEFORE_TYPES
        and (tokens[at + 1].kind == "word" or tokens[at + 1].text in ("*", ":"))
    }
