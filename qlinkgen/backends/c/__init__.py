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

__all__ = ["generate", "header_of"]


def generate(protocol: Protocol, options: Options) -> Outputs:
    """The header of a protocol."""
    return {f"c/{file_stem(protocol.name)}.h": header_of(protocol, options).text()}


def header_of(protocol: Protocol, options: Options) -> Header:
    """The header of a protocol, not yet as text."""
    return Header(plan_of(protocol, options), _templates())


@functools.cache
def _templates() -> jinja2.Environment:
    return environment(__name__)
