"""What a program needs beside the receiver: chunks, counters, frames between interrupt and main loop."""

from __future__ import annotations

from dataclasses import dataclass

from qlinkgen.backends.c.names import count_type
from qlinkgen.plan.tree import Plan


@dataclass(frozen=True, slots=True)
class BoxesView:
    """Sizes of the boxes in bytes, as expressions, and the type of a number of bytes on the wire."""

    payload: str
    wire: str
    count: str


def boxes(plan: Plan, upper: str) -> BoxesView:
    """The boxes for any frame of a header."""
    payload = f"{upper}_MAX_PAYLOAD_SIZE" if plan.frame.max_payload else "1U"
    wire = f"{upper}_MAX_WIRE_SIZE" if plan.max_wire_size else "1U"
    return BoxesView(payload, wire, count_type(plan.max_wire_size))
