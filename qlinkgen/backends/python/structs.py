"""Formats of structs, and tables of structs by number of items."""

from __future__ import annotations

from collections.abc import Iterable

from qlinkgen.backends.python.floats import letter
from qlinkgen.model.integer import ByteOrder
from qlinkgen.model.types import Length
from qlinkgen.plan.payload import ItemsStep, PayloadPlan

#: A run of at most this many items gets a struct for each count; longer ones build the format at run time.
MANY_ITEMS = 128


def format_of(codes: Iterable[str]) -> str:
    """Concatenate formats, adjacent pad bytes merged."""
    text, pads = "", 0
    for code in codes:
        if code.endswith("x"):
            pads += int(code[:-1] or 1)
            continue
        text += (f"{pads}x" if pads else "") + code
        pads = 0
    return text + (f"{pads}x" if pads else "")


def tabled(payload: PayloadPlan, byteorder: ByteOrder) -> ItemsStep | None:
    """The run that gets a table of structs of the whole payload, None if there is none.

    It must be short and the only run of the payload, which has neither records nor numbers that follow from
    other bytes.
    """
    if payload.records or payload.filled_in:
        return None
    arrays = [step for step in payload.steps if isinstance(step, ItemsStep)]
    if len(payload.runs) != 1 or len(arrays) != 1 or payload.runs[0] is not arrays[0]:
        return None
    only = arrays[0]
    return only if letter(only.number, only.item, byteorder) and only.length.maximum <= MANY_ITEMS else None


def counts_of(length: Length) -> str:
    """The legal numbers of items of a run, as a range."""
    first = f"{length.minimum}, " if length.minimum else ""
    return f"range({first}{length.maximum + 1})"


def table(name: str, text: str, method: str, run: ItemsStep, key: str) -> list[str]:
    """The definition of a table of structs by count; ``key`` is an expression of ``n``."""
    return [f'{name} = {{{key}: Struct(f"{text}").{method} for n in {counts_of(run.length)}}}']
