"""Live structures: the evaluated tree. Only this module imports construct, when it is called."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from decimal import Decimal

from qlinkgen.backends.construct.module import definitions
from qlinkgen.backends.construct.tree import Value, evaluate
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import Options, plan_of

_NONE: Mapping[str, Value] = {}


class Live:
    """The definitions of a generated module, with methods for its use as a reference.

    Attributes:
        names: the definitions by their names in the source.
        messages: payload structures by full name.
        frames: frame structures by direction.
    """

    def __init__(self, names: Mapping[str, Value]) -> None:
        self.names = names
        self.messages: Mapping[str, Value] = names["MESSAGES"]
        known = {"request": "REQUEST_FRAME", "response": "RESPONSE_FRAME", "message": "FRAME"}
        self.frames = {direction: names[name] for direction, name in known.items() if name in names}

    def payload(
        self, message: str, fields: Mapping[str, Value], beside: Mapping[str, Value] = _NONE
    ) -> bytes:
        """The payload of a message, with defaults for missing fields and missing values of its frame."""
        frame = next((each for each in self.frames.values() if message in each.by_name), None)
        known = self.messages[message]
        decided = frame.decided(known, beside) if known.decided_by and frame is not None else {}
        return bytes(known.build(fields, decided=decided))

    def wrap(
        self, message: str, payload: bytes, address: int = 0, request: bytes = b"", number: int | None = None
    ) -> bytes:
        """A frame around a payload, which is not checked; ``number`` replaces the message id."""
        frame = next(each for each in self.frames.values() if message in each.by_name)
        return bytes(frame.wrap(self.messages[message], payload, address, request, number))

    def parse(self, direction: str, wire: bytes, request: bytes = b"") -> Value:
        """Message, address and fields of exactly one frame. Raises construct's ConstructError."""
        return self.frames[direction].parse(wire, request=request)


def live(protocol: Protocol, options: Options | None = None) -> Live:
    """The structures of a protocol."""
    own = (
        "_fields",
        "_frames",
        "_frecords",
        "_ftexts",
        "_ftrimmed",
        "_fvaried",
        "_ffilled",
        "_fwalks",
        "_packed",
        "_ended",
        "_fasked",
        "_fconditional",
        "_kinds",
        "_fended",
        "_fpresent",
    )
    modules = ("construct", *(f"{__package__}.{name}" for name in own))
    names: dict[str, Value] = {"Decimal": Decimal, "float": float}
    for module in modules:
        names |= vars(importlib.import_module(module))
    return Live(evaluate(definitions(plan_of(protocol, options)), names))
