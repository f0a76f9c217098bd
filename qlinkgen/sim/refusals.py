"""Refusals of simulated nodes: which reply of a command refuses, and how often it is sent."""

from __future__ import annotations

import inspect
import random
from collections.abc import Iterator, Mapping
from enum import IntEnum
from typing import Any

from qlinkgen.link.codec import Command, Module, OtherReply
from qlinkgen.model.spelling import similar
from qlinkgen.sim.errors import SimulationError


class Refusals:
    """Refuses requests at random."""

    def __init__(self, codec: Module, rates: Mapping[str, float], *, seed: int = 0) -> None:
        """Find the replies that refuse.

        Args:
            codec: the generated module of the protocol.
            rates: probability from 0 to 1, by command.
            seed: of the choice.

        Raises:
            SimulationError: an unknown command, one that cannot refuse, or a probability out of range.
        """
        self._chance = random.Random(seed)
        self._rates = dict(rates)
        self._replies: dict[str, tuple[OtherReply, Mapping[str, object]]] = {}
        for name, rate in rates.items():
            if not 0 <= rate <= 1:
                raise SimulationError(f"{name}: {rate} is not a probability; give 0 to 1")
            self._replies[name] = _refusing(command_named(codec, name))

    def of(self, command: Command) -> tuple[OtherReply, Mapping[str, object]] | None:
        """Return the reply to a request that is refused, and values that make it one; None if it is not."""
        rate = self._rates.get(command.name)
        return self._replies[command.name] if rate and self._chance.random() < rate else None


def command_named(codec: Module, name: str) -> Command:
    """Return a command. Raises SimulationError if there is none of that name."""
    if name not in codec.COMMANDS:
        close = similar(name, codec.COMMANDS)
        listed = f"did you mean {close[0]}?" if close else f"commands are {', '.join(codec.COMMANDS)}"
        raise SimulationError(f"unknown command '{name}'; {listed}")
    return codec.COMMANDS[name]


def _refusing(command: Command) -> tuple[OtherReply, Mapping[str, object]]:
    for reply in command.replies.values():
        for first, _, means in reply.cases:
            if means == "refused":
                return reply, {reply.switch: first}
        if reply.means == "refused":
            if not reply.switch:
                return reply, {}
            for number in _others(reply):
                return reply, {reply.switch: number}
    raise SimulationError(f"{command.name} cannot be refused: none of its replies means refused")


def _others(reply: OtherReply) -> Iterator[int]:
    """Legal numbers of the switch of a reply beside its cases, those with a name first."""
    kind: Any = reply.message  # which has a rule for each field
    rule = next(rule for rule in kind.RULES if rule.name == reply.switch)
    usual = inspect.signature(kind).parameters[reply.switch].default
    named = [int(each) for each in type(usual)] if isinstance(usual, IntEnum) else []
    ends = {first for first, _ in rule.ranges} | {last + 1 for _, last, _ in reply.cases}
    for number in (*named, *sorted(ends)):
        if rule.allows(number) and not any(first <= number <= last for first, last, _ in reply.cases):
            yield number
