"""``qlinkgen load``: load a program into a node, in the pieces of a command of any schema."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import click

from qlinkgen.cli.arguments import driven_protocol_argument, port_argument
from qlinkgen.cli.asking import Asking, asking_options, master_at
from qlinkgen.cli.boundary import INTERRUPTED, USAGE, WRONG, Failure
from qlinkgen.cli.codec import load_codec
from qlinkgen.cli.common import addressed, crc_option, did_you_mean, load_protocol, on_terminal
from qlinkgen.cli.kinds import BUS, kind_of
from qlinkgen.cli.wire_options import attempts_option, counted, seconds
from qlinkgen.errors import HexFileError, PortLost
from qlinkgen.link.codec import Framed
from qlinkgen.link.loading import LoadProgress, Pieces, load
from qlinkgen.model.naming import address_attribute, attribute
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.replacement import Replacement
from qlinkgen.model.values import whole_number
from qlinkgen.plan.uploads import NoUpload, Upload, upload_of
from qlinkgen.protocols.hexfile import MOST_TEXT, read_hex

Show = Callable[[LoadProgress], None]

#: Number of progress lines if the output is not a terminal.
LINES = 10


@click.command("load")
@driven_protocol_argument
@port_argument
@click.argument("file", metavar="FILE", type=click.Path())
@click.option("--node", metavar="N", help="Node to load; omit it if frames have no address.")
@click.option(
    "--command",
    "name",
    metavar="COMMAND",
    default="",
    help="Command that carries the pieces; by default the only one that can.",
)
@click.option("--raw", is_flag=True, help="Send the bytes of any FILE, not the text of an Intel HEX file.")
@click.option(
    "--patience",
    default="5",
    show_default=True,
    callback=seconds,
    metavar="SECONDS",
    help="Time limit for each piece.",
)
@attempts_option
@asking_options
@crc_option
def command(  # noqa: PLR0917  # click passes them by name
    protocol: str,
    port: str,
    file: str,
    node: str | None,
    name: str,
    raw: bool,
    patience: float,
    attempts: int,
    asking: Asking,
    crc: Replacement | None,
) -> None:
    """Load a program into a node, in numbered pieces.

    The pieces are requests of a command with one field of bytes and the counter that `repeat: {counter: ..}`
    names in the schema. If its request may be empty, an empty one comes first.

    An Intel HEX file is checked before anything is sent: records, checksums, overlaps, end. If an
    acknowledgement is lost, the piece is sent again, and the node does not store it twice. An interrupted
    load leaves part of the program in the node; the next load starts over.

    Exit code 1 if the file is wrong, a piece is not acknowledged, or the port is missing, busy or lost.

    \b
    qlinkgen load qlink /dev/ttyUSB0 --node 3 program.hex
    qlinkgen load pump.yaml /dev/ttyUSB0 image.bin --raw --command write_flash
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    loaded = load_protocol(protocol, crc)
    upload = _upload(loaded, name)
    number = _number(loaded, upload, node)
    program = _bytes(file) if raw else _text(file)
    codec = load_codec(loaded)
    who = "device" if number is None else f"node {number}"
    pieces = _pieces(loaded, codec, upload, number)
    with (
        master_at(port, loaded, codec, asking, attempts=attempts) as (_, master),
        _told(who, len(program)) as show,
    ):
        report = master.run(load(program, pieces, patience=patience), show)
    number_of, repeats = counted(report.pieces, "piece"), counted(report.repeats, "repeat")
    click.echo(f"{who}: {report.size} bytes in {number_of}, {repeats}, {report.seconds:.2f} s")


def _upload(protocol: Protocol, name: str) -> Upload:
    if kind_of(protocol) is not BUS:
        raise Failure(
            f"{protocol.name} is of bus kind {protocol.bus.kind}, and pieces of a program are "
            "acknowledged by the node of a master; bus: {kind: master_slave} or link says so"
        )
    try:
        return upload_of(protocol, name)
    except NoUpload as fault:
        raise Failure(str(fault)) from None
    except KeyError:
        hint = did_you_mean(name, [each.name for each in protocol.commands])
        fix = hint or f"`qlinkgen show {protocol.name}` lists the commands"
        raise Failure(f"--command {name}: {protocol.name} has no such command; {fix}") from None


def _number(protocol: Protocol, upload: Upload, text: str | None) -> int | None:
    """Return the address of the node, None if frames have none."""
    if protocol.bus.nodes is None or not addressed(protocol, upload.command.request):
        if text is not None:
            raise Failure(f"the frames of {protocol.name} have no address; omit --node {text}")
        return None
    first, last = protocol.bus.nodes
    if text is None:
        raise Failure(f"the program is for one node of {protocol.name}; add --node N, {first}..{last}")
    node = whole_number(text)
    if node is None or not first <= node <= last:
        raise Failure(f"--node {text}: not a node; nodes are {first}..{last}")
    return node


def _pieces(protocol: Protocol, codec: ModuleType, upload: Upload, node: int | None) -> Pieces:
    made = codec.MESSAGES[upload.command.request.name]
    to = {} if node is None else {address_attribute(protocol.address_name or ""): node}
    counter, data = attribute(upload.counter), attribute(upload.data)

    def make(number: int, piece: bytes) -> Framed:
        request: Framed = made(**to, **{counter: number, data: piece})
        return request

    return Pieces(make, upload.numbers, upload.piece, make(0, b"") if upload.opened else None, node)


def _bytes(file: str) -> bytes:
    try:
        with Path(file).open("rb") as stream:
            content = stream.read(MOST_TEXT + 1)
    except OSError as error:
        raise Failure(f"{file}: {error.strerror or error}; pass a readable file") from None
    if not content:
        raise Failure(f"{file}: empty, so nothing to load", WRONG)
    if len(content) > MOST_TEXT:
        raise Failure(f"{file}: more than {MOST_TEXT} bytes; is this a program?", WRONG)
    return content


def _text(file: str) -> bytes:
    try:
        return read_hex(file).text
    except HexFileError as error:
        if isinstance(error.__cause__, OSError):
            raise Failure(str(error), USAGE) from None
        raise


@contextlib.contextmanager
def _told(who: str, total: int) -> Iterator[Show]:
    """Show the progress of a load; on failure report how much was acknowledged."""
    last = LoadProgress(0, total)
    bar = _bar if on_terminal(sys.stderr) else _lines

    def rest() -> str:
        return (
            f"{who} has acknowledged {last.acknowledged} of {total} bytes and holds part of the "
            "program; load it again"
        )

    try:
        with bar(who, total) as show:

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
def _bar(who: str, total: int) -> Iterator[Show]:
    from rich.console import Console  # noqa: PLC0415  # only a terminal needs it
    from rich.progress import BarColumn, DownloadColumn, Progress, TextColumn, TimeRemainingColumn  # noqa: PLC0415

    columns = (TextColumn("{task.description}"), BarColumn(), DownloadColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task = progress.add_task(who, total=total)
        yield lambda told: progress.update(task, completed=told.acknowledged)


@contextlib.contextmanager
def _lines(who: str, total: int) -> Iterator[Show]:
    shown = 0

    def show(told: LoadProgress) -> None:
        nonlocal shown
        if told.acknowledged * LINES // total > shown:
            shown = told.acknowledged * LINES // total
            click.echo(f"{who}: {told.acknowledged} of {total} bytes", err=True)

    yield show
