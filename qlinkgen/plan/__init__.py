"""What a protocol means for code: decided here once, printed by every back-end.

The model says what the document states. The plan says what follows from it: where each field's bytes begin,
how many items a field of variable size has, which bytes a check value covers, how a receiver finds the next
frame. It is a frozen tree of small classes without a word of the schema's prose in its steps, so equal
layouts are equal objects.

* `select` keeps what an output is for: a role, some messages.
* `payload` turns the fields of a message into steps.
* `framing` turns a frame into parts, their `transparency`, their `check` and the `receiver` that finds them.
* `codec` and `receive` run the plan without generating code: the reference for every target. `dissect` says
  what each byte of a frame is.
* `describe` has the words for parts and steps. docs/plan.md shows them.
"""

from __future__ import annotations

from qlinkgen.plan.build import plan_of
from qlinkgen.plan.select import Options
from qlinkgen.plan.tree import MessagePlan, Plan

__all__ = ["MessagePlan", "Options", "Plan", "plan_of"]
