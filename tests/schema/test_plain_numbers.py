"""Numbers of the model are plain: how a number was written in the file stays in the file's model."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from qlinkgen.schema import find, library, loads, shipped
from tests.support.whole.schemas import generate


def written(node: object, path: str, seen: set[int]) -> Iterator[str]:
    """The places of integers of another class; truth values are among what a schema may say."""
    if isinstance(node, int) and type(node) not in {int, bool}:
        yield f"{path}: {type(node).__name__}"
    if id(node) in seen:
        return
    seen.add(id(node))
    if dataclasses.is_dataclass(node):
        for field in dataclasses.fields(node):
            yield from written(getattr(node, field.name), f"{path}.{field.name}", seen)
    elif isinstance(node, Mapping):
        for key, value in node.items():
            yield from written(key, f"{path}[key]", seen)
            yield from written(value, f"{path}[{key}]", seen)
    elif isinstance(node, list | tuple | set | frozenset):
        for place, item in enumerate(node):
            yield from written(item, f"{path}[{place}]", seen)


@pytest.mark.parametrize("name", [*shipped(), *library()])
def test_of_schemas_in_the_package(name: str) -> None:
    protocol, _ = loads(Path(find(name)).read_text(encoding="utf-8"), str(find(name)))
    assert list(written(protocol, name, set())) == []


def test_of_random_schemas() -> None:
    accepted = 0
    for seed in range(60):
        protocol, _ = loads(generate(seed), "random.yaml")
        accepted += protocol is not None  # lint refuses a few
        assert list(written(protocol, f"seed {seed}", set())) == []
    assert accepted >= 40
