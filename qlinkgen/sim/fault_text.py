"""Fault plans as text: `drop=0.01,flip=0.02,late=0.01:0.05-0.2,seed=3`."""

from __future__ import annotations

import difflib
import re
from typing import NamedTuple

from qlinkgen.sim.errors import FaultPlanError
from qlinkgen.sim.fault_kinds import KINDS, RateLike, check_chance

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_EXTENT = re.compile(rf"({_NUMBER})(?:-({_NUMBER}))?")
_EXAMPLE = "write for example drop=0.01,flip=0.02,late=0.01:0.05-0.2,seed=3"


class PlanText(NamedTuple):
    """The parsed text of a plan."""

    rates: dict[str, RateLike]
    settings: dict[str, str]


def parse_parts(text: str, settings: tuple[str, ...]) -> PlanText:
    """Parse the parts of a plan: rates, `all` spread over the kinds not listed, and settings as text.

    Raises:
        FaultPlanError: a part is invalid, unknown, or duplicate.
    """
    found: dict[str, str] = {}
    for part in text.split(","):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals or not name or not value:
            raise FaultPlanError(
                f"{part.strip()!r} is not a part of a fault plan: a part is NAME=VALUE; {_EXAMPLE}"
            )
        if name not in KINDS and name not in settings and name != "all":
            raise FaultPlanError(f"{part.strip()!r}: unknown fault {name!r}; {_choices(name, settings)}")
        if name in found:
            raise FaultPlanError(f"{part.strip()!r}: duplicate {name}; keep one of the two")
        found[name] = value
    rates: dict[str, RateLike] = {}
    if "all" in found:
        share = _parse_number("all", found["all"])
        rates.update(dict.fromkeys(KINDS, check_chance("all", share) / len(KINDS)))
    rates.update({name: _parse_rate(name, value) for name, value in found.items() if name in KINDS})
    return PlanText(rates, {name: value for name, value in found.items() if name in settings})


def _choices(name: str, settings: tuple[str, ...]) -> str:
    known = [*KINDS, "all", *settings]
    close = difflib.get_close_matches(name, known, 1)
    return f"did you mean {close[0]}?" if close else f"known are {', '.join(known)}"


def _parse_rate(name: str, value: str) -> RateLike:
    chance, colon, extent = value.partition(":")
    if not colon:
        return _parse_number(name, chance)
    match = _EXTENT.fullmatch(extent.strip())
    if match is None:
        unit = KINDS[name].unit
        rule = (
            f"after the colon comes its extent in {unit}, LOW-HIGH or one number"
            if unit
            else "it has no extent"
        )
        raise FaultPlanError(f"{name}={value}: {rule}; {_EXAMPLE}")
    low, high = match.groups()
    return _parse_number(name, chance), float(low), float(high if high is not None else low)


def _parse_number(name: str, text: str) -> float:
    if not re.fullmatch(_NUMBER, text.strip()):
        raise FaultPlanError(
            f"{name}={text}: not a probability from 0 to 1, such as 0.02 for 2 %; {_EXAMPLE}"
        )
    return float(text)
