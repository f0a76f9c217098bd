"""Codings in C."""

from __future__ import annotations

from pathlib import Path

from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from qlinkgen.schema import loads


def test_one_coding_may_apply_twice() -> None:
    """A helper of it is defined once."""
    text = (Path(__file__).parents[1] / "schemas/line.yaml").read_text("utf-8")
    twice = text.replace("[{pair: complement}, {digits: hex}]", "[{digits: hex}, {digits: hex}]")
    protocol, faults = loads(twice, "line.yaml")
    assert protocol is not None, faults
    header = "".join(c.generate(protocol, Options()).values())
    assert header.count("static inline int line_digit_(int byte)") == 1
