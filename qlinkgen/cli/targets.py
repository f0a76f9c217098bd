"""The registry of targets: the one place that knows every back-end, so that none has to know another."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from qlinkgen.backends.base import Options, Outputs
from qlinkgen.model.protocol import Protocol

Generate = Callable[[Protocol, Options], Outputs]


@dataclass(frozen=True, slots=True)
class Target:
    """What can be generated.

    Attributes:
        name: word behind ``--target``.
        summary: what it is, for help texts.
        load: imports the back-end and returns its `generate`.
    """

    name: str
    summary: str
    load: Callable[[], Generate]


def _backend(name: str) -> Any:
    return importlib.import_module(f"qlinkgen.backends.{name}")


def _plain(name: str) -> Generate:
    generate: Generate = _backend(name).generate
    return generate


def _vectors_of(protocol: Protocol, options: Options) -> Outputs:
    """The vectors take the encoder that makes their bytes as an argument; it is construct's."""
    outputs: Outputs = _backend("vectors").generate(protocol, options, _backend("construct").live(protocol))
    return outputs


def _vectors() -> Generate:
    return _vectors_of


def _conformance() -> Generate:
    """A kit holds the vectors, and is written against the header."""
    kits = importlib.import_module("qlinkgen.cli.kits")
    return partial(kits.generate, vectors=_vectors_of)


def _target(name: str, summary: str, backend: str = "") -> Target:
    return Target(name, summary, partial(_plain, backend or name))


TARGETS = {
    target.name: target
    for target in (
        _target("python", "typed module, standard library only"),
        _target("bus", "typed calls of masters and handlers of slaves", "python.bus"),
        _target("c", "self-contained C99 header"),
        _target("construct", "structures for the construct library"),
        Target("vectors", "test vectors as JSON", _vectors),
        Target(
            "conformance", "C program that holds a header against the vectors, on any target", _conformance
        ),
    )
}

#: What is made where no target is chosen. A conformance kit is large, and wanted once for each new target.
DEFAULT = tuple(name for name in TARGETS if name != "conformance")


#: Parts of docs/ that are made from the code; in the project's own repository alone.
REFERENCE = "reference"


def reference_outputs() -> Outputs:
    """Documentation of the schema language: rules, reference, JSON Schema; paths below the repository."""
    documents = importlib.import_module("qlinkgen.schema.documents")
    outputs: Outputs = documents.outputs()
    return outputs
