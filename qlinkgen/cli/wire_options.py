"""Common parts of the port commands: options, node numbers, opening the port."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal, NamedTuple, TypeVar, cast

import click

from qlinkgen.cli.boundary import Failure
from qlinkgen.link.echo import PROBE, EchoMode
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.replacement import Replacement
from qlinkgen.model.values import whole_number
from qlinkgen.plan.framing import frame_plan
from qlinkgen.transport.opening import open_port
from qlinkgen.transport.port import Ability, Port
from qlinkgen.transport.traced import Hear, TracedPort

#: Speed of a port without line time, such as a pty; it has no effect.
ANY_SPEED = 115200


def seconds(context: click.Context, parameter: click.Parameter, text: str | None) -> float | None:  # noqa: ARG001
    """Parse a finite number of seconds, 0 or more; a callback of click."""
    if text is None:
        return None
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not 0 <= number < math.inf:
        raise Failure(f"{parameter.opts[-1]} {text}: not a number of seconds; give 0 or more, such as 0.05")
    return number


baud_option = click.option(
    "--baud",
    type=click.IntRange(1, 100_000_000),
    metavar="N",
    help="Speed of the line; by default that of the schema.",
)
attempts_option = click.option(
    "--attempts",
    type=click.IntRange(1, 1000),
    default=3,
    show_default=True,
    metavar="N",
    help="Most transmissions of a request, the first included.",
)
slack_option = click.option(
    "--slack",
    callback=seconds,
    metavar="SECONDS",
    help="Delay that this computer and the adapter may add to a response; by default derived from the port.",
)
echo_option = click.option(
    "--echo",
    type=click.Choice(["auto", "expect", "none"]),
    help="Whether the adapter echoes sent bytes; auto probes with two bytes 00, and is the default if frames "
    "begin with a preamble.",
)


A = TypeVar("A")
B = TypeVar("B")
Parity = Literal["none", "even", "odd"]


class Line(NamedTuple):
    """How to open a line: its byte format, and a function that is told of all bytes."""

    parity: Parity = "none"
    stop_bits: Literal[1, 2] = 1
    hear: Hear | None = None


parity_option = click.option(
    "--parity",
    type=click.Choice(["none", "even", "odd"]),
    default="none",
    show_default=True,
    help="Parity bit.",
)
stop_bits_option = click.option(
    "--stop-bits",
    type=click.Choice(["1", "2"]),
    default="1",
    show_default=True,
    help="Stop bits.",
)


def line_of(parity: Parity, stop_bits: str, hear: Hear | None = None) -> Line:
    """Return the byte format of the options."""
    return Line(parity, 2 if stop_bits == "2" else 1, hear)


def open_line(name: str, baud: int, line: Line = Line()) -> Port:  # noqa: B008  # immutable
    """Open a port. Raises PortError, and Failure for an invalid name."""
    try:
        port = open_port(name, baud=baud, parity=line.parity, stop_bits=line.stop_bits)
    except ValueError as error:
        raise Failure(str(error)) from None
    return port if line.hear is None else TracedPort(port, line.hear)


def open_usual(protocol: Protocol, name: str, baud: int | None, line: Line = Line()) -> Port:  # noqa: B008
    """Open a port at the given speed, or that of the schema; otherwise as `open_line`."""
    return open_line(name, speed(protocol, baud), line)


def open_free(protocol: Protocol, name: str, baud: int | None, line: Line = Line()) -> Port:  # noqa: B008
    """Open a port for a protocol without a standard speed, which a real line requires as an option.

    Raises PortError, and Failure if the speed is missing.
    """
    if baud is not None or protocol.bus.baud is not None:
        return open_usual(protocol, name, baud, line)
    port = open_line(name, ANY_SPEED, line)
    if port.capabilities.paced is Ability.NO:
        return port
    port.close()
    return open_usual(protocol, name, None, line)  # raises Failure for the missing speed


def speed(protocol: Protocol, given: int | None) -> int:
    """Return the given speed, else that of the schema."""
    baud = given or protocol.bus.baud
    if baud is None:
        raise Failure(f"the schema of {protocol.name} states no speed; add --baud N")
    return baud


def echo_mode(protocol: Protocol, given: str | None) -> EchoMode:
    """Return the given mode; else a probe, unless its bytes could begin a frame."""
    if given is not None:
        return cast(EchoMode, given)
    return "auto" if frame_plan(protocol.frame).skips(PROBE[:1]) else "none"


def counted(number: int, what: str) -> str:
    """``1 request``, ``2 requests``."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def with_crc(plain: A, choose: Callable[[str], B], crc: Replacement | None) -> A | B:
    """Return a shipped codec, with another CRC if one is given.

    Raises:
        Failure: the algorithm does not fit, or the coverage is given, which a codec cannot change.
    """
    if crc is not None and crc.over:
        raise Failure(
            f"{crc}: this uses the module of the package, whose checksum covers what its schema says; omit "
            "crc_over, or give the path of a copy of the schema with another `over`"
        )
    try:
        return plain if crc is None or crc.algorithm is None else choose(crc.algorithm)
    except ValueError as error:
        raise Failure(f"{crc}: {error}") from None


def parse_nodes(text: str, first: int, last: int, where: str = "--nodes") -> list[int]:
    """Parse node numbers such as 3, 1-16 or 1,3,5-7, given at `where`; return them in ascending order."""
    nodes: list[int] = []
    for part in text.split(","):
        low, dash, high = (piece.strip() for piece in part.partition("-"))
        begin, end = whole_number(low), whole_number(high) if dash else whole_number(low)
        if begin is None or end is None:
            raise Failure(
                f"{where} {text}: '{part.strip()}' is not a node; write for example 3, 1-16 or 1,3,5-7"
            )
        if not first <= begin <= end <= last:
            fix = f"nodes are {first}..{last}" if begin <= end else f"write {end}-{begin}"
            raise Failure(f"{where} {text}: {part.strip()} is out of range; {fix}")
        if double := set(nodes) & set(range(begin, end + 1)):
            raise Failure(f"{where} {text}: duplicate node {min(double)}; list each once")
        nodes += range(begin, end + 1)
    return sorted(nodes)
