"""The last pass over a header: removes needless blank lines and folds long lines."""

from __future__ import annotations

import re
import textwrap

_WIDTH = 120
#: Code is folded after these operators.
_SEPARATORS = (", ", " || ", " && ", " | ", " + ", " - ", " ? ", " : ", " = ")
#: A separator or a bracket; two separators may share a space.
_PLACES = re.compile(rf"(?=([(\[{{)\]}}]|{'|'.join(map(re.escape, _SEPARATORS))}))")


def tidy(text: str) -> str:
    """Remove trailing spaces and needless blank lines, and fold long lines."""
    lines: list[str] = []
    for line in _folded([line.rstrip() for line in text.split("\n")]):
        if not line and (not lines or not lines[-1] or lines[-1].endswith("{")):
            continue
        if line.lstrip() == "}" and lines and not lines[-1]:
            lines.pop()
        lines.append(line)
    return "\n".join(lines) + "\n" if lines[-1] else "\n".join(lines)


def _folded(lines: list[str]) -> list[str]:
    folded: list[str] = []
    carried = ""  # words carried over to the next line of a comment
    for number, line in enumerate(lines):
        following = lines[number + 1] if number + 1 < len(lines) else ""
        if carried:
            line = f" * {carried} {line[3:]}"  # noqa: PLW2901 - the same line with carried words
            carried = ""
        if len(line) <= _WIDTH:
            folded.append(line)
        elif line.startswith(" *") or (line.startswith("/*") and "*/" not in line):
            first, *more = textwrap.wrap(line, _WIDTH, subsequent_indent=" * ", break_on_hyphens=False)
            if len(more) == 1 and _is_prose(following) and "*/" not in line:
                carried, more = more[0][3:], []
            folded += [first, *more]
        else:
            folded += _shorter(line, in_macro=bool(folded) and folded[-1].endswith("\\"))
    return folded


def _is_prose(line: str) -> bool:
    return line.startswith(" * ") and line[3:4].isalpha()


def _shorter(line: str, *, in_macro: bool) -> list[str]:
    code, opening, note = line.partition("/*")
    indent = line[: len(line) - len(line.lstrip())]
    if opening and note.endswith("*/"):
        comment = _comment(note.removesuffix("*/").strip(), indent)
        return comment + _folded([code.rstrip()] if code.strip() else [])
    if line.startswith("#define ") and line.endswith('"'):
        return [line]  # a fold would add spaces to the string
    if line.startswith("#error "):
        words = textwrap.wrap(line.removeprefix("#error ").strip('"'), _WIDTH - 12)
        return ['#error "' + ' " \\\n    "'.join(words) + '"']
    if line.startswith("static inline ") and line.endswith(")"):
        head, parameters = line.split("(", 1)
        return [f"{head}(", *_pieces(f"    {parameters}", "    ", _WIDTH)]
    if line.startswith("#") or in_macro or line.endswith("\\"):
        pieces = _pieces(line.removesuffix("\\").rstrip(), indent + "    ", _WIDTH - 2)
        end = " \\" if line.endswith("\\") else ""
        return [f"{piece} \\" for piece in pieces[:-1]] + [pieces[-1] + end]
    return _pieces(line, indent + "    ", _WIDTH)


def _comment(text: str, indent: str) -> list[str]:
    one = f"{indent}/* {text} */"
    if len(one) <= _WIDTH:
        return [one]
    lines = textwrap.wrap(text, _WIDTH - len(indent) - 6, break_on_hyphens=False)
    return [
        f"{indent}/* {lines[0]}",
        *(f"{indent} * {line}" for line in lines[1:-1]),
        f"{indent} * {lines[-1]} */",
    ]


def _pieces(line: str, indent: str, width: int) -> list[str]:
    pieces = []
    while len(line) > width:
        cut = _best_cut(line, len(indent) + 4, width)
        if not cut:
            break
        pieces.append(line[:cut].rstrip())
        line = indent + line[cut:]
    return [*pieces, line]


def _best_cut(line: str, least: int, width: int) -> int:
    """Position after the least nested separator, the last of several; 0 if there is none."""
    best, depth, nested = 0, len(line), 0
    for match in _PLACES.finditer(line, 0, width + 1):
        found = match[1]
        if len(found) == 1:
            nested += 1 if found in "([{" else -1
            continue
        end = match.start() + len(found)
        if least < end and (nested <= depth or best < width // 3):
            best, depth = end, nested
    return best
