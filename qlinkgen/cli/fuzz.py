"""``qlinkgen fuzz``: send valid, wrong and damaged frames to a device under test, and judge what it does."""

from __future__ import annotations

from collections.abc import Sequence
from types import ModuleType

import click

from qlinkgen.cli import jsonlines
from qlinkgen.cli.arguments import driven_protocol_argument, port_argument
from qlinkgen.cli.asking import Asking, asking_options, master_at
from qlinkgen.cli.boundary import FINE, WRONG, Failure
from qlinkgen.cli.codec import load_codec
from qlinkgen.cli.common import addressed, crc_option, did_you_mean, load_protocol
from qlinkgen.cli.fuzz_cases import DAMAGED, VALID, Cases
from qlinkgen.cli.fuzz_cases import WRONG as WRONG_FRAME
from qlinkgen.cli.fuzz_run import RESULTS, Bench, Outcome, Tally
from qlinkgen.cli.kinds import BUS, HOST, kind_of
from qlinkgen.cli.stopping import StopSignals
from qlinkgen.cli.tables import Table
from qlinkgen.cli.wire_options import counted
from qlinkgen.link.codec import Framed, is_message
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.replacement import Replacement
from qlinkgen.model.transaction import Command
from qlinkgen.model.values import Json, whole_number
from qlinkgen.plan import plan_of


@click.command("fuzz")
@driven_protocol_argument
@port_argument
@click.option("--node", "--address", "node", metavar="N", help="The device under test.")
@click.option("--command", "names", metavar="NAME", multiple=True, help="Use only this command; repeatable.")
@click.option(
    "--all", "everything", is_flag=True, help="Also commands that are unsafe to repeat, and unknown commands."
)
@click.option("--count", type=click.IntRange(1), default=500, show_default=True, metavar="N", help="Frames.")
@click.option(
    "--seed", type=int, default=1, show_default=True, metavar="N", help="Another seed, other frames."
)
@click.option(
    "--case", "chosen", type=click.IntRange(0), multiple=True, metavar="N", help="Only these frames."
)
@click.option(
    "--json", "as_json", is_flag=True, help="Print one JSON object per finding, and one at the end."
)
@asking_options
@crc_option
def command(  # noqa: PLR0917  # click passes them by name
    protocol: str,
    port: str,
    node: str | None,
    names: tuple[str, ...],
    everything: bool,
    count: int,
    seed: int,
    chosen: tuple[int, ...],
    as_json: bool,
    crc: Replacement | None,
    asking: Asking,
) -> int:
    """Send valid, wrong and damaged frames to a device, and report what it does wrong.

    A valid request, often with values at the ends of their ranges, must be answered or refused. A wrong frame
    (a value out of range, a byte too many, a wrong check value) and a damaged one (a bit flipped, a byte
    lost) must be refused or met with silence, and the request after it must be answered.

    Findings are: silent, wrong answer (to a valid request); accepted, garbage (a response, or other bytes, to
    a frame that is none); lost (no answer to so many requests that they fill the longest frame twice: the
    command ends). A device that misses the first requests after a frame, for example because it waits for the
    rest of a cut one, is slow to recover; that is counted, and no finding.

    Only commands are used that the schema calls safe to repeat; their values are not spared, so use a device
    that may do anything. The number of the command is changed only with --all; a device that does not look
    at check values may still take a damaged frame for another one. The same seed gives the same frames; a
    finding names its case, which --case sends alone.

    Exit code 1 if there is a finding, or if the port is missing, busy or lost.

    \b
    qlinkgen fuzz qlink /dev/ttyUSB0 --node 3
    qlinkgen fuzz modbus_rtu /dev/ttyUSB0 --node 1 --command read_holding_registers --count 2000 --seed 7
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    loaded = load_protocol(protocol, crc)
    if (kind := kind_of(loaded)) is HOST:
        raise Failure(
            f"fuzz requires frames that can be wrong; packets of {loaded.name} have no check value, so that "
            "damaged ones are other requests"
        )
    if kind is not BUS:
        raise Failure(f"fuzz requires a bus with a master, and {loaded.name} is not one")
    commands = _commands(loaded, names, everything=everything)
    address = _address(loaded, commands, node)
    codec = load_codec(loaded)
    cases = Cases(plan_of(loaded), codec, commands, address, seed, everything=everything)
    with master_at(port, loaded, codec, asking) as (engine, master):
        probe = _probe(codec, cases)
        bench = Bench(engine, master, probe)
        if not bench.is_there():
            raise Failure(f"the device does not answer {probe.NAME}; check it with `qlinkgen send`", WRONG)
        return _run(bench, cases, chosen or range(count), as_json=as_json)


def usable(command: Command) -> bool:
    """Whether a command is one request to a node with one answer."""
    plain = not command.steps and command.many is None and command.response is not None
    return plain and command.asker != "second" and command.addressing != "broadcast"


def _commands(protocol: Protocol, names: Sequence[str], *, everything: bool) -> list[Command]:
    known = {each.name: each for each in protocol.commands if usable(each)}
    safe = {name: each for name, each in known.items() if everything or each.repeat.safe}
    for name in names:
        if name not in known:
            hint = did_you_mean(name, known) or f"`qlinkgen show {protocol.name}` lists the commands"
            raise Failure(f"--command {name}: no command of {protocol.name} with one answer; {hint}")
        if name not in safe:
            raise Failure(f"--command {name}: unsafe to repeat, as the schema says; add --all to use it")
    if not safe:
        raise Failure(
            f"{protocol.name} has no command that is safe to repeat and has one answer; --all uses the others"
        )
    return [safe[name] for name in names] if names else list(safe.values())


def _address(protocol: Protocol, commands: Sequence[Command], given: str | None) -> int | None:
    """Return the address of the device."""
    if not any(addressed(protocol, each.request) for each in commands):
        if given is not None:
            raise Failure(f"{protocol.name} has no address in its frame; omit --node {given}")
        return None
    if protocol.bus.nodes is None:
        raise Failure(f"{protocol.name} does not say which nodes there are, so none can be tested")
    first, last = protocol.bus.nodes
    number = whole_number(given) if given is not None else None
    if number is None or not first <= number <= last:
        seen = "no device is given" if given is None else f"{given} is not a node"
        raise Failure(f"--node: {seen}; nodes are {first}..{last}")
    return number


def _probe(codec: ModuleType, cases: Cases) -> Framed:
    decoder = codec.StreamDecoder("request")
    found = (*decoder.feed(cases.probe), *decoder.finish())
    return next(filter(is_message, found))


def _run(bench: Bench, cases: Cases, numbers: Sequence[int], *, as_json: bool) -> int:
    tally = Tally()
    with StopSignals() as signals:
        for number in numbers:
            outcome = bench.run(cases.draw(number))
            tally.add(outcome)
            if outcome.finding:
                _show(outcome, as_json=as_json)
            if outcome.finding == "lost" or signals.stopped:
                break
    if as_json:
        results: dict[str, Json] = {
            f"{kind} {result}": size for (kind, result), size in sorted(tally.results.items())
        }
        total = sum(tally.results.values())
        summary: dict[str, Json] = {
            "cases": total,
            "findings": tally.findings,
            "slow": tally.slow,
            "results": results,
        }
        click.echo(jsonlines.line(summary))
    else:
        _table(tally).show()
        click.echo(f"{counted(tally.findings, 'finding')}, {tally.slow} slow to recover")
    return WRONG if tally.findings else FINE


def _show(outcome: Outcome, *, as_json: bool) -> None:
    case = outcome.case
    if as_json:
        click.echo(
            jsonlines.line(
                {
                    "finding": outcome.finding,
                    "case": case.number,
                    "kind": case.kind,
                    "command": case.command,
                    "what": case.what,
                    "frame": case.wire.hex(),
                    "received": outcome.received.hex(),
                }
            )
        )
        return
    received = f", received {outcome.received.hex()}" if outcome.received else ""
    what = f"{case.kind} {case.command}, {case.what}: {case.wire.hex()}{received}"
    click.echo(f"case {case.number}: {outcome.finding}: {what}")


def _table(tally: Tally) -> Table:
    table = Table(["frames", "sent", *RESULTS], right=frozenset({"sent", *RESULTS}))
    for kind in (VALID, WRONG_FRAME, DAMAGED):
        counts = [tally.results[kind, result] for result in RESULTS]
        table.add(kind, sum(counts), *(each or None for each in counts))
    return table
