"""Asks nodes periodically: each request has its own period, silent nodes are asked less often.

Every request has a grid of times, a period apart. Of the requests that are due, the one that has waited
longest is sent first. A request that the bus had no time for until its next turn is skipped and counted:
requests never pile up. A node that does not answer is only asked for trials, as `HealthPolicy` says; the
first answer brings all its requests back.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from qlinkgen.errors import LinkError, NoReply
from qlinkgen.link.codec import Framed, Module
from qlinkgen.link.dialogue import Dialogue
from qlinkgen.link.health import HealthBook, HealthPolicy
from qlinkgen.link.procedure import Ask, Pause, Procedure, Tell
from qlinkgen.link.transaction import Packet, Question, Reply

if TYPE_CHECKING:
    from qlinkgen.link.host_rules import HostRules

#: A node, None where frames have no address, and a command.
Key = tuple[int | None, str]
#: Seconds between two requests, by node and command; by command alone where frames have no address.
Periods: TypeAlias = Mapping[Key, float] | Mapping[tuple[int, str], float] | Mapping[str, float]
#: Requests by the same keys.
Requests: TypeAlias = Mapping[Key, Framed] | Mapping[tuple[int, str], Framed] | Mapping[str, Framed]
#: In place of a node's number in the book of health, where frames have no address.
_ONLY = 0


class Polled(NamedTuple):
    """The outcome of one request."""

    #: Time of the answer, or of the failure, on the clock of the port.
    time: float
    node: int | None
    command: str
    #: As `Reply.response`, or the error.
    outcome: Any  # of the response class of the command

    @property
    def error(self) -> LinkError | None:
        """The error, None for an answer."""
        return self.outcome if isinstance(self.outcome, LinkError) else None


@dataclass(slots=True)
class Spread:
    """Mean, largest value and standard deviation of numbers, without keeping them."""

    count: int = 0
    mean: float = 0.0
    most: float = 0.0
    _squares: float = 0.0

    def add(self, number: float) -> None:
        """Take a number, 0 or more."""
        self.count += 1
        before = number - self.mean
        self.mean += before / self.count
        self._squares += before * (number - self.mean)
        self.most = max(self.most, number)

    @property
    def deviation(self) -> float:
        """Standard deviation, 0 for fewer than two numbers."""
        return math.sqrt(self._squares / self.count) if self.count > 1 else 0.0


@dataclass(slots=True)
class PollStatistics:
    """Counts and times of one request, in seconds.

    Attributes:
        answered: transactions with an answer.
        failed: transactions without one, refusals included.
        skipped: turns for which the bus had no time.
        held: turns left out because the node was silent.
        jitter: how late the requests were sent, compared with their grid.
        response: time from sending a request to its answer.
    """

    answered: int = 0
    failed: int = 0
    skipped: int = 0
    held: int = 0
    jitter: Spread = field(default_factory=Spread)
    response: Spread = field(default_factory=Spread)


class _Turn:
    """One request and its next turn."""

    __slots__ = ("due", "key", "period", "request", "statistics")

    def __init__(self, key: Key, request: Question, period: float, due: float) -> None:
        self.key = key
        self.request = request
        self.period = period
        self.due = due
        self.statistics = PollStatistics()

    def advance(self, now: float) -> int:
        """Take the next turn after a time; return how many were left out."""
        turns = max(1, math.floor((now - self.due) / self.period) + 1)
        self.due += turns * self.period
        return turns - 1


class Poller:
    """A table of requests with their periods; a driver runs it with `iterate(poller.run())`.

    Attributes:
        statistics: of each request, by node and command.
    """

    def __init__(
        self,
        codec: Module,
        periods: Periods,
        *,
        requests: Requests | None = None,
        policy: HealthPolicy | None = HealthPolicy(),  # noqa: B008  # immutable
        rules: HostRules | None = None,
    ) -> None:
        """Make the requests.

        Args:
            codec: the generated module.
            periods: seconds between two requests, above 0, by node and command; by command alone, or with
                None for the node, where frames have no address.
            requests: those of commands that need values; others have their defaults.
            policy: when a node is silent, and how often it is tried; None: all requests keep their periods.
            rules: of the host of a device, where the number of a key may be that of what is selected.

        Raises:
            ValueError: a period is not above 0, no request is given, a command is unknown, or a key names a
                node where frames have no address, or none where they have one.
            TypeError: the request of a command needs values.
        """
        if not periods:
            raise ValueError("periods: no request was given; give at least one, {(3, 'name'): 0.5}")
        selected = rules.selects if rules else {}
        given = {_key(codec, each, selected): request for each, request in (requests or {}).items()}
        self._turns: list[_Turn] = []
        for each, period in periods.items():
            key = _key(codec, each, selected)
            if not 0 < period < math.inf:
                raise ValueError(f"periods: {period} s of {key} must be above 0 and finite")
            number = None if key[0] in selected else key[0]
            request: Question = given[key] if key in given else request_of(codec, number, key[1])
            if rules and key[0] is not None and not isinstance(request, Packet | Dialogue):
                request = rules.packet(request, key[0])
            self._turns.append(_Turn(key, request, period, 0.0))
        self._turns.sort(key=lambda turn: turn.period)
        self._health = HealthBook(policy, untracked=())
        self.statistics = {turn.key: turn.statistics for turn in self._turns}

    def run(self) -> Procedure[None]:
        """Poll until closed; reports each `Polled`."""
        now: float = yield Pause(0.0)
        for turn in self._turns:
            turn.due = now
        while True:
            turn, due = self._next()
            if due > now:
                now = yield Pause(due - now)
                continue
            polled = yield from self._ask(turn, now)
            yield Tell(polled)
            now = yield Pause(0.0)

    def _next(self) -> tuple[_Turn, float]:
        """Return the next turn and when it is due; turns of silent nodes wait for their trial."""
        turn = min(self._turns, key=self._due)
        return turn, self._due(turn)

    def _due(self, turn: _Turn) -> float:
        health = self._health.offline(_number(turn))
        return turn.due if health is None else max(turn.due, health.next_trial)

    def _ask(self, turn: _Turn, now: float) -> Procedure[Polled]:
        """Send a request; take its next turn."""
        statistics, node = turn.statistics, _number(turn)
        trial = self._health.offline(node) is not None
        if trial:
            statistics.held += turn.advance(now)
        else:
            statistics.jitter.add(now - turn.due)
            statistics.skipped += turn.advance(now)
        outcome: object
        try:
            reply: Reply = yield Ask(turn.request, attempts=1 if trial else None, trial=trial)
        except LinkError as error:
            outcome, at = error, (yield Pause(0.0))
            statistics.failed += 1
            if isinstance(error, NoReply):
                self._health.failed(node, at, error.elapsed)
            else:
                self._came_back(node, at)
        else:
            outcome, at = reply.response, reply.at
            statistics.answered += 1
            statistics.response.add(reply.response_time)
            self._came_back(node, at)
        return Polled(at, *turn.key, outcome)

    def _came_back(self, node: int, now: float) -> None:
        """Note that a node has answered; after a silence its requests are due at once."""
        if self._health.offline(node) is not None:
            for turn in self._turns:
                if _number(turn) == node and turn.due <= now:
                    turn.statistics.held += turn.advance(now) + 1
                    turn.due = now
        self._health.answered(node)


def _key(codec: Module, given: Key | str, selected: Collection[int]) -> Key:
    """The node and the command of a key; with a host, the number of what it selects."""
    node, name = (None, given) if isinstance(given, str) else given
    if name not in codec.COMMANDS:
        raise ValueError(f"unknown command {name!r}; commands are {', '.join(codec.COMMANDS)}")
    addressed = bool(codec.COMMANDS[name].request.ADDRESS)
    if node is not None and node not in selected and not addressed:
        raise ValueError(f"{given!r} names a node, but frames of {name} have no address; give {name!r}")
    if node is None and addressed:
        raise ValueError(f"{given!r} names no node, but frames of {name} have an address; give (1, {name!r})")
    return node, name


def request_of(codec: Module, node: int | None, command: str) -> Framed:
    """Return the request of a command to a node, with the defaults of its fields.

    Raises:
        KeyError: an unknown command.
        TypeError: it needs values.
    """
    kind: Any = codec.COMMANDS[command].request  # the class of a message of its own module
    request: Framed = kind(**({} if node is None else {kind.ADDRESS: node}))
    return request


def _number(turn: _Turn) -> int:
    node = turn.key[0]
    return _ONLY if node is None else node
