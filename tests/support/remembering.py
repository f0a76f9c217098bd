"""Remembers schemas and codecs that tests read and generate over and over in one process."""

from __future__ import annotations

import functools
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from types import CodeType
from typing import TypeVar

import pytest

from qlinkgen.backends import python
from qlinkgen.backends.python import module
from qlinkgen.errors import Fault
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import Plan
from qlinkgen.schema import loader

R = TypeVar("R")


@contextmanager
def remembering() -> Iterator[None]:
    """Read each schema, and print and compile the codec of each protocol, at most once in the block.

    A codec is made anew of its code each time, as it has a state.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(loader, "loads", _loads)
        patch.setattr(Protocol, "without_texts", _without_texts)
        patch.setattr(python, "render", _render)
        patch.setattr(python, "compile", _compile, raising=False)
        yield


_read = functools.lru_cache(maxsize=100)(loader.loads)
_strip = Protocol.without_texts
_print = module.render


def _loads(
    text: str, file: str, *, crc: str | None = None, version: str | None = None
) -> tuple[Protocol | None, list[Fault]]:
    protocol, faults = _read(text, file, crc=crc, version=version)
    return protocol, list(faults)


#: By the identity of a protocol, which is kept with the result so that no other one can get it.
_known: dict[tuple[int, Hashable], tuple[Protocol, object]] = {}


def _once(protocol: Protocol, what: Hashable, make: Callable[[], R]) -> R:
    if len(_known) > 200:
        _known.clear()
    kept, made = _known.get((id(protocol), what), (None, None))
    if kept is not protocol:
        made = make()
        _known[id(protocol), what] = protocol, made
    return made  # type: ignore[return-value]  # made for the same `what`


def _without_texts(protocol: Protocol) -> Protocol:
    return _once(protocol, "without texts", lambda: _strip(protocol))


def _render(plan: Plan, *, laid_out: bool = True) -> str:
    selected = plan.role, tuple(message.name for message in plan.messages), laid_out
    return _once(plan.protocol, selected, lambda: _print(plan, laid_out=laid_out))


@functools.lru_cache(maxsize=30)
def _compile(source: str, filename: str, mode: str) -> CodeType:
    code: CodeType = compile(source, filename, mode)
    return code
