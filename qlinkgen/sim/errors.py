"""Errors of the simulation; both are `QlinkgenError`s as well."""

from __future__ import annotations

from qlinkgen.errors import QlinkgenError


class FaultPlanError(QlinkgenError, ValueError):
    """A plan of faults says something that it must not."""


class SimulationError(QlinkgenError, RuntimeError):
    """The simulation was used in a way that has no meaning, or can not come to an end."""
