"""Pairs of features: which occur together in random schemas, and few seeds that have all of them."""

from __future__ import annotations

import functools
import itertools
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

#: Keys whose entries have names of their own, and what an entry is called.
_NAMED = {
    "parts": "part", "packet": "part", "header": "part", "commands": "command", "messages": "message",
    "request": "field", "response": "field", "fields": "field", "types": "type", "bits": "bits",
    "replies": "reply",
}  # fmt: skip
#: Keys whose entries are names and numbers of the schema, not keys of the language.
_FREE = {"values", "cases", "attributes", "id", "enums", "flags", "replace", "algorithm", "protocol"}
#: Keys whose values are features of their own.
_CHOSEN = {"role", "direction", "byteorder", "addressing", "kind", "repeat", "per", "reserved"}
#: Keys of every schema, and texts.
_PLAIN = {
    "doc",
    "section",
    "title",
    "source",
    "revision",
    "name",
    "qlinkgen",
    "id",
    "type",
    "default",
    "unit",
}
_LANGUAGE = Path(__file__).parents[3] / "docs" / "schema" / "qlinkgen.schema.json"
_TYPE = re.compile(r"(?P<base>bytes|text|bcd|[a-z])(?P<bits>\d*)(?P<array>\[.*\])?")


def features(text: str) -> frozenset[str]:
    """The keys and kinds of types that occur in a schema, each with its place."""
    return frozenset(_walk(yaml.safe_load(text), "schema"))


def _walk(found: Any, place: str) -> Iterator[str]:
    if isinstance(found, list):
        for each in found:
            yield from _walk(each, place)
    elif isinstance(found, dict):
        for key, value in found.items():
            yield from _key(str(key), value, place)


def _key(key: str, value: Any, place: str) -> Iterator[str]:
    if key == "type" and isinstance(value, str):
        yield f"{place} {_kind(value)}"
    if key in _CHOSEN and not isinstance(value, dict | list):
        yield f"{place} {key} {value}"
    elif key not in _PLAIN and key in _keys():
        yield f"{place} {key}"
    inner = _NAMED.get(key)
    if key in _FREE:
        return
    if inner and isinstance(value, dict):
        for entry in value.values():
            yield from _walk(entry, inner)
    else:
        yield from _walk(value, place)


@functools.cache
def _keys() -> frozenset[str]:
    """The keys of the language."""

    def listed(found: Any) -> Iterator[str]:
        if isinstance(found, dict):
            properties = found.get("properties")
            yield from properties if isinstance(properties, dict) else ()
            found = list(found.values())
        for each in found if isinstance(found, list) else ():
            yield from listed(each)

    return frozenset(listed(json.loads(_LANGUAGE.read_text("utf-8"))))


def _kind(text: str) -> str:
    match = _TYPE.fullmatch(text)
    if match is None:
        return "named type"
    wide = "wide " if match["bits"] and match["base"] in "ui" and int(match["bits"]) > 64 else ""
    return f"{wide}{match['base']}{'[]' if match['array'] and match['base'] not in ('bytes', 'text') else ''}"


@dataclass(frozen=True)
class Cover:
    """Seeds whose schemas have every pair of features that occurs in any candidate."""

    seeds: Sequence[int]
    features: int
    possible: int
    found: int

    @property
    def text(self) -> str:
        """The figures."""
        return (
            f"{self.features} features, {self.possible} pairs of them; {self.found} occur in the candidates, "
            f"all of them in {len(self.seeds)} schemas"
        )


def cover(candidates: Mapping[int, str]) -> Cover:
    """Choose seeds, each time the one whose schema has the most pairs that are still missing."""
    kinds = {seed: features(text) for seed, text in candidates.items()}
    every = sorted(set().union(*kinds.values()))
    pairs = {pair: 1 << number for number, pair in enumerate(itertools.combinations(every, 2))}
    masks = {
        seed: sum(pairs[pair] for pair in itertools.combinations(sorted(found), 2))
        for seed, found in kinds.items()
    }
    missing = found = 0
    for mask in masks.values():
        missing |= mask
    found = missing.bit_count()
    seeds: list[int] = []
    while missing:
        best = max(masks, key=lambda seed: (masks[seed] & missing).bit_count())
        seeds.append(best)
        missing &= ~masks.pop(best)
    return Cover(sorted(seeds), len(every), len(pairs), found)
