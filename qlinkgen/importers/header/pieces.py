"""Divides a header into declarations, and collects the attributes that pycparser does not read."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from qlinkgen.importers.header.directives import Packing
from qlinkgen.importers.header.tokens import Token
from qlinkgen.importers.notes import Notes

COMPOUND = frozenset({"struct", "union", "enum"})
_DEEPEST = 50
_ATTRIBUTES = frozenset({"__attribute__", "__attribute", "__declspec", "_Alignas", "alignas"})
_PACKED_WORDS = frozenset({"__packed", "_Packed", "__packed__", "PACKED", "__PACKED"})
_DROPPED = frozenset({"__extension__", "__restrict", "__inline", "__inline__", "__volatile__", "__const"})
_BEGINNINGS = COMPOUND | {"typedef", "const", "static", "extern", "volatile", *_PACKED_WORDS}
_OPEN = {"(": ")", "[": "]", "{": "}"}
_CLOSE = frozenset(_OPEN.values())


@dataclass(frozen=True, slots=True)
class Piece:
    """A declaration with braces or a typedef.

    Attributes:
        tokens: Its tokens without attributes, the semicolon included.
        packed: Indexes of the keywords of packed structures, unions and enums.
        trouble: An attribute that changes the layout in another way, and its line.
        pack: Greatest alignment, None for that of the machine.
    """

    tokens: tuple[Token, ...]
    packed: frozenset[int]
    trouble: tuple[str, int] | None
    pack: int | None

    @property
    def line(self) -> int:
        """Line of the first token."""
        return self.tokens[0].line


def pieces(tokens: Iterable[Token | Packing], notes: Notes) -> Iterator[Piece]:
    """Give the declarations in order, without functions and variables.

    Raises:
        ImportFileError: brackets do not fit.
    """
    divider = _Divider(notes)
    for token in tokens:
        if isinstance(token, Packing):
            divider.pack = token.size
        elif (piece := divider.add(token)) is not None:
            yield piece
    divider.end()


@dataclass
class _Divider:
    """Finds the end of each declaration."""

    notes: Notes
    pack: int | None = None
    _waiting: list[Token] = field(default_factory=list)
    _opened: list[Token] = field(default_factory=list)

    def add(self, token: Token) -> Piece | None:
        """Add a token; return the declaration that it ends."""
        self._waiting.append(token)
        text = token.text if token.kind == "mark" else ""
        if text in _OPEN:
            self._open(token)
        elif text in _CLOSE:
            self._close(token)
        elif text == ";" and not self._opened:
            done, self._waiting = self._waiting, []
            return _piece(self._without_macros(done), self.pack)
        return None

    def _without_macros(self, tokens: list[Token]) -> list[Token]:
        """Take away unknown macros before a declaration, such as __BEGIN_DECLS."""
        while len(tokens) > 1 and tokens[0].kind == "word" and tokens[1].text in _BEGINNINGS:
            if tokens[0].text in _BEGINNINGS:
                break
            if "pack" in tokens[0].text.lower():
                self.notes.add(tokens[0].line, f"{tokens[0].text} is not known and ignored")
            tokens = tokens[1:]
        return tokens

    def end(self) -> None:
        """Report what follows the last declaration; raise an error for open brackets."""
        if self._opened:
            raise self.notes.error(self._opened[-1].line, f"'{self._opened[-1].text}' is not closed")
        if self._waiting:
            words = " ".join(each.text for each in self._waiting[:5])
            self.notes.add(self._waiting[0].line, f"'{words[:60]}' at the end is left out: not a declaration")

    def _open(self, token: Token) -> None:
        if _is_linkage(self._waiting):
            self._waiting = []
            return
        self._opened.append(token)
        if len(self._opened) > _DEEPEST:
            raise self.notes.error(token.line, f"brackets are nested more than {_DEEPEST} deep")

    def _close(self, token: Token) -> None:
        if not self._opened and token.text == "}":
            self._waiting = []  # the end of extern "C"
            return
        if not self._opened or _OPEN[self._opened[-1].text] != token.text:
            raise self.notes.error(token.line, f"'{token.text}' does not close an open bracket")
        self._opened.pop()
        if token.text == "}" and not self._opened and _is_function(self._waiting):
            self._waiting = []


def _is_linkage(tokens: list[Token]) -> bool:
    return [each.text for each in tokens] == ["extern", '"C"', "{"]


def _is_function(tokens: list[Token]) -> bool:
    """Whether the first brace of a declaration follows a parenthesis, as the body of a function does."""
    first = next(at for at, each in enumerate(tokens) if each.text == "{")
    return (
        first > 0
        and tokens[first - 1].text == ")"
        and not any(each.text in COMPOUND | {"__attribute__"} for each in tokens[max(0, first - 12) : first])
    )


def _piece(tokens: list[Token], pack: int | None) -> Piece | None:
    cleaned = _Cleaner(tokens)
    kept = cleaned.kept
    body = any(each.text == "{" and _heads(kept, at) for at, each in enumerate(kept))
    if not body and kept[0].text != "typedef":
        return None
    return Piece(tuple(kept), frozenset(cleaned.packed), cleaned.trouble, pack)


def _heads(tokens: list[Token], brace: int) -> bool:
    """Whether a brace opens the body of a structure, a union or an enum."""
    return any(each.text in COMPOUND for each in tokens[max(0, brace - 2) : brace])


@dataclass
class _Cleaner:
    """Takes attributes out of a declaration."""

    tokens: list[Token]
    kept: list[Token] = field(default_factory=list)
    packed: set[int] = field(default_factory=set)
    trouble: tuple[str, int] | None = None
    _opened: list[int] = field(default_factory=list)
    _closed: int = -1
    _pending: bool = False

    def __post_init__(self) -> None:
        at = 0
        while at < len(self.tokens):
            token = self.tokens[at]
            if token.text in _ATTRIBUTES and self._next(at) == "(":
                at = self._attribute(at + 1, token)
            elif token.text == "[" and self._next(at) == "[":
                at = self._attribute(at, token)
            else:
                if token.text in _PACKED_WORDS:
                    self._pack(token)
                elif token.text not in _DROPPED:
                    self._keep(token)
                at += 1

    def _next(self, at: int) -> str:
        return self.tokens[at + 1].text if at + 1 < len(self.tokens) else ""

    def _attribute(self, at: int, start: Token) -> int:
        """Read what is in brackets from a place on; return the place after it."""
        depth = 0
        while True:
            token = self.tokens[at]
            depth += (token.text in _OPEN) - (token.text in _CLOSE)
            if token.text.strip("_") == "packed":
                self._pack(start)
            elif token.text.strip("_") in ("aligned", "align", "mode", "vector_size", "scalar_storage_order"):
                self.trouble = token.text, token.line
            at += 1
            if depth == 0:
                break
        if start.text in ("_Alignas", "alignas"):
            self.trouble = start.text, start.line
        return at

    def _keep(self, token: Token) -> None:
        at = len(self.kept)
        if token.text in COMPOUND and self._pending:
            self.packed.add(at)
            self._pending = False
        if token.text == "{":
            self._opened.append(self._keyword())
        elif token.text == "}":
            self._closed = self._opened.pop()
        self.kept.append(token)

    def _keyword(self) -> int:
        """Index of the keyword whose body begins now, -1 if there is none."""
        for back in (1, 2):
            if len(self.kept) >= back and self.kept[-back].text in COMPOUND:
                return len(self.kept) - back
        return -1

    def _pack(self, attribute: Token) -> None:
        last = self.kept[-1].text if self.kept else ""
        if last == "}" and self._closed >= 0:
            self.packed.add(self._closed)
        elif (keyword := self._keyword()) >= 0:
            self.packed.add(keyword)
        elif last in ("", "typedef", ";", "{", "const", "static"):
            self._pending = True
        else:
            self.trouble = f"{attribute.text} of a member", attribute.line
