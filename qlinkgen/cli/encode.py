"""``qlinkgen encode``: values to wire bytes."""

from __future__ import annotations

from typing import Any

import click

from qlinkgen.cli import jsonlines
from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.codec import build, load_codec
from qlinkgen.cli.common import (
    addressed,
    crc_option,
    find_message,
    load_protocol,
    parse_hex,
    warn_unconfirmed,
)
from qlinkgen.cli.describe import addresses_text
from qlinkgen.model.frame import PacketFrame
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol


@click.command("encode")
@click.argument("protocol")
@click.argument("message")
@click.argument("assignments", metavar="[FIELD=VALUE]...", nargs=-1)
@click.option(
    "--node", "--address", "address", metavar="N", help="Whom the frame is for or from; 0x numbers too."
)
@click.option(
    "--json", "object_", metavar="OBJECT", help='Values as JSON: \'{"counter": 1, "segments": [1, 2]}\'.'
)
@click.option("--request", "request", metavar="HEX", help="Packets: the request that a response answers.")
@crc_option
def command(  # noqa: PLR0917  # click passes them by name
    protocol: str,
    message: str,
    assignments: tuple[str, ...],
    address: str | None,
    object_: str | None,
    request: str | None,
    crc: str | None,
) -> None:
    r"""Print the wire bytes of a message as lower-case hex: length, checksum and stuffing are filled in.

    A field that is not given has its default; FIELD=VALUE wins over --json. Bytes are hex, lists have
    commas, enums are their name or number, flags a number or names with | between them, numbers may be 0x,
    scaled values are in the unit.

    \b
    qlinkgen encode qlink motion --node 3 counter=1 outputs=0x0F segments=100,200
    qlinkgen encode qlink motion.response --node 3 position=-5 motor_status='running|position_valid'
    qlinkgen encode trio direct_variable_transfer --address 2 number=7 value=-0.25
    qlinkgen encode mc1231a get_pos.response --request 4a value=1234567
    """
    loaded = load_protocol(protocol, crc)
    found = find_message(loaded, message)
    given = {} if object_ is None else jsonlines.parse_object(object_, "--json")
    given.update(_assigned(text) for text in assignments)
    warn_unconfirmed(loaded, found)
    codec = load_codec(loaded)
    built = build(codec, found, given, _address(loaded, found, address))
    try:
        click.echo(_frame(loaded, codec, found, built, request).hex())
    except codec.EncodeError as error:
        raise Failure(str(error)) from None


def _assigned(text: str) -> tuple[str, str]:
    name, mark, value = text.partition("=")
    if not mark or not name:
        raise Failure(f"'{text}' is no FIELD=VALUE; write for example counter=1")
    return name, value


def _address(protocol: Protocol, message: Message, given: str | None) -> dict[str, int]:
    name = protocol.address_name
    if name is None or not addressed(protocol, message):
        if given is not None:
            raise Failure(f"{protocol.name} has no address in its frame; leave out --node {given}")
        return {}
    if given is None:
        return {name: _only_address(message, name)}
    try:
        return {name: int(given, 0)}
    except ValueError:
        raise Failure(
            f"--{name} {given}: not a whole number; {addresses_text(message)} can be given"
        ) from None


def _only_address(message: Message, name: str) -> int:
    (first, last), *others = message.addresses
    if others or first != last:
        raise Failure(
            f"{message.name} does not say for whom; give --{name} N with N in {addresses_text(message)}"
        )
    return first


def _frame(protocol: Protocol, codec: Any, message: Message, built: Any, request: str | None) -> bytes:
    answer = isinstance(protocol.frame, PacketFrame) and message.direction == "response"
    if not answer:
        if request is not None:
            raise Failure(f"{message.name} does not depend on a request; leave out --request")
        return bytes(built.to_frame())
    return bytes(built.to_frame(asked(protocol, codec, request, message)))


def asked(protocol: Protocol, codec: Any, request: str | None, answer: Message | None = None) -> Any:
    """The request object behind ``--request``; without one, a request that has no fields to choose."""
    if request is None:
        command = protocol.command_of(answer) if answer else None
        if command is None or command.request.fields:
            raise Failure("the check value of a response covers its request too; give it with --request HEX")
        return codec.MESSAGES[command.request.name]()
    try:
        found = codec.decode_request(parse_hex(request, "--request"))
    except codec.DecodeError as error:
        raise Failure(f"--request {request}: {error}") from None
    if answer is not None and answer.id != found.ID:
        raise Failure(f"--request {request} is {found.NAME}, which {answer.name} does not answer")
    return found
