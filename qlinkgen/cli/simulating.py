"""Common parts of all simulations: faults from the command line, running a pty, the summary."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import click

from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.stopping import StopSignals
from qlinkgen.cli.wire_options import counted
from qlinkgen.sim import FaultPlan, FaultPlanError

if TYPE_CHECKING:
    from qlinkgen.sim.pty_bus import PtyBus


def plan_of(text: str | None, seed: int | None) -> FaultPlan | None:
    """Return the faults of ``--faults`` and ``--seed``."""
    if text is None:
        return None
    try:
        plan = FaultPlan.parse(text)
        if seed is None:
            return plan
        return FaultPlan.parse(f"{text},seed={seed}")
    except FaultPlanError as error:
        raise Failure(f"--faults {text}: {error}") from None


def run_bus(bus: PtyBus, link: str | None, what: str) -> None:
    """Print the path of the port, run until a signal, and close the port."""
    try:
        with StopSignals(bus.request_stop):
            say_port(bus.path, link, what)
            bus.run()
    finally:
        bus.close()


def say_port(path: str | None, link: str | None, what: str) -> None:
    """Print the first lines of a simulation, the first one for scripts."""
    click.echo(json.dumps({"port": path}))
    where = "" if path is None else f" on {path}" if link is None else f" on {path}, linked as {link}"
    say(f"{what}{where}; press Ctrl-C to stop", None)


def say(text: str, plan: FaultPlan | None) -> None:
    """Print a line of the summary, with the injected faults if a plan is given."""
    click.echo(f"qlinkgen: {text}{_faults(plan)}", err=True)


def _faults(plan: FaultPlan | None) -> str:
    if plan is None:
        return ""
    kinds = ", ".join(f"{kind} {plan.counts[kind]}" for kind in plan.rates if plan.counts[kind])
    return f", {counted(plan.counts.total, 'fault')}{kinds and f' ({kinds})'}; seed {plan.seed}"
