"""The registry of targets: the only module that imports every back-end."""

from __future__ import annotations

import importlib
from collections.abc import Callable

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.base import Options, Outputs
from qlinkgen.model.protocol import Protocol

Generate = Callable[[Protocol, Options], Outputs]


@dataclass(frozen=True, slots=True)
class Target:
    """A kind of output.

    Attributes:
        name: argument of ``--target``.
        summary: description for help texts.
        module: module of its `generate`, imported on use.
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
        Target(
            "master", "non-blocking master in C, beside the header of target c", "qlinkgen.backends.c.master"
        ),
        Target("construct", "structures for the construct library", "qlinkgen.backends.construct"),
        Target("vectors", "test vectors as JSON", "qlinkgen.backends.vectors"),
        Target(
            "conformance",
            "C program that tests a header against the vectors, on any target",
            "qlinkgen.cli.kits",
        ),
    )
}

#: Default targets. A conformance kit is large, and needed only once for each new platform; a master in C does
#: not exist for every schema.
DEFAULT = tuple(name for name in TARGETS if name not in {"conformance", "master"})


#: Generated parts of docs/; only in the project's own repository.
REFERENCE = "reference"


def reference_outputs() -> Outputs:
    """Generate the documentation of the schema language: rules, JSON Schema; paths below the repository."""
    documents = importlib.import_module("qlinkgen.schema.documents")
    outputs: Outputs = documents.outputs()
    return outputs
