"""Conformance kits: one C program for each protocol that holds a header against the vectors, on any target.

It prints TAP and needs nothing but the header. What a stream brings is what the plan's receivers say. The
header's names and the vectors are arguments, as back-ends do not know each other: ``generate(protocol,
options, sources)``.
"""

from __future__ import annotations

import functools

import jinja2

from qlinkgen.backends.base import Options, Outputs, environment
from qlinkgen.backends.conformance.kit import Kit
from qlinkgen.backends.conformance.sources import Header, Sources
from qlinkgen.model.naming import file_stem
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import plan_of

__all__ = ["Header", "Sources", "generate"]


def generate(protocol: Protocol, options: Options, sources: Sources) -> Outputs:
    """The kit of a protocol: path below the output folder to text."""
    text = _template().render(vars(Kit(plan_of(protocol, options), sources).view()))
    return {f"conformance/{file_stem(protocol.name)}_conformance.c": text}


@functools.cache
def _template() -> jinja2.Template:
    return environment(__name__).get_template("templates/conformance.c.j2")
