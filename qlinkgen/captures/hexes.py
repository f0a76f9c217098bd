r"""Bytes written as hex digits, in the ways that programs and people write them.

Words are pairs of digits: ``a5``, ``A5A504``, ``0xA5``, ``\xa5``, ``$A5``, ``A5h``; a single digit is a
byte too. White space, commas, colons, semicolons, dashes, bars and brackets separate them. Quotes, comments
and the beginning of an array in C, Rust, Python or JavaScript are passed over.
"""

from __future__ import annotations

import ast
import re

_WORD = re.compile(
    r"(?:0x|\\x|&h|\$)?((?:[0-9a-f]{2})+|[0-9a-f])(?:h|u)?(?=$|[\s,;:|}\"'\\\])-])", re.IGNORECASE
)
_BETWEEN = re.compile(r"[\s,;:|\"'{}\[\]()-]*")
#: ``static const uint8_t frame[3] = {``, ``let frame: [u8; 3] = [``, ``frame = bytes([``, ``b"``
_DECLARED = re.compile(
    r"\s*(?:[A-Za-z_][\w :<>\[\];,&*]*=\s*(?=[\[{&bnv]))?"
    r"(?:&|b(?=[\"'])|bytes(?=\()|bytearray(?=\()|vec!|new Uint8Array(?=\())?"
)
_COMMENT = re.compile(r"#.*|//.*|/\*.*?\*/|/\*.*")
#: A byte string as Python prints it: ``b'\\xa5Z\\x00'``.
_PRINTED = re.compile(r"""\s*(b'(?:[^'\\]|\\.)*'|b"(?:[^"\\]|\\.)*")""")
#: Between the bytes of a log, where other text may follow.
_BESIDE = re.compile(r"[,:;-]?[ \t]?(?=\\x)|[,:;]? |[,:;-]|\]\s?\[|")
_FAR = re.compile(r" {2}")


def without_comment(line: str) -> str:
    """Return a line without a comment as of Python or C."""
    return _COMMENT.sub("", line)


def hex_bytes(text: str) -> bytes | None:
    """Return the bytes of a text, empty for one without digits; None if it has anything else."""
    if (printed := printed_bytes(text)) and not text[printed[1] :].strip():
        return printed[0]
    found = bytearray()
    declared = _DECLARED.match(text)
    at = _BETWEEN.match(text, declared.end() if declared else 0).end()  # type: ignore[union-attr]
    while at < len(text):
        word = _WORD.match(text, at)
        if word is None:
            return None
        found += _bytes(word)
        at = _BETWEEN.match(text, word.end()).end()  # type: ignore[union-attr]
    return bytes(found)


def printed_bytes(text: str) -> tuple[bytes, int] | None:
    """Return a byte string as Python prints it with which a text begins, and the offset after it."""
    printed = _PRINTED.match(text)
    if printed is None:
        return None
    try:
        found = ast.literal_eval(printed[1])
    except (SyntaxError, ValueError):
        return None
    return (found, printed.end()) if isinstance(found, bytes) else None


def leading_bytes(text: str) -> tuple[bytes, int]:
    """Return the bytes with which a text begins, and the offset after them.

    Two spaces end them, except in the middle of 16 bytes, as dumps have them: characters follow that may look
    like digits. So does a word of another length than the first.
    """
    if printed := printed_bytes(text):
        return printed
    found = bytearray()
    at = end = 0
    size = 0
    while word := _WORD.match(text, at):
        if size and len(word[1]) != size and len(found) % 8 == 0 and _FAR.search(text, end, at):
            break
        size = size or len(word[1])
        found += _bytes(word)
        end = word.end()
        if _FAR.match(text, end) and len(found) % 16 == 8:
            at = end + 2
        elif between := _BESIDE.match(text, end):
            at = between.end()
        if at == end and text[at : at + 1] != "\\":
            break
    return bytes(found), end


def _bytes(word: re.Match[str]) -> bytes:
    digits = word[1]
    return bytes.fromhex(digits if len(digits) > 1 else f"0{digits}")
