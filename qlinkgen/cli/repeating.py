"""``qlinkgen send --every``: one request again and again, with its times."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
from types import ModuleType
from typing import Any

import click

from qlinkgen.cli import jsonlines
from qlinkgen.cli.boundary import FINE, WRONG
from qlinkgen.cli.common import warn
from qlinkgen.cli.decode import message_record
from qlinkgen.cli.stopping import StopSignals
from qlinkgen.cli.wire_options import counted
from qlinkgen.errors import BadReply, Collision, LinkError, NoReply, Refused
from qlinkgen.link.codec import Framed, Message, address_of
from qlinkgen.link.poll import Polled, Poller, PollStatistics, Spread
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.values import Json
from qlinkgen.transport.blocking import BlockingMaster

#: Kind of an error in the output.
KINDS: Mapping[type[LinkError], str] = {
    NoReply: "no_reply",
    BadReply: "bad_reply",
    Refused: "refused",
    Collision: "collision",
}


class _Stop(Exception):
    """Ends a wait on a signal."""


def repeat(
    protocol: Protocol,
    master: BlockingMaster,
    codec: ModuleType,
    request: Framed,
    *,
    period: float,
    count: int | None,
) -> int:
    """Send a request periodically until a signal or so many times, print the outcomes, then a summary."""
    name = next(name for name, each in codec.COMMANDS.items() if each.request is type(request))
    key = address_of(request), name
    poller = Poller(codec, {key: period}, requests={key: request}, policy=None)
    start = master.port.now()
    try:
        with StopSignals(_stop), closing(master.iterate(poller.run())) as outcomes:
            for number, polled in enumerate(outcomes, 1):
                for record in records(protocol, polled):
                    click.echo(jsonlines.line({"at": round(polled.time - start, 6), **record}))
                if number == count:
                    break
    except _Stop:
        pass
    statistics = poller.statistics[key]
    click.echo(f"qlinkgen: {summary(statistics)}", err=True)
    return FINE if statistics.answered else WRONG


def _stop() -> None:
    raise _Stop


def records(protocol: Protocol, polled: Polled) -> list[dict[str, Json]]:
    """Return the objects of an outcome: a message for each answer, {"sent": command} without any."""
    error = polled.error
    if error is None:
        found = [message_record(protocol, answer) for answer in answers_of(polled.outcome)]
        return found or [{"sent": polled.command}]
    kind = next((kind for each, kind in KINDS.items() if isinstance(error, each)), "link")
    return [{"error": {"kind": kind, "message": str(error)}}]


def answers_of(response: Any) -> list[Message]:  # Any: as `Reply.response`
    """Return the answers in the response of a reply; warn of nodes of which there is none."""
    if type(response) is dict:  # by node
        if missing := [node for node, answer in response.items() if answer is None]:
            warn(f"no answer of node {', '.join(map(str, missing))}")
        response = list(response.values())
    found = response if type(response) in {list, tuple} else [response]
    return [answer for answer in found if answer is not None]


def summary(statistics: PollStatistics) -> str:
    """Return the counts and times as one line."""
    response = f"response time {_spread(statistics.response)}, " if statistics.answered else ""
    requests = counted(statistics.answered + statistics.failed, "request")
    return (
        f"{requests}, {statistics.answered} answered, {statistics.failed} not; "
        f"{counted(statistics.skipped, 'turn')} left out; {response}jitter {_spread(statistics.jitter)}"
    )


def _spread(spread: Spread) -> str:
    mean, most, deviation = (1000 * each for each in (spread.mean, spread.most, spread.deviation))
    return f"{mean:.2f} ms (at most {most:.2f}, deviation {deviation:.2f})"
