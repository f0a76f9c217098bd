"""The kinds of faults, and how often and how badly each may happen."""

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
        doc: what happens, for people.
        unit: of its extent ("bits", "bytes", "seconds"), empty where it has none.
        low: least extent unless the plan says otherwise.
        high: greatest extent unless the plan says otherwise.
        slaves_only: only what a slave sends can fail in this way.
    """

    name: str
    doc: str
    unit: str = ""
    low: float = 0.0
    high: float = 0.0
    slaves_only: bool = False

    @property
    def whole(self) -> bool:
        """The extent is a count, from 1 on."""
        return self.unit in {"bits", "bytes"}


KINDS = {
    kind.name: kind
    for kind in (
        Kind("drop", "nothing arrives"),
        Kind("flip", "bits arrive changed", "bits", 1, 3),
        Kind("truncate", "the tail is missing, or the head"),
        Kind("delay", "a little late", "seconds", 0.0, 0.0001),
        Kind("late", "an answer comes after its time", "seconds", 0.05, 0.2, slaves_only=True),
        Kind("duplicate", "sent twice, with a gap between", "seconds", 0.0, 0.001),
        Kind("stray", "a valid frame that nobody asked for"),
        Kind("noise", "random bytes before it, behind it, or alone", "bytes", 1, 20),
        Kind("silent", "a station sends nothing for a time", "seconds", 0.1, 1.0, slaves_only=True),
    )
}


class Rate(NamedTuple):
    """How often a fault happens, and its extent: drawn between two bounds in the unit of its kind."""

    chance: float
    low: float
    high: float


RateLike = float | tuple[float, float, float] | Rate


def make_rate(name: str, given: RateLike) -> Rate:
    """Check what was given for a kind, a chance or (chance, low, high), and fill in the usual extent.

    Raises:
        FaultPlanError: a chance outside 0 to 1, or an extent that the kind cannot have.
    """
    kind = KINDS[name]
    if not isinstance(given, tuple):
        return Rate(check_chance(name, given), kind.low, kind.high)
    if len(given) != 3:
        raise FaultPlanError(f"{name} is {given!r}: give a chance, or the three of (chance, low, high)")
    chance, low, high = given
    if not kind.unit:
        raise FaultPlanError(f"{name} is {given!r}: {kind.doc} has no extent; give the chance alone")
    if not 0 <= low <= high < math.inf:
        raise FaultPlanError(
            f"{name} goes from {low:g} to {high:g}: {kind.unit} from 0 on, the lower bound first"
        )
    if kind.whole and (low < 1 or low % 1 or high % 1):
        raise FaultPlanError(f"{name} goes from {low:g} to {high:g}: {kind.unit} are counted, 1 or more")
    return Rate(check_chance(name, chance), low, high)


def check_chance(name: str, given: float) -> float:
    """Return a chance as it is if it is one.

    Raises:
        FaultPlanError: it is not from 0 to 1.
    """
    if not 0 <= given <= 1:
        raise FaultPlanError(f"{name} is {given:g}: a chance is a number from 0 to 1, 0.02 for 2 %")
    return float(given)


def format_rate(name: str, rate: Rate) -> str:
    """Return the text that is parsed to this rate again."""
    kind = KINDS[name]
    usual = not kind.unit or (rate.low, rate.high) == (kind.low, kind.high)
    extent = "" if usual else f":{_short(rate.low)}-{_short(rate.high)}"
    return f"{name}={_short(rate.chance)}{extent}"


def _short(number: float) -> str:
    return str(int(number)) if number == int(number) else repr(number)
