"""Suggests known words for a misspelt one."""

from __future__ import annotations

from collections.abc import Iterable

#: Longer words are cut, because comparing them takes long.
_LONGEST = 80


def similar(word: str, known: Iterable[str], most: int = 1) -> tuple[str, ...]:
    """Return the known words that differ from a word by typing errors, the nearest first.

    An error is an additional, missing or wrong character, or a swap of two. One error is allowed, or one for
    every three characters begun if the first character is right. In a word of three a wrong character is not
    allowed: `f32` does not suggest `u32`, nor `lrc` `arc`.
    """
    asked = word[:_LONGEST].lower()
    found = []
    for each in known:
        other = each.lower()
        errors = _errors(asked, other)
        most_errors = (len(asked) + 2) // 3 if asked[:1] == other[:1] else 1
        if errors <= most_errors and not (len(asked) <= 3 and _one_replaced(asked, other)):
            found.append((errors, each))
    return tuple(each for _, each in sorted(found)[:most])


def _one_replaced(word: str, other: str) -> bool:
    return len(word) == len(other) and sum(a != b for a, b in zip(word, other, strict=True)) == 1


def _errors(word: str, other: str) -> int:
    """Typing errors between two words: insertions, deletions, replacements, swaps of neighbours."""
    before: list[int] = []
    row = list(range(len(other) + 1))
    for at, character in enumerate(word, 1):
        rows = [at]
        for to, wanted in enumerate(other, 1):
            cost = min(row[to] + 1, rows[to - 1] + 1, row[to - 1] + (character != wanted))
            if at > 1 < to and character == other[to - 2] and word[at - 2] == wanted:
                cost = min(cost, before[to - 2] + 1)
            rows.append(cost)
        before, row = row, rows
    return row[-1]
