"""C headers: a self-contained C99 header for each protocol."""

from __future__ import annotations

import functools

import jinja2

from qlinkgen.backends.base import Outputs
from qlinkgen.backends.c.header import Header
from qlinkgen.backends.templates import environment
from qlinkgen.model.naming import file_stem
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import Options, plan_of

__all__ = ["generate"]


def generate(protocol: Protocol, options: Options) -> Outputs:
    """The header of a protocol."""
    return {f"c/{file_stem(protocol.name)}.h": Header(plan_of(protocol, options), _templates()).text()}


@functools.cache
def _templates() -> jinja2.Environment:
    return environment(__name__)
