"""Parses hex text of arguments, options and standard input.

White space separates words. A word is pairs of digits, with or without 0x before it: ``a5``, ``a5a504``,
``0xA5``. A word of a single digit is a byte as well, as many programs print it: ``4`` and ``0x4`` are 04.
Any other odd number of digits is refused as ambiguous.
"""

from __future__ import annotations

import re

_WORD = re.compile(r"\S+")
_NO_DIGIT = re.compile(r"[^0-9a-fA-F]")


class HexError(ValueError):
    """Text that is not hex.

    Attributes:
        message: what was seen, and the rule.
        at: index of the character in the fed text; 0 if the word began earlier.
        before: the bytes before it.
    """

    def __init__(self, message: str, at: int, before: bytes) -> None:
        super().__init__(message)
        self.message = message
        self.at = at
        self.before = before


class HexReader:
    """Reads hex text in chunks; a chunk may end anywhere."""

    def __init__(self) -> None:
        #: The end of a word that may continue in the next chunk: at most two characters and a digit.
        self._rest = ""
        #: Bytes of that word were returned already.
        self._begun = False

    def feed(self, text: str) -> bytes:
        """Return the complete bytes. Raises HexError at the first wrong character."""
        carried = len(self._rest)
        text, self._rest = self._rest + text, ""
        found = bytearray()
        end = 0
        for word in _WORD.finditer(text):
            if word.start() > end:  # white space ends the previous word
                self._begun = False
            end = word.end()
            try:
                found += self._word(word[0], last=end == len(text))
            except _Wrong as wrong:
                at = max(0, word.start() + wrong.at - carried)
                raise HexError(wrong.text, at, bytes(found)) from None
        if end < len(text):
            self._begun = False
        return bytes(found)

    def _word(self, word: str, *, last: bool) -> bytes:
        """Return the bytes of a word or of a part of it; the last word of a chunk may continue."""
        prefix = 2 if not self._begun and word[:2].lower() == "0x" else 0
        if wrong := _NO_DIGIT.search(word, prefix):
            raise _Wrong(
                f"{_shown(wrong[0])} is not a hex digit; write bytes as pairs of 0-9 and a-f", wrong.start()
            )
        digits = word[prefix:]
        if not last:
            return self._whole(word, digits)
        if not self._begun and len(digits) < 2:
            self._rest = word
            return b""
        self._begun = True
        even = len(digits) & ~1
        self._rest = digits[even:]
        return bytes.fromhex(digits[:even])

    def _whole(self, word: str, digits: str) -> bytes:
        if not self._begun and len(digits) == 1:
            return bytes.fromhex(f"0{digits}")
        if not self._begun and not digits:
            raise _Wrong(f"'{word}' has no digit; write bytes as pairs of 0-9 and a-f", 0)
        if len(digits) % 2:
            seen = f"the digit '{digits[-1]}' ends a word" if self._begun else f"'{_cut(word)}' is a word"
            raise _Wrong(f"{seen} with an odd number of hex digits; write two per byte, or a single digit", 0)
        return bytes.fromhex(digits)

    def finish(self) -> bytes:
        """Return the byte completed by the end of the text. Raises HexError for half a byte."""
        return self.feed("\n")


class _Wrong(Exception):
    def __init__(self, text: str, at: int) -> None:
        super().__init__(text)
        self.text = text
        self.at = at


def _cut(word: str) -> str:
    return word if len(word) <= 24 else f"{word[:20]}..."


def _shown(character: str) -> str:
    if "\udc80" <= character <= "\udcff":  # a byte that is not UTF-8
        return f"byte {ord(character) - 0xDC00:02x}"
    return f"'{character}'" if character.isprintable() else f"character U+{ord(character):04X}"
