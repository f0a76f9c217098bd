"""Conformance kits: a C program for each protocol that tests a header with the vectors, on any target.

It prints TAP and needs only the header. The receiver of the plan determines the expected events of a stream.
Names of the header and vectors are passed as arguments, because back-ends do not depend on each other:
``generate(protocol, options, sources)``.
"""

from __future__ import annotations

import functools

import jinja2

from qlinkgen.backends.base import Options, Outputs
from qlinkgen.backends.conformance.kit import Kit
from qlinkgen.backends.conformance.sources import Header, Sources
from qlinkgen.backends.templates import environment
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
