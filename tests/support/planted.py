"""Faults planted in a header, to verify that tests detect them."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Fault:
    """One change of one function: every match of a pattern is replaced."""

    function: str
    pattern: str
    replacement: str | Callable[[re.Match[str]], str]

    def planted(self, header: str) -> str:
        """The header with the fault; AssertionError if the pattern does not occur in the function."""
        start = re.search(rf"^static inline [^;{{]*\b{self.function}\(", header, re.MULTILINE)
        assert start, f"there is no {self.function}"
        end = header.index("\n}\n", start.start())
        text, count = re.subn(self.pattern, self.replacement, header[start.start() : end])
        assert count, f"{self.function} has no {self.pattern}: choose another fault"
        return header[: start.start()] + text + header[end:]


def one_more(match: re.Match[str]) -> str:
    """Replace a bound by the next number; the groups of the pattern are the text before it and the number."""
    return f"{match[1]}{int(match[2]) + 1}U"
