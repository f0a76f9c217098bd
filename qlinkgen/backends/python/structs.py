"""Formats of structs, and how many of them there are for a run of items."""

from __future__ import annotations

from collections.abc import Iterable

from qlinkgen.backends.python.integers import letter
from qlinkgen.model.integer import ByteOrder
from qlinkgen.model.types import Length
from qlinkgen.plan.payload import ItemsStep, PayloadPlan

#: Up to so many items there is a struct for each count; beyond, the format is made when it is needed.
MANY_ITEMS = 128


def format_of(codes: Iterable[str]) -> str:
    """Formats in a row, pad bytes that follow one another as one."""
    text, pads = "", 0
    for code in codes:
        if code.endswith("x"):
            pads += int(code[:-1] or 1)
            continue
        text += (f"{pads}x" if pads else "") + code
        pads = 0
    return text + (f"{pads}x" if pads else "")


def tabled(payload: PayloadPlan, byteorder: ByteOrder) -> ItemsStep | None:
    """The run that has a struct of the whole payload for each of its counts, None where there is none.

    It is the only run of the payload that takes a starred target, and short enough.
    """
    arrays = [step for step in payload.steps if isinstance(step, ItemsStep)]
    if len(payload.runs) != 1 or len(arrays) != 1 or payload.runs[0] is not arrays[0]:
        return None
    only = arrays[0]
    return only if letter(only.item, byteorder) and only.length.maximum <= MANY_ITEMS else None


def counts_of(length: Length) -> str:
    """The numbers of items that a run may have, as a range."""
    first = f"{length.minimum}, " if length.minimum else ""
    return f"range({first}{length.maximum + 1})"


def table(name: str, text: str, method: str, run: ItemsStep, key: str) -> list[str]:
    """The definition of a struct for each count; ``key`` is an expression on ``n``."""
    return [f'{name} = {{{key}: Struct(f"{text}").{method} for n in {counts_of(run.length)}}}']
