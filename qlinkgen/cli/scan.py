"""``qlinkgen scan``: find the nodes of a bus."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from types import ModuleType

import click

from qlinkgen.cli import jsonlines
from qlinkgen.cli.arguments import (
    assignments_argument,
    driven_protocol_argument,
    message_argument,
    port_argument,
)
from qlinkgen.cli.asking import Asking, asking_options, master_at
from qlinkgen.cli.boundary import FINE, WRONG, Failure
from qlinkgen.cli.codec import fields, load_codec
from qlinkgen.cli.common import crc_option, load_protocol, on_terminal, warn
from qlinkgen.cli.decode import message_record
from qlinkgen.cli.encode import compose
from qlinkgen.cli.kinds import BUS, kind_of
from qlinkgen.cli.send_bus import check_request
from qlinkgen.cli.tables import Table
from qlinkgen.cli.wire_options import parse_nodes
from qlinkgen.link.codec import Framed
from qlinkgen.link.events import Event, Sent
from qlinkgen.link.survey import Present, survey
from qlinkgen.model.naming import record_key
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.replacement import Replacement
from qlinkgen.model.transaction import Command
from qlinkgen.model.values import Json
from qlinkgen.protocols.registry import support_of
from qlinkgen.protocols.support import Question

#: More nodes are asked only if they are given: each silent one takes a deadline.
MOST = 256


@click.command("scan")
@driven_protocol_argument
@port_argument
@message_argument
@assignments_argument
@click.option("--nodes", metavar="LIST", help="Nodes to ask: 3, 1-16 or 1,3,5-7; by default all.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per line instead of a table.")
@asking_options
@crc_option
def command(  # noqa: PLR0917  # click passes them by name
    protocol: str,
    port: str,
    message: str | None,
    assignments: tuple[str, ...],
    nodes: str | None,
    as_json: bool,
    crc: Replacement | None,
    asking: Asking,
) -> int:
    """Ask every node of a bus with one request, and print those that answer.

    MESSAGE is the request, with values as for encode. By default it is the shortest request without values
    that may be repeated and is answered with values; for qlink, node_info and then loop_back.

    Silent nodes are asked again after all others. The time is that from request to response. A node that
    refuses the request is there too. A node is garbled if the bytes received are not an answer: two nodes
    have its number, or the speed is wrong. With --json, a response is an object as printed by decode, with
    "seconds"; a garbled node has "garbled" in place of a message.

    Exit code 1 if no node answers clearly, or if the port is missing, busy or lost.

    \b
    qlinkgen scan qlink /dev/ttyUSB0
    qlinkgen scan qlink /dev/ttyUSB0 --nodes 1-4 --json
    qlinkgen scan modbus_rtu /dev/ttyUSB0 read_holding_registers start=0 quantity=1 --nodes 1-32 --baud 9600
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    loaded = load_protocol(protocol, crc)
    numbers = _numbers(loaded, nodes)
    codec = load_codec(loaded)
    questions = [(message, assignments)] if message else questions_of(protocol, loaded)
    asked = [_asker(loaded, codec, question, numbers[0]) for question in questions]
    with (
        _progress() as show,
        master_at(port, loaded, codec, asking, on_event=show) as (_, master),
    ):
        found = master.run(survey(numbers, (asked[0], *asked), lambda each: each))
    if not found:
        look = f"`qlinkgen doctor {protocol} {port}`"
        warn(f"no node answers on {port}; check power, wiring and --baud, and {look}")
        return WRONG
    if as_json:
        click.echo("\n".join(jsonlines.line(_record(loaded, each)) for each in found))
    else:
        _table(loaded, found).show()
    return WRONG if all(each.garbled for each in found) else FINE


def _numbers(protocol: Protocol, text: str | None) -> list[int]:
    """Return the nodes to ask."""
    nodes = protocol.bus.nodes
    if kind_of(protocol) is not BUS or protocol.address_name is None or nodes is None:
        raise Failure(f"the frames of {protocol.name} have no address of a node: there is nothing to scan")
    if text is not None:
        return parse_nodes(text, *nodes)
    first, last = nodes
    if last - first >= MOST:
        raise Failure(f"nodes of {protocol.name} are {first}..{last}; pass --nodes LIST for some of them")
    return list(range(first, last + 1))


def questions_of(name: str, protocol: Protocol) -> Sequence[Question]:
    """Return the requests that every node of a PROTOCOL may be asked without consequences."""
    if written := support_of(protocol).questions():
        return written
    known = [each for each in protocol.commands if _is_question(each)]
    if not known:
        raise Failure(
            f"{protocol.name} has no request without values that may be repeated and is answered with values:"
            f" give MESSAGE, one of those in `qlinkgen show {name}`"
        )
    chosen = min(known, key=_size).name
    click.echo(f"qlinkgen: asking with {chosen}", err=True)
    return [(chosen, ())]


def _is_question(command: Command) -> bool:
    """Whether a command only reads, as far as a schema tells: nothing is set, and values are returned."""
    if not command.repeat.safe or command.asker == "second" or command.addressing == "broadcast":
        return False
    if command.steps or command.many is not None or command.request.values:
        return False
    return command.response is not None and bool(command.response.values)


def _size(command: Command) -> int:
    return sum(message.max_size for message in (command.request, command.response) if message)


def _asker(protocol: Protocol, codec: ModuleType, question: Question, node: int) -> Callable[[int], Framed]:
    """Return a function that makes a request to a node. The values are checked with the first node."""
    name, values = question

    def ask(to: int) -> Framed:
        request: Framed = compose(protocol, name, values, (str(to),), None, codec=codec)[2]
        return request

    check_request(protocol, compose(protocol, name, values, (str(node),), None, codec=codec)[1])
    command = next((each for each in protocol.commands if each.request.name == ask(node).NAME), None)
    if command is None or command.response is None:
        raise Failure(f"{name} is not answered, so it finds no node; give a request with a response")
    return ask


@contextlib.contextmanager
def _progress() -> Iterator[Callable[[Event], None]]:
    """Show the current node on a terminal."""
    if not on_terminal(sys.stderr):
        yield lambda _: None
        return
    from rich.console import Console  # noqa: PLC0415  # only a terminal needs it

    with Console(stderr=True).status("looking for nodes") as status:
        yield partial(_show, lambda node: status.update(f"looking for nodes: {node}"))


def _show(show: Callable[[int | None], None], event: Event) -> None:
    if isinstance(event, Sent):
        show(event.node)


def _record(protocol: Protocol, found: Present) -> dict[str, Json]:
    seconds: dict[str, Json] = {"seconds": round(found.seconds, 6)}
    if found.answer is None:
        return {record_key(protocol.address_name or ""): found.node, "garbled": True, **seconds}
    return {**message_record(protocol, found.answer), **seconds}


def _table(protocol: Protocol, found: Sequence[Present]) -> Table:
    values = [_values(protocol, each) for each in found]
    columns = list(dict.fromkeys(name for each in values for name in each))
    table = Table(
        ["node", *columns, "answer time", "note"], right=frozenset({"node", *columns, "answer time"})
    )
    for each, own in zip(found, values, strict=True):
        time = None if each.garbled else f"{each.seconds * 1000:.2f} ms"
        table.add(each.node, *(own.get(name) for name in columns), time, _note(each))
    return table


def _values(protocol: Protocol, found: Present) -> dict[str, str]:
    """Return the fields of an answer as text."""
    if found.answer is None or found.refused:
        return {}
    values = fields(protocol.by_name[found.answer.NAME], found.answer)
    return {
        name: value if isinstance(value, str) else jsonlines.line(value) for name, value in values.items()
    }


def _note(found: Present) -> str | None:
    if found.answer is None:
        return "garbled: two nodes with this number, or a wrong --baud"
    return f"refused by {found.answer.NAME}" if found.refused else None
