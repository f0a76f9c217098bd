"""``qlinkgen budget``: the duration of a cycle of requests, and its share of the line, from the schema."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict

import click

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.vectors.choice import MINIMUM
from qlinkgen.cli import jsonlines
from qlinkgen.cli.arguments import protocol_argument
from qlinkgen.cli.boundary import FINE, WRONG, Failure
from qlinkgen.cli.codec import load_codec
from qlinkgen.cli.common import crc_option, did_you_mean, load_protocol
from qlinkgen.cli.completion import loaded_of, message_items
from qlinkgen.cli.kinds import BUS, kind_of
from qlinkgen.cli.tables import Table
from qlinkgen.cli.wire_options import attempts_option, baud_option, parse_nodes, seconds, speed
from qlinkgen.link.codec import Codec, Command
from qlinkgen.link.timing import Timing
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.replacement import Replacement
from qlinkgen.plan import plan_of
from qlinkgen.plan.codec import Codec as Frames


@dataclass(frozen=True, slots=True)
class Load:
    """What one transaction costs, in seconds, and its nodes together, as a share (0..1 and above).

    Attributes:
        bytes: request and answer on the wire.
        on_wire: duration of those.
        transaction: duration until the next one may begin.
        line: share of the line.
        time: share of the time.
    """

    bytes: int
    on_wire: float
    transaction: float
    line: float
    time: float


@dataclass(frozen=True, slots=True)
class Turn:
    """One request to some nodes.

    Attributes:
        command: name of the command.
        nodes: number of nodes.
        period: seconds from one request to the next to the same node.
        least: with the shortest messages and an immediate answer.
        most: with the longest messages and all the time that the schema allows.
        silent: seconds of a node that does not answer, with all attempts.
    """

    command: str
    nodes: int
    period: float
    least: Load
    most: Load
    silent: float


@click.command("budget")
@protocol_argument
@click.argument(
    "turns",
    metavar="[NODES:]COMMAND=SECONDS...",
    nargs=-1,
    required=True,
    shell_complete=lambda context, _, incomplete: completed(context, incomplete),
)
@baud_option
@click.option(
    "--slack",
    callback=seconds,
    default="0",
    show_default=True,
    metavar="SECONDS",
    help="Delay that computer and adapter add to each transaction; `qlinkgen doctor` reports it for a port.",
)
@attempts_option
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of text.")
@crc_option
def command(  # noqa: PLR0917  # click passes them by name
    protocol: str,
    turns: tuple[str, ...],
    baud: int | None,
    slack: float,
    attempts: int,
    as_json: bool,
    crc: Replacement | None,
) -> int:
    """Compute how long a cycle of periodic requests takes, and how much of the line it uses.

    A turn is a command with its period, and the nodes that are asked: 3, 1-16 or 1,3,5-7; without nodes where
    frames have no address. The lower numbers are for the shortest messages and immediate answers, the upper
    ones for the longest messages, stuffing included, and all the time that the schema allows.

    The cycle is the time to ask every node everything once: no request is later than that. A node that does
    not answer costs the time of its column; `bus.poll` asks it less often then. Exit code 1 if the
    requests may not fit into their periods.

    \b
    qlinkgen budget qlink 1-4:motion=0.02 1-4:read=0.5
    qlinkgen budget modbus_rtu 1:read_coils=0.1 --baud 19200 --slack 0.002
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    loaded = load_protocol(protocol, crc)
    if kind_of(loaded) is not BUS or not loaded.commands:
        raise Failure(f"{loaded.name} has no master that asks, so it has no cycle")
    codec: Codec = load_codec(loaded)
    timing = Timing.of(codec, baud=speed(loaded, baud), host_slack=slack, attempts=attempts)
    frames = Frames(plan_of(loaded))
    found = [_turn(loaded, frames, codec, timing, text) for text in turns]
    if as_json:
        totals = {name: asdict(total) for name, total in (("least", _least(found)), ("most", _most(found)))}
        rows = [asdict(each) for each in found]
        click.echo(jsonlines.line({"baud": timing.baud, **totals, "turns": rows}))
    else:
        _show(found, timing.baud)
    return FINE if _most(found).time <= 1 else WRONG


@dataclass(frozen=True, slots=True)
class Total:
    """All turns: seconds to ask every node everything once, shares of the line and of the time."""

    cycle: float
    line: float
    time: float


def _total(turns: Sequence[Turn], loads: Sequence[Load]) -> Total:
    cycle = sum(turn.nodes * load.transaction for turn, load in zip(turns, loads, strict=True))
    return Total(cycle, sum(each.line for each in loads), sum(each.time for each in loads))


def _least(turns: Sequence[Turn]) -> Total:
    return _total(turns, [each.least for each in turns])


def _most(turns: Sequence[Turn]) -> Total:
    return _total(turns, [each.most for each in turns])


def _turn(protocol: Protocol, frames: Frames, codec: Codec, timing: Timing, text: str) -> Turn:
    where, name, period = _parts(text)
    if name not in codec.COMMANDS:
        hint = did_you_mean(name, codec.COMMANDS) or f"`qlinkgen show {protocol.name}` lists the commands"
        raise Failure(f"{text}: {protocol.name} has no command '{name}'; {hint}")
    command = codec.COMMANDS[name]
    if command.steps or command.many is not None:
        raise Failure(f"{text}: the duration of {name} depends on its answers; give requests with one answer")
    nodes = _nodes(protocol, command, where, text)
    sizes = _shortest(frames, command), _longest(command)
    waits = timing.gap(command) if command.response is None else timing.allowance(command)
    least, most = (
        _load(timing, size, nodes / period, wait) for size, wait in zip(sizes, (0.0, waits), strict=True)
    )
    silent = timing.attempts_of(command) * (most.transaction + timing.quiet) if command.response else 0.0
    return Turn(name, nodes, period, least, most, silent)


def _load(timing: Timing, size: int, rate: float, wait: float) -> Load:
    """Return the cost of a transaction that is begun so often a second."""
    on_wire = timing.on_wire(size)
    transaction = on_wire + wait + timing.slack
    return Load(size, on_wire, transaction, rate * on_wire, rate * transaction)


def _longest(command: Command) -> int:
    answers = [
        each for each in (command.response, *(reply.message for reply in command.replies.values())) if each
    ]
    return command.request.MAX_WIRE_SIZE + max((each.MAX_WIRE_SIZE for each in answers), default=0)


def _shortest(frames: Frames, command: Command) -> int:
    """Return the size of the request and the response with as few items as possible."""
    names = [each.NAME for each in (command.request, command.response) if each]
    messages = [frames.plan.message(name) for name in names]
    return sum(
        len(frames.encode(each.name, {**MINIMUM.values(each.payload), **MINIMUM.beside(each.envelope)}))
        for each in messages
    )


def _parts(text: str) -> tuple[str, str, float]:
    """Split NODES:COMMAND=SECONDS."""
    asked, mark, number = text.partition("=")
    where, _, name = asked.rpartition(":")
    try:
        period = float(number)
    except ValueError:
        period = math.nan
    if not mark or not name or not 0 < period < math.inf:
        raise Failure(f"'{text}' is not NODES:COMMAND=SECONDS; write for example 1-4:get_status=0.5")
    return where, name, period


def _nodes(protocol: Protocol, command: Command, where: str, text: str) -> int:
    """Return how many nodes are asked."""
    if protocol.bus.nodes is None or not command.request.ADDRESS or command.addressing == "broadcast":
        if where:
            raise Failure(f"{text}: {command.name} has no node to be sent to; omit {where}:")
        return 1
    if not where:
        raise Failure(f"{text}: {command.name} is sent to a node; write for example 3:{text}")
    return len(parse_nodes(where, *protocol.bus.nodes, f"{command.name}: nodes"))


def _show(turns: Sequence[Turn], baud: int) -> None:
    right = ("nodes", "period", "bytes", "on the wire", "transaction", "silent node", "line", "time")
    table = Table(["command", *right], f"At {baud} baud", right=frozenset(right))
    for each in turns:
        least, most = each.least, each.most
        table.add(
            each.command,
            each.nodes,
            _ms(each.period),
            f"{least.bytes}..{most.bytes}",
            f"{least.on_wire * 1000:.2f}..{_ms(most.on_wire)}",
            f"{least.transaction * 1000:.2f}..{_ms(most.transaction)}",
            _ms(each.silent) if each.silent else None,
            f"{least.line * 100:.1f}..{most.line:.1%}",
            f"{least.time * 100:.1f}..{most.time:.1%}",
        )
    table.show()
    fastest, slowest = _least(turns), _most(turns)
    cycle = f"{fastest.cycle * 1000:.2f}..{_ms(slowest.cycle)}"
    line = f"{fastest.line * 100:.1f}..{slowest.line:.1%}"
    time = f"{fastest.time * 100:.1f}..{slowest.time:.1%}"
    click.echo(f"cycle {cycle}; line {line}, time {time}")
    if slowest.time > 1:
        when = (
            "with the longest messages and latest answers"
            if fastest.time <= 1
            else "even with the shortest messages"
        )
        click.echo(f"the requests do not fit into their periods {when}; ask less often or fewer nodes")


def _ms(number: float) -> str:
    return f"{number * 1000:.2f} ms"


def completed(context: click.Context, incomplete: str) -> list[str]:
    """Complete the command of a turn."""
    protocol = loaded_of(context)
    where, mark, begun = incomplete.rpartition(":")
    if protocol is None:
        return []
    names = {each.name for each in protocol.commands}
    items = [each.value for each in message_items(protocol, begun) if each.value in names]
    return [f"{where}{mark}{name}=" for name in items]
