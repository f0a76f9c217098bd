"""The last pass over a header: no blank line where none helps, and no line that has to be scrolled."""

from __future__ import annotations

_WIDTH = 110


def tidy(text: str) -> str:
    """Without trailing space and needless blank lines; long code is folded at a comma."""
    lines: list[str] = []
    for line in text.split("\n"):
        line = line.rstrip()  # noqa: PLW2901 - the same line, tidied
        if not line and (not lines or not lines[-1] or lines[-1].endswith("{")):
            continue
        if line.lstrip() == "}" and lines and not lines[-1]:
            lines.pop()
        lines += _folded(line) if len(line) > _WIDTH else [line]
    return "\n".join(lines) + "\n" if lines[-1] else "\n".join(lines)


def _folded(line: str) -> list[str]:
    if line.lstrip().startswith(("#", "/*", "*")) or "/*" in line or line.endswith("\\"):
        return [line]
    indent = " " * (len(line) - len(line.lstrip()) + 4)
    pieces = []
    while len(line) > _WIDTH:
        cut = max(
            line.rfind(separator, len(indent), _WIDTH) + len(separator)
            for separator in (", ", " || ", " && ")
        )
        if cut <= len(indent) + 4:
            break
        pieces.append(line[:cut].rstrip())
        line = indent + line[cut:]
    return [*pieces, line]
