"""``qlinkgen load``: load a program into a Q.link node."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator

import click

from qlinkgen.cli.arguments import driven_protocol_argument, port_argument
from qlinkgen.cli.boundary import INTERRUPTED, USAGE, WRONG, Failure
from qlinkgen.cli.common import crc_option, load_protocol, on_terminal
from qlinkgen.cli.wire_options import (
    attempts_option,
    baud_option,
    counted,
    echo_option,
    open_line,
    qlink_node,
    seconds,
    slack_option,
    with_crc,
)
from qlinkgen.codecs import qlink
from qlinkgen.errors import HexFileError, PortLost
from qlinkgen.link.echo import EchoMode
from qlinkgen.model.replacement import Replacement
from qlinkgen.protocols.qlink import Bus, LoadProgress
from qlinkgen.protocols.qlink.facts import BAUD
from qlinkgen.protocols.qlink.hexfile import read_hex
from qlinkgen.protocols.registry import support_of

Show = Callable[[LoadProgress], None]

#: Number of progress lines if the output is not a terminal.
LINES = 10


@click.command("load")
@driven_protocol_argument
@port_argument
@click.argument("file", metavar="FILE.hex", type=click.Path())
@click.option("--node", required=True, callback=qlink_node, metavar="N", help="Node to load, 1..16.")
@click.option(
    "--patience",
    default="5",
    show_default=True,
    callback=seconds,
    metavar="SECONDS",
    help="Time limit for each piece.",
)
@baud_option
@attempts_option
@slack_option
@echo_option
@crc_option
def command(  # noqa: PLR0917  # click passes them by name
    protocol: str,
    port: str,
    file: str,
    node: int,
    patience: float,
    baud: int | None,
    attempts: int,
    slack: float | None,
    echo: EchoMode | None,
    crc: Replacement | None,
) -> None:
    """Load an Intel HEX file into a node of a Q.link bus.

    The file is checked before anything is sent: records, checksums, overlaps, end. If an acknowledgement is
    lost, the piece is sent again, and the node does not store it twice. An interrupted load leaves part of
    the program in the node; the next load starts over.

    Exit code 1 if the file is wrong, a piece is not acknowledged, or the port is missing, busy or lost.

    \b
    qlinkgen load qlink /dev/ttyUSB0 --node 3 program.hex
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    if not support_of(load_protocol(protocol)).loads:
        raise Failure(f"{protocol} has no procedure that loads a program; qlink has one")
    text = _text(file)
    with_crc(qlink, qlink.Codec, crc)
    algorithm = crc.algorithm if crc else None
    with open_line(port, baud or BAUD) as opened:
        bus = Bus(opened, attempts=attempts, echo=echo or "auto", health=None, slack=slack, crc=algorithm)
        with _told(node, len(text)) as show:
            report = bus.load(node, text, patience=patience, progress=show)
    pieces, repeats = counted(report.pieces, "piece"), counted(report.repeats, "repeat")
    click.echo(f"node {node}: {report.size} bytes in {pieces}, {repeats}, {report.seconds:.2f} s")


def _text(file: str) -> bytes:
    try:
        return read_hex(file).text
    except HexFileError as error:
        if isinstance(error.__cause__, OSError):
            raise Failure(str(error), USAGE) from None
        raise


@contextlib.contextmanager
def _told(node: int, total: int) -> Iterator[Show]:
    """Show the progress of a load; on failure report how much was acknowledged."""
    last = LoadProgress(0, total)
    bar = _bar if on_terminal(sys.stderr) else _lines

    def rest() -> str:
        return (
            f"node {node} has acknowledged {last.acknowledged} of {total} bytes and holds part of the "
            "program; load it again"
        )

    try:
        with bar(node, total) as show:

            def note(progress: LoadProgress) -> None:
                nonlocal last
                last = progress
                show(progress)

            yield note
    except KeyboardInterrupt:
        raise Failure(f"interrupted: {rest()}", INTERRUPTED) from None
    except PortLost as error:
        raise Failure(f"{error}; {rest()}", WRONG) from None


@contextlib.contextmanager
def _bar(node: int, total: int) -> Iterator[Show]:
    from rich.console import Console  # noqa: PLC0415  # only a terminal needs it
    from rich.progress import BarColumn, DownloadColumn, Progress, TextColumn, TimeRemainingColumn  # noqa: PLC0415

    columns = (TextColumn("{task.description}"), BarColumn(), DownloadColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task = progress.add_task(f"node {node}", total=total)
        yield lambda told: progress.update(task, completed=told.acknowledged)


@contextlib.contextmanager
def _lines(node: int, total: int) -> Iterator[Show]:
    shown = 0

    def show(told: LoadProgress) -> None:
        nonlocal shown
        if told.acknowledged * LINES // total > shown:
            shown = told.acknowledged * LINES // total
            click.echo(f"node {node}: {told.acknowledged} of {total} bytes", err=True)

    yield show
