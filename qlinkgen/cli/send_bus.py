"""``qlinkgen send`` on a bus with a master: one transaction."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from contextlib import closing
from types import ModuleType
from typing import cast

import click

from qlinkgen.cli import jsonlines
from qlinkgen.cli.boundary import FINE, Failure
from qlinkgen.cli.common import warn
from qlinkgen.cli.decode import message_record
from qlinkgen.cli.encode import compose
from qlinkgen.cli.repeating import answers_of, repeat
from qlinkgen.cli.stopping import StopSignals
from qlinkgen.cli.wire_options import Line, counted, echo_mode, open_line, speed
from qlinkgen.errors import LinkError, Refused
from qlinkgen.link.codec import Framed, Module
from qlinkgen.link.dialogue import Dialogue
from qlinkgen.link.events import Event, Stray
from qlinkgen.link.gaps import break_of
from qlinkgen.link.master import MasterEngine
from qlinkgen.link.transaction import Accepts, Question, Reply
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.transport.blocking import BlockingMaster
from qlinkgen.transport.conversation import timing_of
from qlinkgen.transport.port import Ability, Port


def send_on_bus(
    protocol: Protocol,
    codec: ModuleType,
    request: Framed,
    port: str,
    *,
    further: Sequence[Framed],
    baud: int | None,
    line: Line,
    attempts: int,
    slack: float | None,
    echo: str | None,
    accepts: Mapping[str, Accepts] | None,
    count: int | None,
    every: float | None,
) -> int:
    """Send a request and print the response; send a message outside commands without waiting.

    ``further`` are the frames of a dialogue after the request; ``count`` of endless answers are printed, None
    for all of them. With ``every``, the request is sent again after so many seconds, ``count`` times.
    Returns the exit code.
    """
    endless = {command.request.name for command in protocol.commands if command.stopped}
    _check_repetition(protocol, request, every, count, endless)
    with open_line(port, speed(protocol, baud), line) as opened:
        if request.NAME not in {command.request.name for command in protocol.commands}:
            byte_time = codec.BUS.bits_per_byte / opened.baud
            _tell(opened, request.to_frame(), byte_time, break_of(cast("Module", codec), byte_time))
            click.echo(f"qlinkgen: {request.NAME} sent; it has no response", err=True)
            return FINE
        timing = timing_of(codec, opened, slack=slack, attempts=attempts)
        engine = MasterEngine(codec, timing, echo=echo_mode(protocol, echo), accepts=accepts)
        if every is not None:
            return repeat(protocol, BlockingMaster(engine, opened), codec, request, period=every, count=count)
        try:
            if request.NAME in endless:
                _follow(protocol, BlockingMaster(engine, opened), request, count)
                return FINE
            question = Dialogue(request, further) if further else request
            reply = _transact(protocol, BlockingMaster(engine, opened), question)
        except Refused as refusal:
            click.echo(jsonlines.line(message_record(protocol, cast("Framed", refusal.reply))))
            raise
    for answer in answers_of(reply.response):
        click.echo(jsonlines.line(message_record(protocol, answer)))
    return FINE


def _check_repetition(
    protocol: Protocol, request: Framed, every: float | None, count: int | None, endless: Collection[str]
) -> None:
    """Refuse --count and --every where they do not apply."""
    name = request.NAME
    if every is None:
        if count is not None and name not in endless:
            raise Failure(f"--count requires --every or endless answers; {name} has none: omit it")
        return
    command = next((each for each in protocol.commands if each.request.name == name), None)
    if every == 0:
        raise Failure("--every 0: a period is above 0 s; give for example 0.5")
    if command is None or command.steps or name in endless:
        raise Failure(f"--every requires a request with its response; {name} is not one: omit it")


def _follow(protocol: Protocol, master: BlockingMaster, request: Framed, count: int | None) -> None:
    """Print endless answers as they come, until a signal or so many; then stop them."""
    with StopSignals() as signals, closing(master.stream(request)) as answers:
        for number, answer in enumerate(answers, 1):
            click.echo(jsonlines.line(message_record(protocol, answer)))
            if number == count or signals.stopped:
                break


def _tell(port: Port, frame: bytes, byte_time: float, after: float) -> None:
    """Send a frame, after a break unless that takes no time, and wait until it is transmitted."""
    port.transmit(frame, after)
    if port.capabilities.paced is not Ability.NO:
        port.sleep(len(frame) * byte_time)


def check_request(protocol: Protocol, message: Message) -> None:
    """Refuse the answers of a command. Messages outside commands may be sent by any node."""
    command = protocol.command_of(message)
    if command is not None and message is not command.request:
        raise Failure(f"{message.name} is a response; send its request, {command.name}")


def further_of(
    protocol: Protocol, codec: ModuleType, message: Message, addresses: tuple[str, ...], given: Sequence[str]
) -> list[Framed]:
    """Return the frames of a dialogue after its request, from a JSON object for each."""
    command = protocol.command_of(message)
    steps = [step.message.name for step in command.steps if step.sent] if command else []
    if len(given) != len(steps):
        names = f": {', '.join(steps)}" if steps else ""
        wanted = counted(len(steps), "frame")
        raise Failure(f"{message.name} is followed by {wanted}{names}; pass --then OBJECT for each")
    return [
        cast("Framed", compose(protocol, name, (), addresses, text, codec=codec)[2])
        for name, text in zip(steps, given, strict=True)
    ]


def _transact(protocol: Protocol, master: BlockingMaster, request: Question) -> Reply:
    """Perform a transaction; if it fails, show valid frames received that are not the response."""
    strays: list[Framed] = []

    def note(event: Event) -> None:
        if isinstance(event, Stray):
            strays.append(event.message)

    master.on_event = note
    try:
        return master.transact(request)
    except LinkError:
        for stray in strays:
            warn(f"received, but not the response: {jsonlines.line(message_record(protocol, stray))}")
        raise
