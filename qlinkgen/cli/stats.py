"""``qlinkgen stats``: what happened on the line of a capture, in figures."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Literal

import click

from qlinkgen.captures.records import Problems
from qlinkgen.captures.statistics import Seen, Statistics
from qlinkgen.cli.arguments import protocol_argument
from qlinkgen.cli.boundary import FINE, WRONG, Failure
from qlinkgen.cli.capture_input import Capture
from qlinkgen.cli.capture_options import CaptureOptions, capture_options, complain
from qlinkgen.cli.codec import load_codec
from qlinkgen.cli.common import load_protocol, version_option
from qlinkgen.cli.decoder import Decoder
from qlinkgen.cli.filters import Filter, FilterOptions, filter_options
from qlinkgen.cli.stats_report import Report, html, show
from qlinkgen.cli.stats_source import heard_on_bus, messages_alone
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan.framing import frame_plan
from qlinkgen.protocols.registry import support_of

Form = Literal["text", "json", "html"]
#: Bits per second, where neither the schema nor the user states it.
_USUAL = 9600


@click.command("stats")
@protocol_argument
@click.argument("files", metavar="FILE...", nargs=-1, required=True)
@click.option("--format", "form", type=click.Choice(["text", "json", "html"]), default="text")
@click.option("-o", "--output", metavar="FILE", help="Write to a file instead of standard output.")
@click.option("--strict", is_flag=True, help="Exit code 1 for any bad frame, or anything that is not read.")
@filter_options
@capture_options
@version_option
def command(  # noqa: PLR0917  # click passes them by name
    protocol: str,
    files: tuple[str, ...],
    form: Form,
    output: str | None,
    strict: bool,
    wanted: FilterOptions,
    capture: CaptureOptions,
    version: str | None,
) -> int:
    """Print statistics of captures: use of the line, response times, late and missing answers, faults.

    FILE is any capture that decode reads, or - for standard input; several are read one after the other. The
    figures are by node and command. Response times are those between the records of the capture: exact to
    what the program that recorded adds to them. Captures without times give counts.

    \b
    qlinkgen stats qlink line.pcapng
    qlinkgen stats qlink line.pcapng --node 3 --format html -o line.html
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    loaded = load_protocol(protocol, None, version)
    codec = load_codec(loaded, plain=True)
    baud = capture.baud or loaded.bus.baud or _USUAL
    statistics, problems, size = Statistics(), Problems(), 0
    chosen = Filter(loaded, wanted)
    for name in files:
        file = Capture(loaded, Decoder(loaded, codec, None, None, None, capture.baud), capture)
        for seen in _seen(loaded, codec, file, name, chosen, baud):
            statistics.take(seen)
        size += file.size
        problems.count += file.problems.count
        complain(name, file.problems)
    report = Report.of(loaded, statistics, None if chosen.chooses else size, baud)
    if form == "text" and output is None:
        show(report)
    else:
        text = html(report, files) if form == "html" else json.dumps(report.record(), indent=2) + "\n"
        if form == "text":
            text = "\n".join(report.lines()) + "\n"
        _write(text, output)
    wrong = strict and (statistics.faults or problems.count)
    return FINE if statistics.frames and not wrong else WRONG


def _seen(  # noqa: PLR0917  # one call
    protocol: Protocol,
    codec: ModuleType,
    file: Capture,
    name: str,
    chosen: Filter,
    baud: int,
) -> Iterator[Seen]:
    paired = protocol.commands and not frame_plan(protocol.frame).needs_request
    if paired and protocol.bus.kind in {"master_slave", "link"}:
        return heard_on_bus(
            protocol, codec, file.records(name), chosen, baud=baud, accepts=support_of(protocol).accepts()
        )
    return messages_alone(protocol, file.frames(name), chosen)


def _write(text: str, output: str | None) -> None:
    if output is None:
        click.echo(text, nl=False)
        return
    try:
        Path(output).write_text(text, "utf-8")
    except IsADirectoryError:
        raise Failure(f"-o {output}: it is a folder; name a file") from None
    click.echo(f"qlinkgen: wrote {output}", err=True)
