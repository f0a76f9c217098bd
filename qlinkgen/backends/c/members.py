"""The members of structs that hold the values of a payload, as paths from the struct.

The cases of a choice are members of a union, each named after its case; in it, a run of variable size is a
struct of its own.
"""

from __future__ import annotations

from qlinkgen.model.naming import member
from qlinkgen.plan.payload import BytesStep, Holder, ItemsStep, RecordsStep, RunStep, Step, value_name


def member_of(step: Holder | Step) -> str:
    """The member with the value of a field."""
    if step.presence is None or not step.presence.slot:
        return member(step.name)
    inside = f"{member(value_name(step))}.{member(step.presence.case)}"
    return f"{inside}.items" if is_counted(step) else inside


def count_of(run: RunStep) -> str:
    """The member with the number of items of a run of variable size."""
    if run.presence is None or not run.presence.slot:
        return f"{run.name}_{run.quantity}"
    return f"{member(value_name(run))}.{member(run.presence.case)}.{run.quantity}"


def is_counted(step: Holder | Step) -> bool:
    """Whether a member has the number of its items."""
    return isinstance(step, BytesStep | ItemsStep | RecordsStep) and not step.fixed
