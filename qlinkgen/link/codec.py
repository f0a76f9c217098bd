"""The interface of generated modules that the engines use.

Each generated module has its own classes, and its own support module; these protocols describe their common
shape.
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
    #: Name of the attribute with the address, "" for frames without one.
    ADDRESS: ClassVar[str]

    @property
    def FIELDS(self) -> tuple[str, ...]:  # noqa: N802  # as the generated module has it
        """Names of the fields, in wire order."""
        ...

    def to_bytes(self) -> bytes:
        """Return the payload."""
        ...

    @classmethod
    def from_bytes(cls, payload: bytes, /) -> Self:
        """Return the message of a payload."""
        ...


class Framed(Message, Protocol):
    """A message with a frame of its own: all except the responses of packet protocols."""

    def to_frame(self) -> bytes:
        """Return the whole frame as on the wire."""
        ...


class Fault(Protocol):
    """Bytes that are not a message."""

    @property
    def kind(self) -> str:
        """Kind as in the module's DecodeError."""
        ...

    @property
    def offset(self) -> int:
        """Offset of its first byte in the stream."""
        ...

    @property
    def raw(self) -> bytes:
        """The bytes themselves."""
        ...

    @property
    def message(self) -> str:
        """Description of the fault."""
        ...


class Bus(Protocol):
    """The line and its nodes; None for a missing address, or a speed that the document does not state."""

    kind: str
    first_node: int | None
    last_node: int | None
    broadcast: int | None
    baud: int | None
    bits_per_byte: int


class OtherReply(Protocol):
    """An answer other than the response, of a generated module."""

    means: str
    switch: str
    cases: tuple[tuple[int, int, str], ...]
    within: tuple[float, float] | None
    after: tuple[float, float]
    echoes: Mapping[str, str | int]

    @property
    def message(self) -> type[Framed]:
        """Class of the message."""
        ...

    def meaning(self, reply: Any, /) -> str:  # Any: a message of the class
        """What a reply means: refused, again, pending or done."""
        ...


#: Byte times and seconds.
StepSpan = tuple[float, float]


class Many(Protocol):
    """The end of several answers to one request, of a generated module."""

    count: int
    counted_by: str
    until: tuple[str, int, int] | None
    within: tuple[float, float] | None

    @property
    def reply(self) -> type[Framed] | None:
        """Class of the reply that follows the last answer."""
        ...


class EachOf(Many, Protocol):
    """Each node in a list of the request sends an answer."""

    each: str
    key: str
    by: str


class UntilStopped(Many, Protocol):
    """Answers come until another command stops them."""

    stopped_by: str
    repeats: tuple[str, ...]
    next_within: StepSpan | None


class Command(Protocol):
    """A transaction of a generated module."""

    name: str
    addressing: str
    response_byte_times: float
    response_seconds: float
    repeat_safe: bool
    echoes: Mapping[str, str | int]
    sizes: tuple[tuple[str, str, int], ...]

    @property
    def request(self) -> type[Framed]:
        """Class of the request."""
        ...

    @property
    def response(self) -> type[Message] | None:
        """Class of the response, None for a command without a response."""
        ...

    @property
    def sized_by(self) -> type[Framed]:
        """Class of the frame that has the sizes of the response, which is the request or a step."""
        ...

    @property
    def many(self) -> Many | None:
        """The end of several answers, None if there is one."""
        ...

    @property
    def steps(self) -> Sequence[tuple[str, type[Framed], StepSpan | None]]:
        """Frames of a dialogue after its request: send or receive, class, and time limit."""
        ...

    @property
    def replies(self) -> Mapping[type[Message], OtherReply]:
        """Answers other than the response, by class."""
        ...


class DecoderCounters(Protocol):
    """Counts of a receiver."""

    skipped: int


class Decoder(Protocol):
    """The receiver of one direction."""

    @property
    def counters(self) -> DecoderCounters:
        """Counts so far."""
        ...

    def feed(self, data: bytes, /) -> Sequence[Framed | Fault]:
        """Take the next bytes of the stream; return the events that they complete."""
        ...

    def finish(self) -> Sequence[Framed | Fault]:
        """End the stream; return the remaining events."""
        ...


class Module(Protocol):
    """A generated module of any protocol, such as `qlinkgen.codecs.mc1231a`."""

    @property
    def COMMANDS(self) -> Mapping[str, Command]:  # noqa: N802  # as the generated module has it
        """Transactions by name."""
        ...

    @property
    def BUS(self) -> Bus:  # noqa: N802
        """Nodes and speed of the line."""
        ...

    @property
    def DecodeError(self) -> type[Exception]:  # noqa: N802
        """The error of a decoder."""
        ...


class Encoder(Protocol):
    """Encodes the messages of one protocol."""

    def encode(self, message: Any, /) -> bytes:  # Any: a message of its own protocol
        """Return the whole frame of a message as on the wire."""
        ...


class Codec(Module, Encoder, Protocol):
    """A generated module whose messages have their own frames, or its `Codec` with another CRC."""

    @property
    def StreamDecoder(self) -> Callable[[Literal["request", "response"]], Decoder]:  # noqa: N802
        """Receiver of one direction."""
        ...


def is_message(event: Framed | Fault) -> TypeIs[Framed]:
    """Whether an event of a decoder is a message."""
    return hasattr(event, "to_frame")


def address_of(message: Message) -> int | None:
    """Return the address of a message, None for frames without one."""
    name = type(message).ADDRESS
    return getattr(message, name) if name else None


def address_getter(codec: Codec) -> Callable[[Message], int | None]:
    """Return a fast `address_of` for the messages of one protocol."""
    commands = codec.COMMANDS.values()
    names = {
        kind.ADDRESS for each in commands for kind in (each.request, each.response, *each.replies) if kind
    }
    if len(names) > 1:  # some kinds of frame have none
        return address_of
    (name,) = names
    return attrgetter(name) if name else lambda _message: None


def reason_of(reply: OtherReply, command: Command, message: Message) -> str:
    """Return why a node refuses: the field of the response that says so, or all fields of another reply."""
    return text_of(message, [reply.switch] if reply.message is command.response else message.FIELDS)


def text_of(message: Message, names: Sequence[str]) -> str:
    """Return fields of a message as text; a single field without its name, no fields as the message."""
    values = {name: getattr(message, name) for name in names if name}
    texts = {name: getattr(value, "name", "") or repr(value) for name, value in values.items()}
    if len(texts) == 1:
        return str(*texts.values()).lower()
    return ", ".join(f"{name} {text.lower()}" for name, text in texts.items()) or message.NAME


def meanings(reply: OtherReply) -> set[str]:
    """Everything that a reply can mean."""
    return {reply.means, *(means for _, _, means in reply.cases)}


def wrong_size(command: Command, asked: Message, response: Message, *, received: bool = True) -> str:
    """Return the first field of a response with another number of items than a frame says, "" if none.

    ``asked`` is the last frame that may say it: others say nothing.
    A received row of bits, of which only the bytes are counted, has the number of items that fit them.
    """
    if type(asked) is not command.sized_by:
        return ""
    for name, number_name, bits in command.sizes:
        items, number = len(getattr(response, name)), getattr(asked, number_name)
        if items != number and not (received and bits and items == 8 * ((bits * number + 7) // 8) // bits):
            return name
    return ""


def cut(command: Command, asked: Message, response: Message) -> None:
    """Reduce received rows of bits to the number of items that ``asked`` says, as in `wrong_size`."""
    told = type(response) is command.response and type(asked) is command.sized_by
    for name, number_name, bits in command.sizes if told else ():
        if bits:
            setattr(response, name, getattr(response, name)[: getattr(asked, number_name)])


def missized(response: Message, name: str, command: Command, asked: Message) -> str:
    """Describe a field of a response with a wrong number of items."""
    number_name = next(number for field, number, _ in command.sizes if field == name)
    frame = "the request" if command.sized_by is command.request else asked.NAME
    return (
        f"{response.NAME}: {name} has {len(getattr(response, name))} items; "
        f"{number_name} of {frame} asks for {getattr(asked, number_name)}"
    )


#: What fields of an answer repeat, by name: an attribute of the request, or a number.
Echoes = Mapping[str, str | int]


def repeats(echoes: Echoes, request: Message, response: Message) -> bool:
    """Whether an answer has what it repeats of a request."""
    for name, of in echoes.items():
        if getattr(response, name) != (getattr(request, of) if isinstance(of, str) else of):
            return False
    return True


def fill(echoes: Echoes, request: Message, response: Message) -> None:
    """Give an answer what it repeats of a request; a field that may be absent stays so."""
    for name, of in echoes.items():
        if getattr(response, name) is not None:
            setattr(response, name, getattr(request, of) if isinstance(of, str) else of)


class Proof(Protocol):
    """The check value of a response that covers bytes of its request, of a generated module."""

    field: str

    def compute(self, request: bytes, payload: bytes, /) -> int:
        """Return the value for the frame of a request and the payload of its response."""
        ...


def proof_of(command: Command) -> Proof | None:
    """The check value of the response to a command that covers its request, None without one."""
    return getattr(command, "proof", None)


def unproven(command: Command, request: Framed, response: Message) -> str:
    """Return what is wrong with the check value of a response that covers its request, "" if it is right."""
    proof = proof_of(command) if type(response) is command.response else None
    if proof is None:
        return ""
    seen, right = getattr(response, proof.field), proof.compute(request.to_frame(), response.to_bytes())
    return "" if seen == right else f"{response.NAME}: {proof.field}: received {seen:#x}, expected {right:#x}"


def prove(command: Command, request: Framed, response: Message) -> None:
    """Give a response the check value that covers its request."""
    if (proof := proof_of(command)) is not None and type(response) is command.response:
        setattr(response, proof.field, proof.compute(request.to_frame(), response.to_bytes()))


def echoes_of(command: Command, answer: type[Message]) -> Echoes | None:
    """What an answer of a class repeats, None if it does not answer the command."""
    if answer is command.response:
        return command.echoes
    reply = command.replies.get(answer)
    return None if reply is None else reply.echoes


def answers(command: Command, request: Message, asked: Message, response: Message) -> bool:
    """Whether an answer has a right class for a request, equal echoed fields and the sizes asked for.

    ``asked`` is the frame that may say the sizes, as in `wrong_size`.
    """
    sized = type(response) is command.response and bool(command.sizes)
    if sized and wrong_size(command, asked, response):
        return False
    echoes = echoes_of(command, type(response))
    return echoes is not None and repeats(echoes, request, response)


def addresses_that_answer(command: Command, request: Message, bus: Bus) -> Sequence[int | None]:
    """Return the addresses that may answer a request; empty for a request without a response."""
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
