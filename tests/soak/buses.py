"""Random transactions of protocols of the library on a bad line: none gets the answer to another.

`python -m tests.soak.buses [--transactions N] [--seed N]` runs N for each protocol, also with the master in
C, on a virtual clock. Answers are random numbers, drawn anew in each transaction. `--output PATH` puts the
figures into a page.
"""

from __future__ import annotations

import argparse
import asyncio
import random
import sys
import time
from collections.abc import Container
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.report import as_markdown
from qlinkgen.errors import LinkError
from qlinkgen.link import Timing
from qlinkgen.model.naming import snake
from qlinkgen.sim import FaultPlan
from qlinkgen.sim.generic import GenericNode
from qlinkgen.sim.joining import join
from qlinkgen.sim.smallest import required_values
from tests.bus.wires import bus_of, codec_of
from tests.library.protocols import described
from tests.soak.sections import put_section
from tests.support.cmaster import CMaster
from tests.support.cmaster_source import asks_of

#: Protocols with check values of 16 bits: one of 256 damaged frames is valid where they have 8.
NAMES = ("modbus_rtu", "dynamixel_2", "vesc", "ubx", "dnp3")
#: Those of which the master in C has all commands with one answer.
NAMES_IN_C = ("modbus_rtu", "vesc", "ubx")
#: Seconds: delays of the host, and how far deadlines of the commands may differ.
SLACK, NEAR = 0.05, 0.004
#: Seconds after the shortest deadline: late answers come after any, while the line has to be quiet.
LATE = (0.005, 0.009)
#: Chance of each kind of fault in a transmission: together they hit 5 % of them. Answers do not come twice:
#: the second one cannot be told from the answer to the same request once more, if that is lost.
SHARE = 0.05 / 6
KINDS = ("drop", "truncate", "delay", "noise")
#: Two flipped bits can leave the check value of UBX right.
BITS = (1, 1)


@dataclass
class Outcome:
    """What became of the transactions of one protocol."""

    name: str
    answered: int = 0
    told: int = 0
    failed: int = 0
    wrong: list[str] = field(default_factory=list)
    repeats: int = 0
    timeouts: int = 0
    faults: int = 0

    def __str__(self) -> str:
        """One line."""
        return (
            f"{self.name:12} {self.answered} answered, {self.told} without an answer, {self.failed} failed, "
            f"{self.repeats} repeats, {self.timeouts} timeouts, {self.faults} faults, {len(self.wrong)} wrong"
        )


def vary(message: Any, rng: random.Random, kept: set[str]) -> bool:
    """Give numbers and bytes of a message random values of the same size; return whether there are any."""
    varied = False
    for rule in message.RULES:
        if rule.name in kept or getattr(message, rule.name, None) is None:
            continue
        value: Any = getattr(message, rule.name)
        match type(rule).__name__:
            case "IntRule":
                value = rng.randint(*rng.choice(rule.ranges))
            case "BytesRule":
                value = rng.randbytes(len(value))
            case "ArrayRule":
                value = [rng.randint(*rule.item.ranges[0]) for _ in value]
            case _:
                continue
        setattr(message, rule.name, value)
        varied = True
    return varied


class Witness(GenericNode):
    """A node that answers with random numbers, and keeps what it has answered in the present transaction."""

    def __init__(self, codec: Any, number: int, rng: random.Random) -> None:
        super().__init__(codec, number)
        self.made: list[Any] = []
        #: The last answer that a slave sends once more, if a counter tells that a request is repeated.
        self.kept: list[Any] = []
        #: Classes of answers without anything to draw, which are always equal.
        self.plain: set[type] = set()
        self._rng = rng

    def handle(self, request: Any, now: float) -> Any:
        """Return the answer to a request, or several."""
        found: Any = super().handle(request, now)
        command = self._commands[type(request)]
        for each in found if isinstance(found, list) else [found] if found is not None else []:
            kept = {each.ADDRESS, *(name for _, name, _ in command.sizes)}
            kept |= {reply.switch for reply in command.replies.values()}
            if not vary(each, self._rng, kept):
                self.plain.add(type(each))
            self.made.append(each)
            if getattr(request, "KEPT", False):
                self.kept = [each]
        return found


class Traffic:
    """Random requests of a protocol, those with one answer and a deadline like the shortest one."""

    def __init__(
        self, codec: Any, rng: random.Random, numbers: list[int], names: Container[str] | None = None
    ) -> None:
        """``names``: the commands to choose from, None for all."""
        self._rng = rng
        self._numbers = numbers
        timing = Timing.of(codec, host_slack=SLACK)
        single = [each for each in codec.COMMANDS.values() if not each.steps and each.many is None]
        #: The shortest time from the end of a request to the end of its answer.
        self.shortest = min(timing.deadline(each, 0) for each in single if each.response)
        near = [each for each in single if timing.deadline(each, 0) <= self.shortest + NEAR]
        self._commands = [each for each in near if names is None or snake(each.name) in names]
        self._command = self._commands[0]

    def next(self) -> Any:
        """A request that can be sent, half of the time of the same command as the one before."""
        if self._rng.random() < 0.5:
            self._command = self._rng.choice(self._commands)
        command = self._command
        kind = command.request
        where = {}
        if kind.ADDRESS and command.addressing != "broadcast":
            where = {kind.ADDRESS: self._rng.choice(self._numbers)}
        values = required_values(kind)
        plain, varied = kind(**values, **where), kind(**values, **where)
        vary(varied, self._rng, {kind.ADDRESS})
        try:
            varied.to_frame()
        except ValueError:  # two of its values do not go together
            return plain
        return varied


def run(
    name: str, transactions: int, seed: int, *, asynchronous: bool = False, in_c: bool = False
) -> Outcome:
    """Perform transactions of a protocol with two nodes, and a third one that is missing.

    ``in_c``: the master is that in C.
    """
    module, codec = bus_of(name), codec_of(name)
    prefix = "Async" if asynchronous else ""
    made = next(each for each in ("Bus", "Device", "Peer") if hasattr(module, each))
    rates: dict[str, Any] = dict.fromkeys(KINDS, SHARE)
    rng = random.Random(f"{name} {seed}")
    first = codec.BUS.first_node
    numbers = [0] if first is None else [first, first + 1]
    nodes = [Witness(codec, number, rng) for number in numbers]
    known = {each.name for each in asks_of(described(name).model)} if in_c else None
    traffic = Traffic(codec, rng, [*numbers * 9, numbers[-1] + 1], known)
    late = (SHARE, traffic.shortest + LATE[0], traffic.shortest + LATE[1])
    plan = FaultPlan(**rates, flip=(SHARE, *BITS), late=late, seed=seed)
    outcome = Outcome(name)
    options: dict[str, Any] = {} if made == "Peer" else {"echo": "none", "health": None}
    with (
        asyncio.Runner() as runner,
        join(getattr(module, prefix + made), *nodes, faults=plan, slack=SLACK, **options) as pair,
    ):
        if in_c:
            pair.master.engine = CMaster(described(name).model, codec, pair.master.engine.timing)
        for _ in range(transactions):
            for node in nodes:
                node.made.clear()
            request = traffic.next()
            try:
                # Without repeats an answer that comes late comes during the next transaction.
                done: Any = pair.master.transact(request, attempts=rng.choice((1, 3)))
                reply = runner.run(done) if asynchronous else done
            except LinkError:
                outcome.failed += 1
                continue
            answers = reply.response if isinstance(reply.response, list) else [reply.response]
            if answers == [None]:
                outcome.told += 1
                continue
            outcome.answered += 1
            given = [each.to_frame() for node in nodes for each in (*node.made, *node.kept)]
            plain = set().union(*(node.plain for node in nodes))
            told = [each for each in answers if type(each) not in plain and each.to_frame() not in given]
            outcome.wrong += [f"{request} got {each}" for each in told]
        total = pair.master.engine.total
    outcome.repeats, outcome.timeouts, outcome.faults = total.repeats, total.timeouts, plan.counts.total
    return outcome


TITLE = "## Other protocols"
_PAGE = """\
The typed bus of five protocols of the library, and the generated master in C of three, with random requests
to two nodes and to one that is missing, on a virtual clock. Each transmission is hit by each of six kinds of
faults with a chance of 0.83 %, together 5 %: drop, truncate, delay, noise, one flipped bit, and answers that
are late by 5 to 9 ms. Answers are random numbers, drawn anew in each transaction: one is wrong if the node
has not given it in this transaction. The last run took {seconds:.0f} s:

```
python -m tests.soak.buses --transactions {transactions} --seed {seed} --output docs/soak.md
```

{figures}
"""
_ROWS = ("answered", "told", "failed", "repeats", "timeouts", "faults")
_LABELS = {"told": "sent without an answer", "failed": "failed with a LinkError", "faults": "faults injected"}


def as_section(outcomes: list[Outcome], transactions: int, seed: int, seconds: float) -> str:
    """Return the figures as a section without its heading."""
    rows = [[_LABELS.get(row, row), *(_n(getattr(outcome, row)) for outcome in outcomes)] for row in _ROWS]
    rows.append(["wrong answers", *(_n(len(outcome.wrong)) for outcome in outcomes)])
    figures = as_markdown(["", *(outcome.name for outcome in outcomes)], rows)
    return _PAGE.format(seconds=seconds, transactions=transactions, seed=seed, figures=figures)


def _n(number: int) -> str:
    return f"{number:,}".replace(",", " ")


def main() -> int:
    """Run all protocols; return 1 if an answer was wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--transactions", type=int, default=100_000, help="for each protocol")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--output", type=Path, help="put the figures into this page, if nothing is wrong")
    arguments = parser.parse_args()
    outcomes = []
    first = time.monotonic()
    for name, in_c in [*((name, False) for name in NAMES), *((name, True) for name in NAMES_IN_C)]:
        begun = time.monotonic()
        outcomes.append(run(name, arguments.transactions, arguments.seed, in_c=in_c))
        outcomes[-1].name += ", master in C" if in_c else ""
        print(f"{outcomes[-1]}; {time.monotonic() - begun:.0f} s", flush=True)
        for each in outcomes[-1].wrong[:3]:
            print("  ", each)
    if any(outcome.wrong for outcome in outcomes):
        return 1
    if arguments.output:
        text = as_section(outcomes, arguments.transactions, arguments.seed, time.monotonic() - first)
        page = put_section(arguments.output.read_text(encoding="utf-8"), TITLE, text)
        arguments.output.write_text(page, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
