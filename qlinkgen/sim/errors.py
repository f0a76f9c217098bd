"""Errors of the simulation; both are `QlinkgenError`s as well."""

from __future__ import annotations

from qlinkgen.errors import QlinkgenError


class FaultPlanError(QlinkgenError, ValueError):
    """A fault plan is invalid."""


class SimulationError(QlinkgenError, RuntimeError):
    """The simulation was used wrongly, or cannot end."""
