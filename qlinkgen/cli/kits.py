"""Collects the inputs of conformance kits from the other back-ends, which do not import one another."""

from __future__ import annotations

import json
from decimal import Decimal

from qlinkgen.backends import conformance, vectors
from qlinkgen.backends.base import Options, Outputs
from qlinkgen.backends.c.interface import interface
from qlinkgen.backends.conformance import Sources
from qlinkgen.cli import hand_vectors
from qlinkgen.model.protocol import Protocol


def generate(protocol: Protocol, options: Options) -> Outputs:
    """Generate the kit of a protocol."""
    (text,) = vectors.generate(protocol, options).values()
    return of_vectors(protocol, options, text)


def of_vectors(protocol: Protocol, options: Options, text: str) -> Outputs:
    """Generate the kit of a protocol whose vectors have been generated."""
    sources = Sources(interface(protocol), json.loads(text, parse_float=Decimal), by_hand(protocol))
    return conformance.generate(protocol, options, sources)


def by_hand(protocol: Protocol) -> hand_vectors.Vectors:
    """Return the hand-written vectors of a shipped protocol.

    Another schema of the same name, or another checksum, has none: the bytes are those of the shipped
    protocol.
    """
    from qlinkgen.schema import find, load  # noqa: PLC0415  # pydantic is slow to import

    if not hand_vectors.file_of(protocol).is_file() or protocol != load(find(protocol.name)):
        return {}
    return hand_vectors.read(protocol)
