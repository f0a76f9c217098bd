"""``qlinkgen encode``: encode values as wire bytes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from types import ModuleType

import click

from qlinkgen._dataclass import dataclass
from qlinkgen.cli import jsonlines
from qlinkgen.cli.arguments import assignments_argument, message_argument, protocol_argument
from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.codec import MessageObject, build, load_codec
from qlinkgen.cli.common import (
    addressed,
    crc_option,
    find_message,
    load_protocol,
    parse_hex,
    version_option,
    warn_unconfirmed,
)
from qlinkgen.cli.describe import addresses_text
from qlinkgen.link.codec import prove
from qlinkgen.model.message import Message
from qlinkgen.model.naming import record_key
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.replacement import Replacement
from qlinkgen.model.values import Json, whole_number
from qlinkgen.plan.framing import frame_plan

address_option = click.option(
    "--node",
    "--address",
    "addresses",
    metavar="N",
    multiple=True,
    help="Destination of a request, source of a response; 0x numbers too.",
)
json_option = click.option(
    "--json",
    "object_",
    metavar="OBJECT",
    help='Values as JSON: \'{"counter": 1, "segments": [1, 2]}\', or a whole object printed by decode.',
)


@click.command("encode")
@protocol_argument
@message_argument
@assignments_argument
@address_option
@json_option
@click.option("--request", "request", metavar="HEX", help="The request of a response that depends on it.")
@crc_option
@version_option
def command(  # noqa: PLR0917  # click passes them by name
    protocol: str,
    message: str | None,
    assignments: tuple[str, ...],
    addresses: tuple[str, ...],
    object_: str | None,
    request: str | None,
    crc: Replacement | None,
    version: str | None,
) -> None:
    """Print the wire bytes of a message as lower-case hex, with length, checksum and stuffing.

    An omitted field has its default, if there is one; FIELD=VALUE overrides --json. An object printed by
    decode includes message and address: then MESSAGE may be omitted, and --node overrides the address.

    Bytes are hex, lists are separated by commas, enums are a name or number, flags a number or names
    separated by |, numbers may begin with 0x or 0b, scaled values are in their unit.

    \b
    qlinkgen encode qlink motion --node 3 counter=1 outputs=0x0F segments=100,200
    qlinkgen encode qlink motion.response --node 3 position=-5 motor_status='running|position_valid'
    qlinkgen encode trio direct_variable_transfer --address 2 number=7 value=-0.25
    qlinkgen encode mc1231a get_pos.response --request 4a value=1234567
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    loaded = load_protocol(protocol, crc, version)

    def load(wanted: Message) -> ModuleType:
        return load_codec(loaded, plain=crc is None, only=wanted.command or wanted.name)

    codec, found, built = compose(loaded, message, assignments, addresses, object_, load=load)
    try:
        click.echo(_frame(loaded, codec, found, built, request).hex())
    except codec.EncodeError as error:
        raise Failure(str(error)) from None


def compose(
    protocol: Protocol,
    message: str | None,
    assignments: tuple[str, ...],
    addresses: tuple[str, ...],
    object_: str | None,
    *,
    codec: ModuleType | None = None,
    load: Callable[[Message], ModuleType] | None = None,
) -> tuple[ModuleType, Message, MessageObject]:
    """Return the codec, the message of a command line, and the object with its values.

    Without ``codec``, the codec is made by ``load``, by default from the whole protocol.
    """
    if message and "=" in message:
        assignments, message = (message, *assignments), None
    record = _record(protocol, {} if object_ is None else jsonlines.parse_object(object_, "--json"))
    found = _message(protocol, message, record.message)
    given = {**record.fields, **_assigned(assignments)}
    address = _one(addresses) if addresses else record.address
    warn_unconfirmed(protocol, found)
    codec = codec or (load_codec(protocol) if load is None else load(found))
    return (
        codec,
        found,
        build(codec, found, given, _address(protocol, found, address), protocol.beside(found)),
    )


@dataclass(frozen=True, slots=True)
class _Record:
    """The argument of --json: only fields, or a whole object printed by decode."""

    fields: Mapping[str, Json]
    message: str | None = None
    address: str | None = None


#: What decode says of a message besides its values.
_ASIDE = ("refused", "request_seen", "offset", "time", "file")


def _record(protocol: Protocol, given: Mapping[str, Json]) -> _Record:
    beside = {record_key(value.name): value.name for value in protocol.frame_values}
    known = {
        "message",
        "fields",
        *_ASIDE,
        "node",
        "address",
        record_key(protocol.address_name or ""),
        *beside,
    }
    message, fields = given.get("message"), given.get("fields")
    if not (isinstance(message, str) and isinstance(fields, Mapping) and set(given) <= known):
        return _Record(given)
    others = ("message", "fields", *_ASIDE, *beside)
    addresses = [given[name] for name in given if name not in others]
    fields = {**{beside[key]: value for key, value in given.items() if key in beside}, **fields}
    return _Record(fields, message, _one(tuple(map(str, addresses))) if addresses else None)


def _message(protocol: Protocol, name: str | None, recorded: str | None) -> Message:
    wanted = name or recorded
    if wanted is None:
        raise click.UsageError("Missing argument 'MESSAGE'.", click.get_current_context())
    found = find_message(protocol, wanted)
    if recorded is not None and find_message(protocol, recorded) is not found:
        raise Failure(f"--json: the object is a {recorded}, not a {found.name}; change MESSAGE or omit it")
    return found


def _one(addresses: tuple[str, ...]) -> str:
    if len(addresses) > 1:
        raise Failure(f"the address is given twice, {' and '.join(addresses)}; keep one --node or --address")
    return addresses[0]


def _assigned(texts: Iterable[str]) -> dict[str, str]:
    given: dict[str, str] = {}
    for text in texts:
        name, mark, value = text.partition("=")
        if not mark or not name:
            raise Failure(f"'{text}' is not FIELD=VALUE; write for example counter=1")
        if name in given:
            raise Failure(f"{name} is given twice, {given[name]} and {value}; keep one")
        given[name] = value
    return given


def _address(protocol: Protocol, message: Message, given: str | None) -> dict[str, int]:
    name = protocol.address_name
    if name is None or not addressed(protocol, message):
        if given is not None:
            raise Failure(f"{protocol.name} has no address in its frame; omit --node {given}")
        return {}
    if given is None:
        return {name: _only_address(message, name)}
    address = whole_number(given)
    if address is None:
        allowed = addresses_text(message)
        raise Failure(f"{_option(name)} {given}: not a whole number; use {allowed}")
    _check_broadcast(protocol, message, address, _option(name))
    return {name: address}


def _check_broadcast(protocol: Protocol, message: Message, address: int, option: str) -> None:
    """Refuse a broadcast if the command does not allow it, and a node if the command is only broadcast."""
    broadcast = protocol.bus.broadcast
    if broadcast is None or any(first <= address <= last for first, last in message.addresses):
        return
    if message.addresses == ((broadcast, broadcast),):
        raise Failure(f"{message.command} can only be broadcast; omit {option}")
    if address == broadcast:
        raise Failure(f"{message.command} cannot be broadcast; {option} {addresses_text(message)}")


def _option(name: str) -> str:
    return "--node" if name == "node" else "--address"


def _only_address(message: Message, name: str) -> int:
    (first, last), *others = message.addresses
    if others or first != last:
        raise Failure(
            f"{message.name} needs an address; add {_option(name)} N with N in {addresses_text(message)}"
        )
    return first


def _frame(
    protocol: Protocol, codec: ModuleType, message: Message, built: MessageObject, request: str | None
) -> bytes:
    answer = frame_plan(protocol.frame).needs_request and message.direction == "response"
    command = protocol.command_of(message)
    if command is not None and command.response is message and command.proof is not None:
        if (known := proving(protocol, codec, message, request)) is not None:
            prove(codec.COMMANDS[command.name], known, built)
        return built.to_frame()
    if not answer:
        if request is not None:
            raise Failure(f"{message.name} does not depend on a request; omit --request")
        return built.to_frame()
    return built.to_frame(asked(protocol, codec, request, message))


def proving(
    protocol: Protocol, codec: ModuleType, message: Message, request: str | None
) -> MessageObject | None:
    """Return the request of ``--request`` for a message that its turn tells; None without the option."""
    if request is None:
        return None
    command = protocol.command_of(message)
    if command is None or command.response is not message or command.proof is None:
        raise Failure(f"--request has no effect: {message.name} has no check value that covers it; omit it")
    found = asked(protocol, codec, request)
    if command.request.name != found.NAME:
        raise Failure(f"--request {request} is {found.NAME}, not the request of {message.name}")
    return found


def asked(
    protocol: Protocol, codec: ModuleType, request: str | None, answer: Message | None = None
) -> MessageObject:
    """Return the request of ``--request``; without the option, the request if it has no fields to choose."""
    if request is None:
        command = protocol.command_of(answer) if answer else None
        if command is None or command.request.fields:
            raise Failure("the check value of a response covers its request too; pass --request HEX")
        default: MessageObject = codec.MESSAGES[command.request.name]()
        return default
    try:
        found: MessageObject = codec.decode_request(parse_hex(request, "--request"))
    except codec.DecodeError as error:
        raise Failure(f"--request {request}: {error}") from None
    if answer is not None and answer.id != found.ID:
        raise Failure(f"--request {request} is {found.NAME}, not the request of {answer.name}")
    return found
