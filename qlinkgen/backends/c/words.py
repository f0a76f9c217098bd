"""Functions for the words of an enum, as code: no data has to be copied to memory."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from qlinkgen.backends.c.forms import Helper
from qlinkgen.backends.c.names import unsigned
from qlinkgen.backends.c.text_forms import Verb
from qlinkgen.model.words import Words


def word_helpers(prefix: str, needed: Collection[tuple[Words, Verb]]) -> list[Helper]:
    """The functions for these enums and verbs."""
    found: list[Helper] = []
    for words in sorted({words for words, _ in needed}, key=lambda each: each.enum):
        lines: list[str] = []
        for verb, function in (("size", _size), ("put", _put), ("get", _get)):
            if (words, verb) in needed:
                lines += ["", *function(prefix, words)] if lines else function(prefix, words)
        found.append(Helper(f"The words of {words.enum}", tuple(lines)))
    return found


def _size(prefix: str, words: Words) -> Iterator[str]:
    """The number of characters of a word, the maximum for a number that is out of range."""
    yield f"static inline size_t {prefix}_size_word_{words.enum}_(uint8_t value)"
    yield "{"
    yield "    switch (value) {"
    for number, word in enumerate(words.words):
        if len(word) < words.most:
            yield f"    case {number}U:"
            yield f"        return {len(word)}U;"
    yield "    default:"
    yield f"        return {words.most}U;"
    yield "    }"
    yield "}"


def _put(prefix: str, words: Words) -> Iterator[str]:
    yield f"static inline void {prefix}_put_word_{words.enum}_(uint8_t *to, uint8_t value)"
    yield "{"
    yield "    switch (value) {"
    for number, word in enumerate(words.words):
        yield f"    case {number}U:" if number + 1 < len(words.words) else "    default:"
        for index, octet in enumerate(word):
            yield f"        to[{index}] = {_octet(octet)};"
        yield "        break;"
    yield "    }"
    yield "}"


def _get(prefix: str, words: Words) -> Iterator[str]:
    """The number of a text, one above the last if it is not one of them."""
    yield f"static inline uint8_t {prefix}_get_word_{words.enum}_(const uint8_t *from, size_t size)"
    yield "{"
    for number, word in enumerate(words.words):
        *terms, last = octets_are("from", word, folded=words.folded)
        yield f"    if ((size == {len(word)}U) &&"
        yield from (f"        {term} &&" for term in terms)
        yield f"        {last}) {{"
        yield f"        return {number}U;"
        yield "    }"
    yield f"    return {len(words.words)}U;"
    yield "}"


def _octet(octet: int) -> str:
    return unsigned(octet, 8, hexadecimal=True)


def octets_are(source: str, word: bytes, *, folded: bool) -> list[str]:
    """The conditions that hold if bytes are those of a word, of any case if it is ``folded``."""
    return [
        f"(({source}[{index}] & 0xDFU) == {_octet(octet & 0xDF)})"
        if folded and chr(octet).isalpha()
        else f"({source}[{index}] == {_octet(octet)})"
        for index, octet in enumerate(word)
    ]
