"""What an engine needs of a generated module: any protocol of the master/slave kind will do.

The classes of a generated module are its own, and so are those of the support module beside it; here they are
known by their shape.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from operator import attrgetter
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Protocol, Self

if TYPE_CHECKING:
    from typing_extensions import TypeIs


class Message(Protocol):
    """A message of a generated module."""

    NAME: ClassVar[str]
    ID: ClassVar[int]
    MAX_SIZE: ClassVar[int]
    MAX_WIRE_SIZE: ClassVar[int]
    #: Name of the attribute that holds the address, "" where frames have none.
    ADDRESS: ClassVar[str]

    @property
    def FIELDS(self) -> tuple[str, ...]:  # noqa: N802  # as the generated module has it
        """Names of the fields, in wire order."""
        ...

    def to_bytes(self) -> bytes:
        """Return the payload alone."""
        ...

    @classmethod
    def from_bytes(cls, payload: bytes, /) -> Self:
        """Return the message of a payload."""
        ...


class Framed(Message, Protocol):
    """A message whose frame depends on nothing else: all but the answers of a host's device."""

    def to_frame(self) -> bytes:
        """Return the whole frame as it is on the wire."""
        ...


class Fault(Protocol):
    """Bytes that are not a message."""

    @property
    def kind(self) -> str:
        """Kind as in the module's DecodeError."""
        ...

    @property
    def offset(self) -> int:
        """Place of its first byte in the stream."""
        ...

    @property
    def raw(self) -> bytes:
        """The bytes themselves."""
        ...

    @property
    def message(self) -> str:
        """What is wrong with them, for people."""
        ...


class Bus(Protocol):
    """The line and its nodes; None where the protocol has no address, or its document names no speed."""

    first_node: int | None
    last_node: int | None
    broadcast: int | None
    baud: int | None
    bits_per_byte: int


class Command(Protocol):
    """A transaction of a generated module."""

    name: str
    addressing: str
    response_byte_times: float
    response_seconds: float
    repeat_safe: bool
    echoes: tuple[str, ...]

    @property
    def request(self) -> type[Framed]:
        """Class of the request."""
        ...

    @property
    def response(self) -> type[Message] | None:
        """Class of the response, None where nothing answers."""
        ...


class DecoderCounters(Protocol):
    """What a receiver has counted."""

    skipped: int


class Decoder(Protocol):
    """The receiver of one direction."""

    @property
    def counters(self) -> DecoderCounters:
        """Counts so far."""
        ...

    def feed(self, data: bytes, /) -> Sequence[Framed | Fault]:
        """Take the next bytes of the stream; return what they complete."""
        ...

    def finish(self) -> Sequence[Framed | Fault]:
        """Return what is left when the stream ends."""
        ...


class Module(Protocol):
    """A generated module of any protocol, such as `qlinkgen.codecs.mc1231a`."""

    @property
    def COMMANDS(self) -> Mapping[str, Command]:  # noqa: N802  # as the generated module has it
        """Transactions by name."""
        ...

    @property
    def BUS(self) -> Bus:  # noqa: N802
        """Who is on the line, and how fast it is."""
        ...

    @property
    def DecodeError(self) -> type[Exception]:  # noqa: N802
        """What a decoder raises."""
        ...


class Encoder(Protocol):
    """What makes frames of the messages of one protocol."""

    # Any: each protocol encodes messages of its own class, and no type but Any is every one of them.
    def encode(self, message: Any, /) -> bytes:
        """Return the whole frame of a message as it is on the wire."""
        ...


class Codec(Module, Encoder, Protocol):
    """A generated module whose messages have frames of their own, or its `Codec` with another CRC."""

    @property
    def StreamDecoder(self) -> Callable[[Literal["request", "response"]], Decoder]:  # noqa: N802
        """Receiver of one direction."""
        ...


def is_message(event: Framed | Fault) -> TypeIs[Framed]:
    """Whether an event of a decoder is a message."""
    return hasattr(event, "to_frame")


def address_of(message: Message) -> int | None:
    """Return the address in a message's frame, None where frames have none."""
    name = type(message).ADDRESS
    return getattr(message, name) if name else None


def address_getter(codec: Codec) -> Callable[[Message], int | None]:
    """Return the quick form of `address_of` for the messages of one protocol."""
    name = next(iter(codec.COMMANDS.values())).request.ADDRESS
    return attrgetter(name) if name else lambda _message: None


def answers(command: Command, request: Message, response: Message) -> bool:
    """Whether a response is of the right shape for a request and repeats what it has to repeat."""
    return type(response) is command.response and all(
        getattr(response, name) == getattr(request, name) for name in command.echoes
    )


def addresses_that_answer(command: Command, request: Message, bus: Bus) -> Sequence[int | None]:
    """Return the addresses from which an answer to a request may come; none where nothing answers."""
    if command.response is None:
        return ()
    asked = address_of(request)
    if asked is None or asked != bus.broadcast:
        return (asked,)
    if command.addressing == "answered_broadcast":
        assert bus.first_node is not None
        assert bus.last_node is not None
        return range(bus.first_node, bus.last_node + 1)
    return ()
