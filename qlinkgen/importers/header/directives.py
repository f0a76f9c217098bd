"""Handles directives of a header: conditions on names, simple constants, packing; nothing else."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from qlinkgen.errors import ImportFileError
from qlinkgen.importers.header.tokens import Token, scan
from qlinkgen.importers.notes import Notes

#: Headers whose types are known.
_KNOWN = frozenset({"stdint.h", "stdbool.h", "stddef.h", "inttypes.h"})
#: Limits of what macros may expand to.
_MOST_TOKENS, _DEEPEST = 200_000, 20
_DEEPEST_CONDITION = 100
_PARTS = re.compile(r"#\s*(?P<name>\w*)\s*(?P<rest>.*)", re.DOTALL)
_DEFINE = re.compile(r"(?P<name>[A-Za-z_]\w*)(?P<arguments>\()?\s*(?P<value>.*)", re.DOTALL)
_DEFINED = re.compile(r"(?P<not>!\s*)?defined\s*(?:\(\s*(?P<a>\w+)\s*\)|(?P<b>\w+))\s*\Z")
_PACK = re.compile(
    r"pack\s*\(\s*(?:(?P<verb>push|pop)\s*,?\s*)?(?:\w*[A-Za-z_]\w*\s*,\s*)?(?P<size>\d+)?\s*\)\s*\Z"
)


@dataclass(frozen=True, slots=True)
class Packing:
    """``#pragma pack`` for the tokens after it: the greatest alignment, None for that of the machine."""

    size: int | None


@dataclass
class _Condition:
    active: bool
    taken: bool
    outer: bool


@dataclass
class _Macro:
    tokens: tuple[Token, ...]
    line: int
    used: bool = False


@dataclass
class Directives:
    """Evaluates directives.

    Attributes:
        macros: Constants without arguments.
    """

    notes: Notes
    macros: dict[str, _Macro] = field(default_factory=dict)
    _conditions: list[_Condition] = field(default_factory=list)
    _packs: list[int | None] = field(default_factory=list)
    _pack: int | None = None
    _made: int = 0

    def run(self, tokens: Iterable[Token]) -> Iterator[Token | Packing]:
        """Give the tokens that remain, with the changes of packing between them."""
        line = 1
        for token in tokens:
            line = token.line
            if token.kind == "directive":
                before = self._pack
                self._directive(token)
                if self._pack != before:
                    yield Packing(self._pack)
            elif self._active:
                yield from self._expanded(token, ())
        if self._conditions:
            raise self.notes.error(line, "an #if is not closed; add #endif")
        self._report_constants()

    @property
    def _active(self) -> bool:
        return not self._conditions or self._conditions[-1].active

    def _directive(self, token: Token) -> None:
        parts = _PARTS.match(token.text)
        assert parts is not None  # the token begins with #
        name, rest = parts["name"], parts["rest"].strip()
        if name in ("if", "ifdef", "ifndef", "elif", "else", "endif"):
            self._conditional(name, rest, token.line)
        elif self._active:
            self._plain(name, rest, token.line)

    def _plain(self, name: str, rest: str, line: int) -> None:
        match name:
            case "include":
                if rest.strip('<>" ') not in _KNOWN:
                    self.notes.add(line, f"#include {rest} is not read; types defined there are unknown")
            case "define":
                self._define(rest, line)
            case "undef":
                self.macros.pop(rest, None)
            case "pragma" if rest.startswith("pack"):
                self._packing(rest, line)
            case "pragma" | "":
                pass  # other compilers' business, and line markers of a preprocessor
            case _ if name.isdecimal():
                pass
            case _:
                self.notes.add(line, f"#{name} is ignored")

    def _define(self, rest: str, line: int) -> None:
        found = _DEFINE.match(rest)
        if found is None or found["arguments"]:
            name = found["name"] if found else rest[:40]
            self.notes.add(line, f"macro {name} is left out: only constants without arguments are known")
            return
        try:
            tokens, _ = scan(found["value"], self.notes)
        except ImportFileError as error:
            self.notes.add(line, f"macro {found['name']} is left out: {error.message}")
            return
        self.macros[found["name"]] = _Macro(tuple(Token(each.kind, each.text, line) for each in tokens), line)

    def _packing(self, rest: str, line: int) -> None:
        found = _PACK.match(rest)
        if found is None:
            self.notes.add(line, f"#pragma {rest} is not understood and ignored")
            return
        if found["verb"] == "pop":
            self._pack = self._packs.pop() if self._packs else None
            return
        if found["verb"] == "push":
            self._packs.append(self._pack)
        if found["size"]:
            size = int(found["size"][:4])
            self._pack = size if size in (1, 2, 4, 8, 16) else self._pack
        elif not found["verb"]:
            self._pack = None

    # Conditions -----------------------------------------------------------------------------------------

    def _conditional(self, name: str, rest: str, line: int) -> None:
        if name in ("if", "ifdef", "ifndef"):
            if len(self._conditions) >= _DEEPEST_CONDITION:
                raise self.notes.error(line, f"conditions are nested more than {_DEEPEST_CONDITION} deep")
            outer = self._active
            value = outer and self._value(name, rest, line)
            self._conditions.append(_Condition(value, value, outer))
            return
        if not self._conditions:
            raise self.notes.error(line, f"#{name} without #if")
        condition = self._conditions[-1]
        match name:
            case "endif":
                self._conditions.pop()
            case "else":
                condition.active = condition.outer and not condition.taken
                condition.taken = True
            case _:
                condition.active = condition.outer and not condition.taken and self._value("if", rest, line)
                condition.taken = condition.taken or condition.active

    def _value(self, name: str, rest: str, line: int) -> bool:
        word = next(iter(rest.split()), "")
        if name != "if":
            return (word in self.macros) is (name == "ifdef")
        if found := _DEFINED.match(rest):
            return ((found["a"] or found["b"]) in self.macros) is not bool(found["not"])
        if rest in ("0", "1"):
            return rest == "1"
        self.notes.add(line, f"condition '{rest[:60]}' is not evaluated and taken as false")
        return False

    # Constants ------------------------------------------------------------------------------------------

    def _expanded(self, token: Token, inside: tuple[str, ...]) -> Iterator[Token]:
        self._made += bool(inside)
        if self._made > _MOST_TOKENS:
            raise self.notes.error(token.line, f"macros expand to more than {_MOST_TOKENS} tokens")
        macro = self.macros.get(token.text) if token.kind == "word" else None
        if macro is None or token.text in inside or len(inside) >= _DEEPEST:
            yield token
            return
        macro.used = True
        for each in macro.tokens:
            yield from self._expanded(Token(each.kind, each.text, token.line), (*inside, token.text))

    def _report_constants(self) -> None:
        for name, macro in self.macros.items():
            if not macro.used and macro.tokens:
                text = " ".join(each.text for each in macro.tokens)
                self.notes.add(macro.line, f"constant {name} ({text[:40]}) is left out: no structure uses it")
