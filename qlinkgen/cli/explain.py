"""``qlinkgen explain``: describe every byte of a frame, and its errors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from types import ModuleType

import click

from qlinkgen.cli.arguments import protocol_argument
from qlinkgen.cli.boundary import FINE, WRONG, Failure
from qlinkgen.cli.capture_options import CaptureOptions, capture_options, given_bytes
from qlinkgen.cli.codec import load_codec
from qlinkgen.cli.common import (
    crc_option,
    load_protocol,
    on_terminal,
    parse_hex,
    turned_message,
    version_option,
)
from qlinkgen.cli.encode import proving
from qlinkgen.cli.findings import finding, notes
from qlinkgen.cli.span_text import value_of
from qlinkgen.cli.streams import PROGRESS
from qlinkgen.cli.tables import Table, heading, paragraph
from qlinkgen.model.message import Direction
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.replacement import Replacement
from qlinkgen.model.texts import one_line
from qlinkgen.plan import Plan, plan_of
from qlinkgen.plan.dissect import dissect, request_size
from qlinkgen.plan.payload import Member
from qlinkgen.plan.spans import Dissection, Rule, Span

Line = tuple[int, str, str, str, bool]


@click.command("explain")
@protocol_argument
@click.argument("hex_", metavar="HEX...|FILE|-", nargs=-1, required=True)
@click.option("--first-bad", is_flag=True, help="Explain the first bad frame of a capture.")
@click.option(
    "--direction",
    type=click.Choice(["request", "response"]),
    help="Direction of the frame; guessed by default.",
)
@click.option(
    "--request",
    "request",
    metavar="HEX",
    help="The request of a response that depends on it; HEX is then only the response.",
)
@click.option("--message", "name", metavar="MESSAGE", help="What HEX is, where only its turn tells it.")
@capture_options
@crc_option
@version_option
def command(  # noqa: PLR0917  # click passes them by name
    protocol: str,
    hex_: tuple[str, ...],
    first_bad: bool,
    direction: Direction | None,
    request: str | None,
    name: str | None,
    capture: CaptureOptions,
    crc: Replacement | None,
    version: str | None,
) -> int:
    """Describe every byte of one frame; for each error, the rule broken and the likely cause.

    For a wrong checksum, the other algorithms of the catalogue, byte orders and coverages are tried. Exit
    code 1 if there is an error.

    With --first-bad, the first bad frame of a capture as of decode. Of two captures, the first frame in which
    they differ, as both have it.

    \b
    qlinkgen explain qlink a5a50783 01a500ffa500e305
    qlinkgen explain mc1231a 4a 0012d687d6e3
    qlinkgen explain qlink line.pcapng --first-bad
    qlinkgen explain qlink yesterday.log today.log
    qlinkgen explain stm32 --message read_memory.place 0800000008
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    loaded = load_protocol(protocol, crc, version)
    data = given_bytes(hex_, raw=capture.format == "raw")
    if data is None:
        return _of_files(loaded, load_codec(loaded, plain=crc is None), hex_, capture, first_bad=first_bad)
    if first_bad:
        raise Failure("--first-bad looks for a frame in a capture; name a FILE, or omit the option")
    if not data:
        raise Failure("HEX is empty; give the bytes of one frame")
    asked = None if request is None else parse_hex(request, "--request")
    plan = plan_of(loaded)
    if name is not None:
        message = plan.message(turned_message(loaded, name).name)
        proving(loaded, load_codec(loaded), message.message, request)
        told = dissect(plan, data, message.direction, asked or b"", turned=message)
        found, hints = [told], notes(told)
    else:
        found, hints = explained(plan, data, direction, asked)
    _show(found, hints)
    return WRONG if any(each.kind for each in found) else FINE


def _of_files(
    protocol: Protocol, codec: ModuleType, names: tuple[str, ...], capture: CaptureOptions, *, first_bad: bool
) -> int:
    """Explain the first bad frame of a capture, or the first difference of two."""
    if len(names) > 2 or (len(names) == 1) is not first_bad:
        raise Failure("explain takes HEX, a FILE with --first-bad, or two FILEs without it")
    from qlinkgen.cli import explain_files as files  # noqa: PLC0415  # not needed for HEX

    frames = [files.Frames(protocol, codec, capture, name) for name in names]
    found: tuple[files.Found | None, ...] | None
    found = (files.first_bad(frames[0]),) if first_bad else files.first_difference(*frames)
    if found is None or found == (None,):
        what = "no bad frame among" if first_bad else "no difference in"
        click.echo(f"{what} {frames[0].count} frames")
        return FINE if frames[0].count else WRONG
    for name, each in zip(names, found, strict=True):
        if each is None:
            click.echo(f"{name}: it has no more frames\n")
            continue
        click.echo(each.text)
        _show(*explained(plan_of(protocol), each.data, each.direction, each.request))
        click.echo()
    return WRONG


def explained(
    plan: Plan, data: bytes, direction: Direction | None, request: bytes | None
) -> tuple[list[Dissection], list[str]]:
    """Return the frames in the bytes, in order, and notes on them."""
    if not plan.frame.needs_request:
        if request is not None:
            if plan.carrier is None or direction == "request":
                raise Failure("--request requires responses that only their request tells apart; omit it")
            _check_request(plan, request, ("",))
            told = dissect(plan, data, "response", request)
            return [told], notes(told)
        found, hint = _guessed(plan, data, [direction] if direction else plan.protocol.directions)
        return [found], [*hint, *notes(found)]
    if request is not None:
        _check_request(plan, request, ("", "range"))  # a device answers values out of range
        found = dissect(plan, data, "response", request)
        return [found], notes(found)
    if direction == "response":
        raise Failure("a response cannot be identified without its request; pass --request HEX")
    size = request_size(plan, data)
    asked = dissect(plan, data[:size], "request")
    answers = [dissect(plan, data[size:], "response", data[:size])] if data[size:] else []
    return [asked, *answers], [note for each in answers for note in notes(each)]


def _check_request(plan: Plan, request: bytes, kinds: Sequence[str]) -> None:
    """Refuse bytes that are not a request, except for faults of some kinds."""
    kind = dissect(plan, request, "request").kind
    if kind not in kinds:
        what = "command byte and words" if plan.frame.needs_request else "a whole frame"
        raise Failure(f"--request {request.hex()} is not a request ({kind}); give {what}")


def _guessed(plan: Plan, data: bytes, ways: Sequence[Direction]) -> tuple[Dissection, list[str]]:
    """Return the dissection in the likelier direction: the later first fault, then fewer faults."""
    found = sorted((dissect(plan, data, way) for way in ways), key=_doubt)
    first, *others = found
    hints = [
        f"it may also be {other.message.name}; see --direction {other.direction}"
        for other in others
        if other.message and other.message is not first.message and _doubt(other) == _doubt(first)
    ]
    return first, hints


def _doubt(found: Dissection) -> tuple[int, int, bool]:
    """Return a sort key, larger for a less likely direction: early fault, number of faults, payload size."""
    early = len(PROGRESS) - PROGRESS.index(found.kind) if found.kind else 0
    payload = found.message.payload if found.message else None
    cell = found.cells.get(found.frame.envelope.payload.name)
    fits = payload and cell and payload.least <= len(cell.data) <= payload.most
    return early, len(found.faults), not fits


def _show(found: Sequence[Dissection], hints: Sequence[str]) -> None:
    heading(_title(found[0]))
    table = Table(["offset", "byte", "part", "value", ""], "", frozenset({"offset"}))
    start = 0
    for each in found:
        for offset, byte, part, value, wrong in _lines(each):
            table.add(start + offset if byte else "", byte, part, value, "<- wrong" if wrong else "")
        start += len(each.wire)
    table.show()
    paragraph([f"note: {hint}" for hint in hints])
    label = click.style("wrong:", fg="red", bold=True) if on_terminal() else "wrong:"
    start = 0
    for each in found:
        for fault in each.faults:
            rule, cause = finding(each, fault, start)
            click.echo(f"{label} {one_line(rule)}")
            if cause:
                click.echo(f"likely: {one_line(cause)}")
        start += len(each.wire)
    if not any(each.kind for each in found):
        click.echo("no errors")


def _title(found: Dissection) -> str:
    name = found.message.name if found.message else f"unknown {found.direction}"
    return name if found.address is None else f"{name}, {found.frame.address} {found.address}"


def _lines(found: Dissection) -> list[Line]:
    """Return a line for each byte and for each member: offset, hex, part, value, whether it is marked."""
    lines = [line for span in found.spans for line in _of_span(found, span)]
    return sorted(lines, key=lambda line: line[0])


def _of_span(found: Dissection, span: Span) -> Iterator[Line]:
    part, value = value_of(found, span)
    misplaced = {fault.at for fault in found.faults if fault.rule is Rule.STUFFING}
    match span.of:
        case Member():
            yield span.places[-1], "", f"  .{span.of.name}", value, span.fault != ""
        case _:
            for place, byte in zip(span.places, span.raw, strict=True):
                yield place, f"{byte:02x}", part, value, span.fault != "" or place in misplaced
                value = ""
