"""Writes JSON for readable diffs: one vector per line, and every digit of a Decimal."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from decimal import Decimal

Json = str | int | float | Decimal | None | Sequence["Json"] | Mapping[str, "Json"]


def document(head: Mapping[str, Json], lists: Mapping[str, Iterable[Mapping[str, Json]]]) -> str:
    """An object with plain entries and lists, one line per list item."""
    lines = [f"  {text(key)}: {text(value)}" for key, value in head.items()]
    for key, items in lists.items():
        rows = ",\n".join(f"    {text(item)}" for item in items)
        lines.append(f"  {text(key)}: [\n{rows}\n  ]" if rows else f"  {text(key)}: []")
    return "{\n" + ",\n".join(lines) + "\n}\n"


def text(value: Json) -> str:
    """A value as one line of JSON."""
    if isinstance(value, Decimal):
        return str(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_plain(key)}: {text(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(text, value)) + "]"
    return _plain(value)


_plain = json.JSONEncoder().encode
