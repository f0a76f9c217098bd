"""State machines as tables.

A table maps a state and an event to the next state, and is what the engines execute: an event that the table
does not have for the current state raises, so a review of the table is a review of the machine.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import NoReturn, TypeVar

State = TypeVar("State", bound=StrEnum)
Cause = TypeVar("Cause", bound=StrEnum)


class Moves(dict[State, State]):
    """The next state after one event, by the current one.

    An engine looks up an event at least three times a transaction, so each event has its own dictionary
    instead of a key of two parts.
    """

    def __init__(self, table: Mapping[tuple[State, Cause], State], event: Cause) -> None:
        super().__init__({state: after for (state, cause), after in table.items() if cause is event})
        self._event = event

    def __missing__(self, state: State) -> NoReturn:
        raise RuntimeError(f"{self._event!r} cannot happen in state {state!r}")
