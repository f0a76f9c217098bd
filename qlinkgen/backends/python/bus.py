"""Bus modules: a typed method for each command, for masters and hosts to call and for slaves to override.

The module `X_bus` is generated next to the codec `X` and uses its classes. A runtime implements sending; the
module does not depend on ports, clocks or threads. Those that do are in `qlinkgen.backends.python.ports`.
"""

from __future__ import annotations

from qlinkgen.backends.base import Options, Outputs
from qlinkgen.backends.python import package
from qlinkgen.backends.python.calls import BusModule, Transaction
from qlinkgen.backends.python.rings import ring_module
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import Plan, plan_of

__all__ = ["generate", "render"]


def generate(protocol: Protocol, options: Options) -> Outputs:
    """The modules of a protocol and the files of its package, by path; nothing without commands."""
    made = _module(plan_of(protocol, options))
    if made is None:
        return {}
    texts = {f"{protocol.name}_bus": made.text(), **dict(made.ports.texts())}
    return {**{f"{options.package}/{name}.py": text for name, text in texts.items()}, **package(options)}


def render(plan: Plan) -> str:
    """The text of a protocol's bus module, "" if it would be empty."""
    made = _module(plan)
    return made.text() if made else ""


def _module(plan: Plan) -> BusModule | None:
    if plan.protocol.bus.kind == "ring":
        return ring_module(plan)
    calls = [Transaction.of(plan, command) for command in plan.commands]
    kept = [call for call in calls if call is not None]
    return BusModule(plan, kept) if kept else None
