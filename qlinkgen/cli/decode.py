"""``qlinkgen decode``: decode wire bytes, one JSON object per line."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from io import BufferedReader
from itertools import chain
from types import ModuleType
from typing import cast

import click

from qlinkgen.cli import jsonlines
from qlinkgen.cli.arguments import protocol_argument
from qlinkgen.cli.boundary import FINE, WRONG, Failure
from qlinkgen.cli.codec import fields, load_codec
from qlinkgen.cli.common import (
    crc_option,
    load_protocol,
    parse_hex,
    turned_message,
    version_option,
    warn,
    warn_unconfirmed,
)
from qlinkgen.cli.conversations import Answers, Conversation
from qlinkgen.cli.encode import asked, proving
from qlinkgen.cli.hex_text import HexError, HexReader
from qlinkgen.cli.streams import Alone, Bad, Event, Stream, open_stream
from qlinkgen.link.codec import Fault, Message
from qlinkgen.model.message import Direction
from qlinkgen.model.naming import address_attribute, attribute, record_key
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.transaction import Means, Reply
from qlinkgen.model.values import Json, to_json
from qlinkgen.plan.framing import frame_plan

CHUNK = 65536
_LINE = re.compile(rb"[^\n]*\n|[^\n]+")
_COMMENT = re.compile(rb"#[^\n]*")


@click.command("decode")
@protocol_argument
@click.argument("hex_", metavar="[HEX|-]...", nargs=-1)
@click.option(
    "--direction", type=click.Choice(["request", "response"]), help="Direction of the frames; see above."
)
@click.option(
    "--request", "request", metavar="HEX", help="The request of the responses, where these depend on it."
)
@click.option("--message", "name", metavar="MESSAGE", help="What HEX is, where only its turn tells it.")
@click.option("--raw", is_flag=True, help="Standard input is binary, not hex text.")
@crc_option
@version_option
def command(  # noqa: PLR0917  # click passes them by name
    protocol: str,
    hex_: tuple[str, ...],
    direction: Direction | None,
    request: str | None,
    name: str | None,
    raw: bool,
    crc: str | None,
    version: str | None,
) -> int:
    """Print every frame of a stream as a JSON object; bytes between frames are skipped.

    - (or no HEX) reads hex text from standard input as it arrives; comments go from # to the end of the line.
    White space separates words of digit pairs, each with or without 0x; a single digit is a byte too. A bad
    frame is an object {"error": {"kind", "offset", "raw", "message"}}. Exit code 1 if there is a bad frame,
    or no frame.

    Most frames do not state their direction. Without --direction, a frame that is valid in only one direction
    has that direction; one that is valid in both is the response if it directly follows a request of the same
    command and node, else the request. Packets without --direction are a conversation: after a request, a
    response if its check value fits, else the next request; with --direction response they need --request.
    Where only a silence ends a frame, each line of standard input is one frame, and so are all HEX together.

    \b
    qlinkgen decode qlink a5a504210315e8
    qlinkgen decode qlink --direction response - < capture.txt
    qlinkgen decode trio --raw < /dev/ttyUSB0
    qlinkgen decode mc1231a --direction response --request 4a 0012d687d6e3
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    chunks = _input(hex_, raw=raw)
    loaded = load_protocol(protocol, crc, version)
    codec = load_codec(loaded, plain=crc is None)
    if name is not None:
        message = turned_message(loaded, name)
        stream: Stream = Alone(codec, message.name, proving(loaded, codec, message, request))
    else:
        stream = _stream(loaded, codec, direction, request)
    gaps = frame_plan(loaded.frame).silent
    if gaps and raw:
        what = f"only a silence ends a frame of {loaded.name}, and raw bytes have no times"
        raise Failure(f"{what}; give hex text with one frame on each line")
    printer = _Printer(loaded)
    for chunk in chunks:
        if chunk is not None:
            printer.show(stream.feed(chunk), len(chunk))
        elif gaps:
            printer.show(stream.finish())
    printer.show(stream.finish())
    return printer.result()


def _stream(
    protocol: Protocol, codec: ModuleType, direction: Direction | None, request: str | None
) -> Stream:
    if direction and direction not in protocol.directions:
        raise Failure(f"{protocol.name} has neither requests nor responses; omit --direction {direction}")
    packets = frame_plan(protocol.frame).needs_request
    told = packets or protocol.carrier is not None
    if request is not None and not (told and direction != "request"):
        raise Failure("--request requires responses that only their request tells apart; omit it")
    if not packets or direction == "request":
        first = None if request is None else asked(protocol, codec, request)
        return open_stream(protocol, codec, direction, first)
    if direction is None and request is None:
        return Conversation(protocol, codec)
    return Answers(protocol, codec, asked(protocol, codec, request))


def _input(words: tuple[str, ...], *, raw: bool) -> Iterable[bytes | None]:
    """The bytes, and None after each line of hex text."""
    if words and words != ("-",):
        if raw:
            raise Failure("--raw reads bytes from standard input; omit HEX or --raw")
        return [parse_hex(" ".join(words))]
    if not words and sys.stdin.isatty():
        raise Failure("nothing to decode; give HEX, or - to read it from standard input")
    return _read_raw() if raw else _read_hex()


def _read_raw() -> Iterator[bytes]:
    while chunk := cast(BufferedReader, sys.stdin.buffer).read1(CHUNK):
        yield chunk


def _read_hex() -> Iterator[bytes | None]:
    """Yield bytes as soon as both digits are known, and None after each line; a chunk may end anywhere.

    The bytes before a wrong character are yielded before the error is raised.
    """
    reader, comment, line = HexReader(), False, 1
    for chunk in chain(_read_raw(), (b"\n",)):
        text = _COMMENT.sub(b"", b"#" + chunk if comment else chunk)
        comment = b"#" in chunk[chunk.rfind(b"\n") + 1 :] or (comment and b"\n" not in chunk)
        for piece in _LINE.findall(text):
            try:
                yield reader.feed(piece.decode("ascii", "surrogateescape"))
            except HexError as error:
                yield error.before
                what = f"standard input, line {line}: {error.message}"
                raise Failure(f"{what}; comments begin with #") from None
            if piece.endswith(b"\n"):
                line += 1
                yield None


class _Printer:
    """Prints events immediately, and counts them for the exit code."""

    def __init__(self, protocol: Protocol) -> None:
        self._protocol = protocol
        self._bytes = self._good = self._bad = 0
        self._warned: set[str] = set()

    def show(self, events: Iterable[Event], size: int = 0) -> None:
        """Print events and flush, so that the reader of a pipe sees them at once."""
        self._bytes += size
        for event in events:
            sys.stdout.write(f"{jsonlines.line(self._record(event))}\n")
        sys.stdout.flush()

    def result(self) -> int:
        """The exit code."""
        if not self._good and not self._bad:
            seen = f"no frame in {self._bytes} bytes" if self._bytes else "no input"
            warn(f"{seen}; `qlinkgen explain {self._protocol.name} HEX` looks for the cause")
        return FINE if self._good and not self._bad else WRONG

    def _record(self, event: Event) -> Mapping[str, Json]:
        if isinstance(event, Bad):
            self._bad += 1
            return error_record(event)
        self._good += 1
        if event.NAME not in self._warned:
            self._warned.add(event.NAME)
            warn_unconfirmed(self._protocol, self._protocol.by_name[event.NAME])
        return message_record(self._protocol, event)


def message_record(protocol: Protocol, found: Message) -> dict[str, Json]:
    """Return the JSON object of a message."""
    message = protocol.by_name[found.NAME]
    record: dict[str, Json] = {"message": message.name}
    name = protocol.address_name
    if name and message.addresses:
        record[record_key(name)] = getattr(found, address_attribute(name))
    for value in protocol.beside(message):
        record[record_key(value.name)] = to_json(value, getattr(found, attribute(value.name)))
    record["fields"] = fields(message, found)
    if message.carries:
        record["request_seen"] = False
    reply = protocol.replies.get(message.name)
    if reply is not None and means(reply, found) == "refused":
        record["refused"] = True
    return record


def means(reply: Reply, found: Message) -> Means:
    """Return what a received reply means."""
    return reply.means_by(int(getattr(found, attribute(reply.switch)))) if reply.switch else reply.means


def error_record(bad: Fault) -> dict[str, Json]:
    """Return the JSON object of a bad frame."""
    return {"error": {"kind": bad.kind, "offset": bad.offset, "raw": bad.raw.hex(), "message": bad.message}}
