"""The registry of targets: the one place that knows every back-end, so that none has to know another."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass

from qlinkgen.backends.base import Options, Outputs
from qlinkgen.model.protocol import Protocol

Generate = Callable[[Protocol, Options], Outputs]


@dataclass(frozen=True, slots=True)
class Target:
    """What can be generated.

    Attributes:
        name: word behind ``--target``.
        summary: what it is, for help texts.
        module: where its `generate` is; imported when it is asked for.
    """

    name: str
    summary: str
    module: str

    def load(self) -> Generate:
        """Import the module."""
        generate: Generate = importlib.import_module(self.module).generate
        return generate


TARGETS = {
    target.name: target
    for target in (
        Target("python", "typed module, standard library only", "qlinkgen.backends.python"),
        Target("bus", "typed calls of masters and handlers of slaves", "qlinkgen.backends.python.bus"),
        Target("c", "self-contained C99 header", "qlinkgen.backends.c"),
        Target("construct", "structures for the construct library", "qlinkgen.backends.construct"),
        Target("vectors", "test vectors as JSON", "qlinkgen.backends.vectors"),
        Target(
            "conformance",
            "C program that holds a header against the vectors, on any target",
            "qlinkgen.cli.kits",
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
