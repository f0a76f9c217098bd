"""``qlinkgen shell``: talk to a bus line by line."""

from __future__ import annotations

import contextlib
import sys
from pathlib import Path

import click

from qlinkgen.cli.arguments import driven_protocol_argument, port_argument
from qlinkgen.cli.asking import Asking, asking_options, host_at, master_at
from qlinkgen.cli.boundary import FINE, WRONG, Failure
from qlinkgen.cli.codec import load_codec
from qlinkgen.cli.common import crc_option, load_protocol
from qlinkgen.cli.kinds import BUS, HOST, kind_of
from qlinkgen.cli.shell_lines import Lines, Reader, perform_all
from qlinkgen.cli.wire_options import attempts_option
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.replacement import Replacement
from qlinkgen.model.values import whole_number


@click.command("shell")
@driven_protocol_argument
@port_argument
@click.option(
    "--node",
    "--address",
    "node",
    metavar="N",
    help="The node of requests without one of their own, or what a host selects for them.",
)
@attempts_option
@asking_options
@crc_option
def command(  # noqa: PLR0917  # click passes them by name
    protocol: str,
    port: str,
    node: str | None,
    attempts: int,
    crc: Replacement | None,
    asking: Asking,
) -> int:
    """Send requests to a bus line by line, and print the responses with their units.

    A line is MESSAGE [@NODE] [FIELD=VALUE]..., with values as for encode, which may have the unit of their
    field; or a word that begins with a dot: .help lists them. On a terminal, the Tab key completes messages,
    fields and the names of values, and lines are kept for the next time; this needs the extra: pip install
    "qlinkgen[shell]". Otherwise lines are read from standard input.

    Exit code 1 if a line of standard input fails, or if the port is missing, busy or lost.

    \b
    qlinkgen shell qlink /dev/ttyUSB0 --node 3
    echo motor_position | qlinkgen shell qlink /dev/ttyUSB0 --node 3
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    loaded = load_protocol(protocol, crc)
    kind = kind_of(loaded)
    if kind not in {BUS, HOST}:
        raise Failure(f"shell requires a bus with a master, or a host; {loaded.name} has none")
    number = None if node is None else whole_number(node)
    if node is not None and number is None:
        raise Failure(f"--node {node}: not a whole number")
    codec = load_codec(loaded)
    with contextlib.ExitStack() as ended:
        if kind is HOST:
            host = ended.enter_context(host_at(port, loaded, codec, asking, attempts=attempts))
            lines = Lines(loaded, codec, host[1], number, host[0].rules)
        else:
            bus = ended.enter_context(master_at(port, loaded, codec, asking, attempts=attempts))
            lines = Lines(loaded, codec, bus[1], number)
        on_terminal = on_terminal_input()
        fine = perform_all(lines, _editor(loaded, lines) if on_terminal else _piped)
    return FINE if fine or on_terminal else WRONG


def on_terminal_input() -> bool:
    """Whether somebody types the lines."""
    return sys.stdin.isatty()


def _piped(_prompt: str) -> str:
    line = sys.stdin.readline()
    if not line:
        raise EOFError
    return line


def _editor(protocol: Protocol, lines: Lines) -> Reader:
    try:
        from qlinkgen.cli.shell_prompt import reader  # noqa: PLC0415  # an extra, for terminals
    except ImportError:
        raise Failure(
            'a terminal needs a line editor; pip install "qlinkgen[shell]", or pipe lines into the command'
        ) from None
    return reader(lines, Path(click.get_app_dir("qlinkgen")) / f"history-{protocol.name}")
