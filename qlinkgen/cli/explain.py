"""``qlinkgen explain``: every byte of one frame, and what is wrong with it."""

from __future__ import annotations

import click

from qlinkgen.cli.anatomy import Anatomy
from qlinkgen.cli.boundary import FINE, WRONG, Failure
from qlinkgen.cli.common import crc_option, load_protocol, on_terminal, parse_hex
from qlinkgen.cli.explain_delimited import explain_delimited
from qlinkgen.cli.explain_marked import explain_marked
from qlinkgen.cli.explain_packet import explain_packet
from qlinkgen.cli.tables import Table, heading, paragraph
from qlinkgen.model.frame import MarkedFrame, PacketFrame
from qlinkgen.model.message import Direction
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.texts import one_line


@click.command("explain")
@click.argument("protocol")
@click.argument("hex_", metavar="HEX...", nargs=-1, required=True)
@click.option(
    "--direction", type=click.Choice(["request", "response"]), help="What the frame is; guessed by its size."
)
@click.option(
    "--request", "request", metavar="HEX", help="Packets: the request; HEX is then its response alone."
)
@crc_option
def command(
    protocol: str, hex_: tuple[str, ...], direction: Direction | None, request: str | None, crc: str | None
) -> int:
    """Say what every byte of one frame is. If something is wrong: the rule that broke, and the likely cause.

    For a checksum that does not fit, the other algorithms of the catalogue, byte orders and coverages are
    tried. Exit code 1 if anything is wrong.

    \b
    qlinkgen explain qlink a5a50783 01a500ffa500e305
    qlinkgen explain mc1231a 4a 0012d687d6e3
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    loaded = load_protocol(protocol, crc)
    data = parse_hex(" ".join(hex_))
    if not data:
        raise Failure("HEX is empty; give the bytes of one frame")
    anatomy = _explain(loaded, data, direction, request)
    _show(anatomy)
    return WRONG if anatomy.findings else FINE


def _explain(protocol: Protocol, data: bytes, direction: Direction | None, request: str | None) -> Anatomy:
    if isinstance(protocol.frame, PacketFrame):
        if direction == "response" and request is None:
            raise Failure("a response alone cannot be told apart; give its request with --request HEX")
        return explain_packet(protocol, data, None if request is None else parse_hex(request, "--request"))
    if request is not None:
        raise Failure("--request goes with packet protocols; leave it out")
    if isinstance(protocol.frame, MarkedFrame):
        return explain_marked(protocol, data)
    return explain_delimited(protocol, data, direction)


def _show(anatomy: Anatomy) -> None:
    heading(anatomy.title)
    table = Table(["offset", "byte", "part", "value", ""], "", frozenset({"offset"}))
    for offset, byte, part, value, wrong in anatomy.lines():
        table.add(offset if byte else "", byte, part, value, "<- wrong" if wrong else "")
    table.show()
    paragraph([f"note: {note}" for note in anatomy.notes])
    for finding in anatomy.findings:
        label = click.style("wrong:", fg="red", bold=True) if on_terminal() else "wrong:"
        click.echo(f"{label} {one_line(finding.rule)}")
        if finding.cause:
            click.echo(f"likely: {one_line(finding.cause)}")
    if not anatomy.findings:
        click.echo("every rule is kept")
