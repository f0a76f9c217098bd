"""``qlinkgen decode``: decode wire bytes, one JSON object per line."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from decimal import Decimal

import click

from qlinkgen.captures.records import Problems, Record
from qlinkgen.cli import jsonlines
from qlinkgen.cli.arguments import protocol_argument
from qlinkgen.cli.boundary import FINE, WRONG
from qlinkgen.cli.capture_options import CaptureOptions, capture_options, complain, given_bytes
from qlinkgen.cli.codec import fields, load_codec
from qlinkgen.cli.common import (
    crc_option,
    find_message,
    load_protocol,
    version_option,
    warn,
    warn_unconfirmed,
)
from qlinkgen.cli.decoder import Decoder
from qlinkgen.cli.filters import Filter, FilterOptions, FlagForm, Flagged, filter_options
from qlinkgen.cli.streams import Bad, Event
from qlinkgen.cli.traffic import Place, Placed
from qlinkgen.link.codec import Fault, Message
from qlinkgen.model.message import Direction
from qlinkgen.model.naming import address_attribute, attribute, record_key
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.replacement import Replacement
from qlinkgen.model.transaction import Means, Reply
from qlinkgen.model.values import Json, to_json


@click.command("decode")
@protocol_argument
@click.argument("hex_", metavar="[HEX|FILE|-]...", nargs=-1)
@click.option(
    "--direction", type=click.Choice(["request", "response"]), help="Direction of the frames; see above."
)
@click.option(
    "--request", "request", metavar="HEX", help="The request of the responses, where these depend on it."
)
@click.option("--strict", is_flag=True, help="Exit code 1 for any bad frame, or anything that is not read.")
@click.option(
    "--flags",
    type=click.Choice(["number", "names"]),
    default="number",
    help="Print flags as a number, or as a list of names.",
)
@filter_options
@capture_options
@crc_option
@version_option
def command(  # noqa: PLR0917  # click passes them by name
    protocol: str,
    hex_: tuple[str, ...],
    direction: Direction | None,
    request: str | None,
    strict: bool,
    flags: FlagForm,
    wanted: FilterOptions,
    capture: CaptureOptions,
    crc: Replacement | None,
    version: str | None,
) -> int:
    """Print every frame of captures as a JSON object; bytes between frames are skipped.

    Arguments that are all hex are bytes: white space separates words of digit pairs, each with or without 0x;
    a single digit is a byte too. A FILE that is so named is written ./dead. - (or nothing) reads standard
    input as it arrives.

    A capture is raw bytes; hex text, as printed by xxd, hexdump and od, with 0x, \\x, commas or colons, or as
    an array in C; a log whose lines have a time, a direction or both; an export of the analysers of Saleae or
    sigrok; pcap or pcapng. Any of them may be compressed by gzip or Zstandard. The format is found from the
    frames that each reading gives; --capture-format names it.

    "offset" is where a frame begins: its first byte, or the line or packet of the file with it. "time" is in
    seconds, since 1970 where the capture has dates. A bad frame is an object {"error": {"kind", "offset",
    "raw", "message"}}. What cannot be read of a file is said at its end. Exit code 1 without any frame, and
    for a bad one in HEX or with --strict.

    Most frames do not state their direction. Without --direction, a capture may state it; else a frame that
    is valid in only one direction has that direction; one that is valid in both is the response if it follows
    a request of the same command and node directly, else the request. Packets without --direction are a
    conversation: after a request, a response if its check value fits, else the next request; with --direction
    response they need --request. Where only a silence ends a frame, each line or packet is one frame, and so
    are all HEX together; single bytes with times belong together until the line was idle.

    \b
    qlinkgen decode qlink a5a504210315e8
    qlinkgen decode qlink line.pcapng
    qlinkgen decode qlink --direction response - < capture.txt
    qlinkgen decode trio --raw < /dev/ttyUSB0
    qlinkgen decode mc1231a --direction response --request 4a 0012d687d6e3
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    given = given_bytes(hex_, raw=capture.format == "raw")
    files = hex_ or ("-",)
    loaded = load_protocol(protocol, crc, version)
    codec = load_codec(loaded, plain=crc is None)
    turned, wanted = _turned(loaded, wanted)
    decoder = Decoder(loaded, codec, direction, request, turned, capture.baud)
    several = given is None and len(files) > 1
    printer = _Printer(loaded, Filter(loaded, wanted), several=several, flags=flags)
    if given is not None:
        printer.show(decoder.traffic({}, exact=True).decode([Record(given, 0)]))
        return printer.result(len(given), strict=True)
    from qlinkgen.cli.capture_input import Capture  # noqa: PLC0415  # not needed for HEX

    size = 0
    for path in files:
        file = Capture(loaded, decoder, capture)
        printer.show(file.frames(path), path)
        printer.complain(path, file.problems)
        size += file.size
    printer.summarise(size)
    return printer.result(size, strict=strict)


def _turned(protocol: Protocol, wanted: FilterOptions) -> tuple[str | None, FilterOptions]:
    """Return the message that all bytes are, if only its turn tells it; then messages are not chosen."""
    if len(wanted.messages) != 1:
        return None, wanted
    message = find_message(protocol, wanted.messages[0])
    return (message.name, replace(wanted, messages=())) if protocol.is_turned(message) else (None, wanted)


class _Printer:
    """Prints frames immediately, and counts them for the exit code."""

    def __init__(self, protocol: Protocol, wanted: Filter, *, several: bool, flags: FlagForm) -> None:
        self._protocol = protocol
        self._wanted = wanted
        self._several = several  # there are several files: objects name theirs
        self._flags = Flagged(protocol) if flags == "names" else None
        self._faults = Counter[str]()
        self._size = 0  # bytes in frames and in bad frames
        self._good = self._bad = self._unread = 0
        self._warned: set[str] = set()

    def show(self, frames: Iterable[Placed], file: str = "") -> None:
        """Print the frames of a file; those of standard input are seen at once by the reader of a pipe."""
        for event, place in frames:
            record = self._record(event, place)
            if self._several:
                record["file"] = file
            if not self._wanted.keeps(record):
                continue
            if self._flags is not None:
                record = self._flags.named(record)
            sys.stdout.write(f"{jsonlines.line(record)}\n")
            if file == "-":
                sys.stdout.flush()

    def complain(self, file: str, problems: Problems) -> None:
        """Say what could not be read of a file."""
        complain(file, problems)
        self._unread += problems.count

    def summarise(self, size: int) -> None:
        """Say how many frames and faults there were in so many bytes."""
        kinds = ", ".join(f"{kind} {count}" for kind, count in sorted(self._faults.items()))
        bad = f", bad {self._bad} ({kinds})" if kinds else ""
        outside = max(0, size - self._size)
        click.echo(f"qlinkgen: frames {self._good}{bad}; {outside} of {size} bytes outside frames", err=True)

    def result(self, size: int, *, strict: bool) -> int:
        """Return the exit code; `size`: bytes in all."""
        if not self._good and not self._bad:
            seen = f"no frame in {size} bytes" if size else "no input"
            warn(f"{seen}; `qlinkgen explain {self._protocol.name} HEX` looks for the cause")
        return FINE if self._good and not (strict and (self._bad or self._unread)) else WRONG

    def _record(self, event: Event, place: Place) -> dict[str, Json]:
        self._size += place.size
        if isinstance(event, Bad):
            self._bad += 1
            self._faults[event.kind] += 1
        else:
            self._good += 1
            if event.NAME not in self._warned:
                self._warned.add(event.NAME)
                warn_unconfirmed(self._protocol, self._protocol.by_name[event.NAME])
        return frame_record(self._protocol, event, place)


def frame_record(protocol: Protocol, event: Event, place: Place) -> dict[str, Json]:
    """Return the JSON object of a frame of a capture."""
    if isinstance(event, Bad):
        record = error_record(replace(event, offset=place.offset))
    else:
        record = message_record(protocol, event)
        record["offset"] = place.offset
    if place.at is not None:
        record["time"] = Decimal(place.at).scaleb(-9)
    return record


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
