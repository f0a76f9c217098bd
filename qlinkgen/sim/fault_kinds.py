"""The kinds of faults, with their probability and extent."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from qlinkgen.sim.errors import FaultPlanError


@dataclass(frozen=True, slots=True)
class Kind:
    """One way for a transmission to fail.

    Attributes:
        name: as written in a plan.
        doc: description.
        unit: unit of its extent ("bits", "bytes", "seconds"), empty without an extent.
        low: default lower bound of the extent.
        high: default upper bound of the extent.
        slaves_only: only transmissions of slaves can fail in this way.
    """

    name: str
    doc: str
    unit: str = ""
    low: float = 0.0
    high: float = 0.0
    slaves_only: bool = False

    @property
    def whole(self) -> bool:
        """Whether the extent is a count, from 1 on."""
        return self.unit in {"bits", "bytes"}


KINDS = {
    kind.name: kind
    for kind in (
        Kind("drop", "nothing arrives"),
        Kind("flip", "bits arrive changed", "bits", 1, 3),
        Kind("truncate", "the tail is missing, or the head"),
        Kind("delay", "a little late", "seconds", 0.0, 0.0001),
        Kind("late", "an answer arrives after its deadline", "seconds", 0.05, 0.2, slaves_only=True),
        Kind("duplicate", "sent twice, with a gap between", "seconds", 0.0, 0.001),
        Kind("stray", "an unsolicited valid frame"),
        Kind("noise", "random bytes before it, after it, or alone", "bytes", 1, 20),
        Kind("silent", "a station sends nothing for a time", "seconds", 0.1, 1.0, slaves_only=True),
    )
}


class Rate(NamedTuple):
    """Probability of a fault, and the bounds of its extent in the unit of its kind."""

    chance: float
    low: float
    high: float


RateLike = float | tuple[float, float, float] | Rate


def make_rate(name: str, given: RateLike) -> Rate:
    """Check the value for a kind, a probability or (probability, low, high), and fill in the default extent.

    Raises:
        FaultPlanError: a probability outside 0 to 1, or an invalid extent.
    """
    kind = KINDS[name]
    if not isinstance(given, tuple):
        return Rate(check_chance(name, given), kind.low, kind.high)
    if len(given) != 3:
        raise FaultPlanError(f"{name} must be a probability or (probability, low, high), not {given!r}")
    chance, low, high = given
    if not kind.unit:
        raise FaultPlanError(f"{name}={given!r}: {name} has no extent; give only the probability")
    if not 0 <= low <= high < math.inf:
        raise FaultPlanError(
            f"{name} must have bounds of 0 {kind.unit} or more in ascending order, not {low:g} to {high:g}"
        )
    if kind.whole and (low < 1 or low % 1 or high % 1):
        raise FaultPlanError(
            f"{name} must have integer bounds of 1 {kind.unit} or more, not {low:g} to {high:g}"
        )
    return Rate(check_chance(name, chance), low, high)


def check_chance(name: str, given: float) -> float:
    """Return a probability after checking it.

    Raises:
        FaultPlanError: it is not from 0 to 1.
    """
    if not 0 <= given <= 1:
        raise FaultPlanError(f"{name} must be a probability from 0 to 1, such as 0.02 for 2 %, not {given:g}")
    return float(given)


def format_rate(name: str, rate: Rate) -> str:
    """Return the text from which this rate is parsed."""
    kind = KINDS[name]
    usual = not kind.unit or (rate.low, rate.high) == (kind.low, kind.high)
    extent = "" if usual else f":{_short(rate.low)}-{_short(rate.high)}"
    return f"{name}={_short(rate.chance)}{extent}"


def _short(number: float) -> str:
    return str(int(number)) if number == int(number) else repr(number)
