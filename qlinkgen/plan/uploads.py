"""How a program is sent to a node in pieces, derived from the commands of a protocol."""

from __future__ import annotations

from dataclasses import dataclass

from qlinkgen.model.fields import Value
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.transaction import Command
from qlinkgen.model.types import Blob, Scalar


class NoUpload(ValueError):
    """No command takes a program in pieces; the text says what is missing, and the key that says it."""


@dataclass(frozen=True)
class Upload:
    """A command that takes a program in numbered pieces.

    Attributes:
        command: the command.
        data: field of its request that carries a piece.
        counter: field that numbers the pieces.
        numbers: how many numbers there are, from 0; after the last one, 0 follows.
        piece: most bytes of a piece.
        opened: a request without data comes first.
    """

    command: Command
    data: str
    counter: str
    numbers: int
    piece: int
    opened: bool


def upload_of(protocol: Protocol, name: str = "") -> Upload:
    """Return how a program is loaded: by this command, or by the only one that can.

    A request carries a piece in its only field of bytes, and numbers it by the counter that `repeat` names,
    so that a node does not store a repeated piece twice. Other values have defaults. If the request may be
    empty, an empty one starts the load.

    Raises:
        NoUpload: no command can, several can, or the named one cannot.
        KeyError: no command has that name.
    """
    if name:
        chosen = next((each for each in protocol.commands if each.name == name), None)
        if chosen is None:
            raise KeyError(name)
        return _upload(chosen)
    carrying = [each for each in protocol.commands if _pieces_in(each)]
    if not carrying:
        raise NoUpload(
            f"{protocol.name} has no command whose request carries a piece of a program; "
            'give one a field of bytes, such as data: {type: "bytes[0..32]"}, and a counter that '
            "repeat: {counter: FIELD} names"
        )
    found, faults = [], []
    for command in carrying:
        try:
            found.append(_upload(command))
        except NoUpload as fault:
            faults.append(fault)
    if not found:
        raise faults[0]
    if len(found) > 1:
        names = ", ".join(each.command.name for each in found)
        raise NoUpload(
            f"{protocol.name} has several commands that take a program in pieces; choose of {names}"
        )
    return found[0]


def _upload(command: Command) -> Upload:
    carried = _pieces_in(command)
    if len(carried) != 1:
        seen = f"{len(carried)} fields of bytes" if carried else "no field of bytes"
        raise NoUpload(
            f"{command.request.name} has {seen}, and a piece of a program is in one; "
            'write one field such as data: {type: "bytes[0..32]"}'
        )
    ((data, blob),) = carried
    if command.response is None or command.steps or command.many is not None or command.asker == "second":
        raise NoUpload(
            f"{command.name} does not answer each request once, and each piece of a program is acknowledged; "
            "give it a response, such as response: {}"
        )
    counter = _counter(command)
    if blob.length.minimum > 1:
        raise NoUpload(
            f"{command.request.name}: {data.name} has at least {blob.length.minimum} bytes, and the last "
            f"piece of a program may have one; write bytes[0..{blob.length.maximum}]"
        )
    needed = [each.name for each in command.request.values if each.required]
    if others := sorted({*needed} - {data.name, counter.name}):
        raise NoUpload(
            f"{command.request.name}: {', '.join(others)} has no default, and a piece is only data and "
            "counter; write default: VALUE"
        )
    opened = command.request.empty_is_default and blob.length.minimum == 0
    numbers = counter.type.maximum + 1 if isinstance(counter.type, Scalar) else 0
    return Upload(command, data.name, counter.name, numbers, blob.length.maximum, opened)


def _counter(command: Command) -> Value:
    """Return the value that numbers the requests."""
    name = command.repeat.counter
    found = next((each for each in command.request.values if each.name == name), None)
    if found is None or not isinstance(found.type, Scalar):
        raise NoUpload(
            f"{command.name} does not say which field numbers its requests, so a node may store a repeated "
            "piece twice; write repeat: {counter: FIELD}, with a field of its request"
        )
    if found.type.minimum != 0 or found.type.scaling is not None:
        raise NoUpload(
            f"{command.request.name}: {name} does not count 0, 1, 2..; write a type such as u8, without "
            "range and scale"
        )
    return found


def _pieces_in(command: Command) -> list[tuple[Value, Blob]]:
    """Return the values of a request that can carry a piece."""
    values = [(each, each.type) for each in command.request.values]
    return [(each, kind) for each, kind in values if isinstance(kind, Blob) and not kind.text]
