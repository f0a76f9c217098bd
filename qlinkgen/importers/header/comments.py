"""Finds the comment that describes a member, a constant or a structure."""

from __future__ import annotations

import re

from qlinkgen.importers.header.tokens import Comment

_MARGIN = re.compile(r"^[ \t]*(?:\*(?!/)|//[/!]?)?<?[ \t]*", re.MULTILINE)
_TAG = re.compile(r"[@\\](?:brief|short|details|note|param\s+\w+|struct\s+\w+|enum\s+\w+|remark)\b\s*")
_RULE = re.compile(r"([-=*#_~+])\1{3,}")
#: Comments that are for programs.
_FOR_TOOLS = re.compile(r"\s*(?:NOLINT|clang-format|lint\b|cppcheck|eslint|TODO|FIXME|XXX)")


class Comments:
    """The comments of a file by their lines."""

    def __init__(self, comments: list[Comment]) -> None:
        self._after: dict[int, list[Comment]] = {}
        self._above: dict[int, list[Comment]] = {}
        trailing: tuple[int, int] = (0, 0)
        for each in comments:
            if not each.alone:
                self._after.setdefault(each.first, []).append(each)
                trailing = each.first, each.last
            elif _trails(each) and each.first == trailing[1] + 1:
                self._after[trailing[0]].append(each)
                trailing = trailing[0], each.last
            else:
                previous = self._above.get(each.first - 1)
                joined = previous is not None and _is_line(previous[-1]) and _is_line(each)
                group = self._above.pop(each.first - 1, []) if joined else []
                group.append(each)
                self._above[each.last] = group

    def of(self, line: int, *, above: bool = True) -> str:
        """The text of the comment after the code of a line, else of the one above it."""
        return _text(self._after.get(line, [])) or (self.above(line) if above else "")

    def above(self, line: int) -> str:
        """The text of the comment above a line."""
        return _text(self._above.get(line - 1, []))


def _trails(comment: Comment) -> bool:
    return comment.text.startswith(("///<", "//!<"))


def _is_line(comment: Comment) -> bool:
    return comment.text.startswith("//")


def _text(comments: list[Comment]) -> str:
    text = " ".join(_bare(each.text) for each in comments)
    return "" if _FOR_TOOLS.match(text) else " ".join(text.split())


def _bare(text: str) -> str:
    body = text[2:-2].lstrip("*!") if text.startswith("/*") else text
    return _RULE.sub(" ", _TAG.sub("", _MARGIN.sub("", body)))
