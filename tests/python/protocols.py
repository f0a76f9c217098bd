"""The protocols of the tests: shipped ones and those in tests/schemas, each with its generated module."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

from qlinkgen.backends.python import load as load_module
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.values import default_of
from qlinkgen.schema import find, load

SHIPPED = ("qlink", "trio", "mc1231a")
FOR_TESTS = ("modbus_rtu", "dynamixel", "kitchen_sink")
EVERY = SHIPPED + FOR_TESTS

_SCHEMAS = Path(__file__).parent.parent / "schemas"


@functools.cache
def protocol(name: str) -> Protocol:
    """The model of a protocol."""
    return load(find(name)) if name in SHIPPED else load(_SCHEMAS / f"{name}.yaml")


@functools.cache
def module(name: str) -> Any:
    """The generated module of a protocol, compiled in memory."""
    return load_module(protocol(name))


def text_of(name: str) -> str:
    """The text of a test schema, for tests that change it."""
    return (_SCHEMAS / f"{name}.yaml").read_text("utf-8")


def defaults(name: str, message: Message) -> dict[str, Any]:
    """All arguments of the class of a message, with defaults of the model."""
    arguments: dict[str, Any] = {value.name: default_of(value) for value in message.values}
    address = protocol(name).address_name
    return arguments | ({address: message.default_address} if address and message.addresses else {})


def build(name: str, message: Message, /, **changes: Any) -> Any:
    """A message object with changed defaults."""
    return module(name).MESSAGES[message.name](**defaults(name, message) | changes)


def wire_of(name: str, message: Message, built: Any) -> bytes:
    """The whole frame of a message object; the request of a packet response has all defaults."""
    if name == "mc1231a" and message.direction == "response":
        return bytes(built.to_frame(request_for(name, message)))
    return bytes(built.to_frame())


def request_for(name: str, message: Message) -> Any:
    """The request of a response, with all defaults."""
    return build(name, protocol(name).by_name[f"{message.command}.request"])


def decode(name: str, message: Message, wire: bytes) -> Any:
    """The generated decoder for the direction of a message."""
    codec = module(name)
    if message.direction == "message" and hasattr(codec, "decode"):
        return codec.decode(wire)
    if message.direction == "response":
        return (
            codec.decode_response(wire, request_for(name, message))
            if name == "mc1231a"
            else codec.decode_response(wire)
        )
    return codec.decode_request(wire)


def stream(name: str, direction: str) -> Any:
    """A stream decoder for a direction."""
    codec = module(name)
    return (
        codec.StreamDecoder() if protocol(name).directions == ("message",) else codec.StreamDecoder(direction)
    )


def directions(name: str) -> tuple[str, ...]:
    """Directions that a stream decoder can decode without `expect`."""
    if name == "mc1231a":
        return ("request",)
    return protocol(name).directions
