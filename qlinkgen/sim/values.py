"""Values that simulated nodes answer: constant, rising again and again, with noise, or set by requests."""

from __future__ import annotations

import math
import random
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from decimal import Decimal
from typing import Protocol as Shape

from qlinkgen.model.fields import Value
from qlinkgen.model.message import Message
from qlinkgen.model.naming import attribute
from qlinkgen.model.objects import RecordClasses, attributes_of
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.spelling import similar
from qlinkgen.model.types import Enum, Flags, Scalar
from qlinkgen.model.values import BadValue, Json, Native, raw_from_native
from qlinkgen.sim.errors import SimulationError

_NUMBER = r"([-+]?(?:[0-9]{1,30}(?:\.[0-9]{0,30})?|\.[0-9]{1,30}))"
_RAMP = re.compile(rf"ramp:{_NUMBER}\.\.{_NUMBER}:{_NUMBER}s")
_NOISE = re.compile(rf"noise:{_NUMBER}:{_NUMBER}")


class Source(Shape):
    """A native value that changes with time."""

    def at(self, now: float) -> Native:
        """Return the value at a time in seconds."""
        ...


@dataclass(frozen=True, slots=True)
class Ramp:
    """Goes from one number to another, and begins again.

    Attributes:
        first: number at time 0.
        last: number that is reached after `seconds`.
        convert: makes the number one of the field.
    """

    first: float
    last: float
    seconds: float
    convert: Callable[[float], Native]

    def at(self, now: float) -> Native:
        """Return the number at a time."""
        return self.convert(
            self.first + (self.last - self.first) * math.fmod(now, self.seconds) / self.seconds
        )


@dataclass(frozen=True, slots=True)
class Noise:
    """A number that differs from its mean by at most an amplitude, evenly distributed."""

    mean: float
    amplitude: float
    convert: Callable[[float], Native]
    chance: random.Random

    def at(self, now: float) -> Native:  # noqa: ARG002  # as Ramp
        """Return the next number."""
        return self.convert(self.chance.uniform(self.mean - self.amplitude, self.mean + self.amplitude))


class Values:
    """Values of the answers of a protocol, for `GenericNode`. Nodes may share them."""

    def __init__(
        self,
        protocol: Protocol,
        records: RecordClasses,
        given: Mapping[str, Mapping[str, Json]],
        *,
        seed: int = 0,
    ) -> None:
        """Check and keep the values.

        Args:
            protocol: the protocol.
            records: `RECORDS` of its generated module.
            given: values by field, by command or by the full name of an answer. They are those of JSON and
                of the command line. A number may also be `ramp:0..100:5s`, from 0 to 100 in 5 seconds again
                and again, or `noise:21:0.5`, a number from 20.5 to 21.5.
            seed: of the noise.

        Raises:
            SimulationError: an unknown answer or field, or an illegal value.
        """
        self._records = records
        self._chance = random.Random(seed)
        self._constant: dict[str, dict[str, object]] = {}
        self._changing: dict[str, dict[str, Source]] = {}
        for name, fields in given.items():
            message = _answer(protocol, name)
            try:
                self._add(message, fields)
            except BadValue as error:
                raise SimulationError(f"{message.name}: {error}") from None

    def _add(self, message: Message, fields: Mapping[str, Json]) -> None:
        values = {value.name: value for value in message.values}
        if unknown := [field for field in fields if field not in values]:
            raise SimulationError(_no_field(message, unknown[0], values))
        changing = {name: self._source(values[name], text) for name, text in fields.items()}
        sources = {name: source for name, source in changing.items() if source is not None}
        constant = {name: each for name, each in fields.items() if name not in sources}
        attributes = attributes_of(self._records, message.values, constant)
        for name in constant:
            native = attributes[attribute(name)]
            if isinstance(native, int | float | Decimal) and isinstance(values[name].type, Scalar):
                raw_from_native(values[name], native)  # refuses what is out of range
        self._constant.setdefault(message.name, {}).update(attributes)
        self._changing.setdefault(message.name, {}).update(
            {attribute(name): source for name, source in sources.items()}
        )

    def _source(self, value: Value, given: Json) -> Source | None:
        """Return how a number changes, None for a constant."""
        kind = value.type
        if not isinstance(given, str) or not isinstance(kind, Scalar):
            return None
        if isinstance(kind.meaning, Enum | Flags) or kind.meaning == "bool":
            return None
        if (ramp := _RAMP.fullmatch(given)) is not None:
            first, last, seconds = map(float, ramp.groups())
            if seconds <= 0:
                raise BadValue(f"{value.name}: {given} takes no time; give it more than 0 s")
            source: Source = Ramp(first, last, seconds, _converter(value))
            ends = first, last
        elif (noise := _NOISE.fullmatch(given)) is not None:
            mean, amplitude = map(float, noise.groups())
            source = Noise(mean, amplitude, _converter(value), self._chance)
            ends = mean - amplitude, mean + amplitude
        else:
            return None
        for end in ends:
            raw_from_native(value, _converter(value)(end))
        return source

    def of(self, message: str, now: float) -> dict[str, object]:
        """Return the values of an answer at a time, by attribute."""
        changing = {name: source.at(now) for name, source in self._changing.get(message, {}).items()}
        return {**self._constant.get(message, {}), **changing}


def _converter(value: Value) -> Callable[[float], Native]:
    """Return the function that makes a number one that the field can have."""
    assert isinstance(value.type, Scalar)
    match value.type.number:
        case "int":
            return round
        case "decimal":
            return Decimal
        case _:
            return float


def _answer(protocol: Protocol, name: str) -> Message:
    commands = {command.name: command.response for command in protocol.commands}
    answers = {each.name: each for each in protocol.messages if each.direction == "response"}
    if name in commands and commands[name] is None:
        raise SimulationError(f"{name} is not answered")
    message = commands.get(name) or answers.get(name)
    if message is None:
        close = similar(name, [*commands, *answers])
        hint = f"did you mean {close[0]}?" if close else "give the name of a command"
        raise SimulationError(f"{protocol.name} has no answer '{name}'; {hint}")
    return message


def _no_field(message: Message, name: str, values: Mapping[str, Value]) -> str:
    if any(field.name == name for field in message.fields):
        return f"{message.name}: '{name}' is filled in; omit it"
    close = similar(name, values)
    listed = f"its fields are {', '.join(values)}" if values else "it has no fields"
    return f"{message.name} has no field '{name}'; {f'did you mean {close[0]}?' if close else listed}"
