"""What an engine needs of a generated module: any protocol of the master/slave kind will do."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from operator import attrgetter
from typing import Any, ClassVar, Protocol


class Message(Protocol):
    """A message of a generated module."""

    NAME: ClassVar[str]
    MAX_WIRE_SIZE: ClassVar[int]
    #: Name of the attribute that holds the address, "" where frames have none.
    ADDRESS: ClassVar[str]

    def to_frame(self) -> bytes:
        """Return the whole frame as it is on the wire."""
        ...


class Module(Protocol):
    """A generated module of any protocol, such as `qlinkgen.codecs.mc1231a`."""

    @property
    def COMMANDS(self) -> Mapping[str, Any]:  # noqa: N802  # as the generated module has it
        """Transactions by name."""
        ...

    @property
    def BUS(self) -> Any:  # noqa: N802
        """Who is on the line, and how fast it is."""
        ...

    @property
    def StreamDecoder(self) -> Callable[[Any], Any]:  # noqa: N802
        """Receiver of one direction."""
        ...

    @property
    def DecodeError(self) -> type[Exception]:  # noqa: N802
        """What a decoder raises."""
        ...


class Codec(Module, Protocol):
    """A generated module whose messages have frames of their own, or its `Codec` with another CRC."""

    def encode(self, message: Any) -> bytes:
        """Return the whole frame of a message as it is on the wire."""
        ...


def address_of(message: Any) -> int | None:
    """Return the address in a message's frame, None where frames have none."""
    name = type(message).ADDRESS
    return getattr(message, name) if name else None


def address_getter(codec: Codec) -> Callable[[Any], int | None]:
    """Return the quick form of `address_of` for the messages of one protocol."""
    name = next(iter(codec.COMMANDS.values())).request.ADDRESS
    return attrgetter(name) if name else lambda _message: None


def answers(command: Any, request: Any, response: Any) -> bool:
    """Whether a response is of the right shape for a request and repeats what it has to repeat."""
    return type(response) is command.response and all(
        getattr(response, name) == getattr(request, name) for name in command.echoes
    )


def addresses_that_answer(command: Any, request: Any, bus: Any) -> Sequence[int | None]:
    """Return the addresses from which an answer to a request may come; none where nothing answers."""
    if command.response is None:
        return ()
    asked = address_of(request)
    if asked is None or asked != bus.broadcast:
        return (asked,)
    if command.addressing == "answered_broadcast":
        return range(bus.first_node, bus.last_node + 1)
    return ()
