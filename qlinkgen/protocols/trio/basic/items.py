"""Reads the items of PRINT."""

from __future__ import annotations

import re
from typing import Literal

from qlinkgen.protocols.trio.basic.expression_parser import ExpressionParser
from qlinkgen.protocols.trio.basic.expressions import Expression, Number, number_of
from qlinkgen.protocols.trio.basic.lexer import Kind
from qlinkgen.protocols.trio.basic.transfers import Control, Formatted, Item, Text
from qlinkgen.protocols.trio.facts import LINE_END

#: What the 6 of a format such as [6.1] is: the places before the point, or the width, as in [6,1].
Pointed = Literal["before", "width"]
_POINTED = re.compile(r"([0-9]{1,3})\.([0-9]{1,3})")


def items_of(tokens: ExpressionParser, pointed: Pointed) -> tuple[tuple[Item, ...], str]:
    """Return the items of a PRINT after its node, and the end of its line.

    The items follow a comma. Between them a semicolon prints nothing, a comma a blank; a semicolon at the
    end keeps the cursor in its row.

    Raises:
        BasicError: something else.
    """
    items: list[Item] = []
    if not _ended(tokens):
        tokens.expect(",")
        items.append(_item(tokens, pointed))
    while not _ended(tokens):
        if tokens.skip(Kind.SIGN, ";"):
            if _ended(tokens):
                return tuple(items), ""
        else:
            tokens.expect(",")
            items.append(Text(" "))
        items.append(_item(tokens, pointed))
    return tuple(items), LINE_END


def _ended(tokens: ExpressionParser) -> bool:
    return tokens.at(Kind.END) or tokens.at(Kind.SIGN, ":") or tokens.at(Kind.WORD, "ELSE")


def _item(tokens: ExpressionParser, pointed: Pointed) -> Item:
    if tokens.at(Kind.TEXT):
        return Text(tokens.take().text)
    for word in ("CHR", "CURSOR"):
        if tokens.skip(Kind.WORD, word):
            given = tokens.arguments()
            if len(given) != 1:
                raise given[1].place.error(f"{word} has {len(given)} arguments; write {word}(number)")
            return Control(word, given[0])
    number = tokens.expression()
    return Formatted(number, _form(tokens, pointed) if tokens.skip(Kind.SIGN, "[") else ())


def _form(tokens: ExpressionParser, pointed: Pointed) -> tuple[Expression, ...]:
    if tokens.at(Kind.NUMBER) and tokens.at(Kind.SIGN, "]", ahead=1):
        token = tokens.take()
        tokens.expect("]")
        if (found := _POINTED.fullmatch(token.text)) is not None:
            first, decimals = int(found[1]), int(found[2])
            width = first if pointed == "width" else first + 1 + decimals
            return Number(token.place, float(width)), Number(token.place, float(decimals))
        return (number_of(token.place, token.text),)
    form = [tokens.expression()]
    if tokens.skip(Kind.SIGN, ","):
        form.append(tokens.expression())
    tokens.expect("]")
    return tuple(form)
