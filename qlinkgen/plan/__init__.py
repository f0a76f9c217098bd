"""The plan: layout, framing and receiving of a protocol, decided once for all back-ends.

The model holds what the document states. The plan holds what follows from it: the offset of each field, the
number of items of a field of variable size, the bytes that a check value covers, how a receiver finds the
next frame. It is a frozen tree of small classes. Steps hold no text of the schema, so equal layouts compare
equal.

* `select` filters messages by role and name.
* `payload` turns the fields of a message into steps.
* `framing` turns a frame into `parts` in an `envelope`, their `transparency`, their `check`, and their `ends`
  with the receiver that finds them; `coding` has the codings of which a transparency may consist.
* `codec` and `receive` interpret the plan: the reference for every target. `dissect` explains each byte of a
  frame.
* `describe` puts parts and steps into words. docs/plan.md shows them.
"""

from __future__ import annotations

from qlinkgen.plan.build import plan_of
from qlinkgen.plan.select import Options
from qlinkgen.plan.tree import MessagePlan, Plan

__all__ = ["MessagePlan", "Options", "Plan", "plan_of"]
