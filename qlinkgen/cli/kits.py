"""What conformance kits are made of, gathered from the other back-ends: no back-end knows another."""

from __future__ import annotations

import importlib
import json
from collections.abc import Callable, Mapping, Sequence
from decimal import Decimal
from typing import Any

from qlinkgen.backends import conformance
from qlinkgen.backends.base import Options, Outputs
from qlinkgen.backends.conformance import Heard, Sources
from qlinkgen.cli import hand_vectors
from qlinkgen.model.message import Direction
from qlinkgen.model.protocol import Protocol

Generate = Callable[[Protocol, Options], Outputs]


def generate(protocol: Protocol, options: Options, vectors: Generate) -> Outputs:
    """The kit of a protocol; ``vectors`` writes its vectors as JSON."""
    return conformance.generate(protocol, options, sources(protocol, options, vectors))


def sources(protocol: Protocol, options: Options, vectors: Generate) -> Sources:
    """Everything that the kit of a protocol is made of."""
    (text,) = vectors(protocol, options).values()
    header = importlib.import_module("qlinkgen.backends.c.interface").interface(protocol)
    # Both sides listen: what a stream brings does not depend on who is left out.
    python = importlib.import_module("qlinkgen.backends.python")
    module = python.load(protocol, Options(only=options.only))
    return Sources(
        header=header,
        generated=json.loads(text, parse_float=Decimal),
        by_hand=by_hand(protocol),
        listen=lambda direction: _Listener(protocol, module, direction),
    )


def by_hand(protocol: Protocol) -> Mapping[str, Any]:
    """The vectors that people worked out for a shipped protocol.

    There are none for another schema that uses its name, or where another checksum was set: their bytes are
    those of the shipped one.
    """
    from qlinkgen.schema import find, load  # noqa: PLC0415  # pydantic takes a while

    if not hand_vectors.file_of(protocol).is_file() or protocol != load(find(protocol.name)):
        return {}
    return hand_vectors.read(protocol)


class _Listener:
    """The stream decoder of generated Python."""

    def __init__(self, protocol: Protocol, module: Any, direction: Direction) -> None:
        alone = protocol.directions == ("message",)
        self._decoder = module.StreamDecoder() if alone else module.StreamDecoder(direction)
        self._fault = module.Fault
        self._address = protocol.address_name

    def feed(self, data: bytes) -> Sequence[Heard]:
        return self._heard(self._decoder.feed(data))

    def finish(self) -> Sequence[Heard]:
        return self._heard(self._decoder.finish())

    def _heard(self, events: Sequence[Any]) -> list[Heard]:
        return [
            Heard(event.kind) if isinstance(event, self._fault) else self._intact(event) for event in events
        ]

    def _intact(self, message: Any) -> Heard:
        address = getattr(message, self._address) if self._address else 0
        return Heard("", message.NAME, address, message.to_bytes())
