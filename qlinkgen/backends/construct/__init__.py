"""Structures for the construct library: source for readers, and live as the reference for every other output.

Both come from one tree of constructor calls (`tree`), which `payload` and `module` build from the model.
`_fields` and `_frames` are what it calls beside construct itself; they are copied beside the source as is.
"""

from __future__ import annotations

import importlib.resources
import re

from qlinkgen.backends.base import Options, Outputs, banner
from qlinkgen.backends.construct.live import Live, live
from qlinkgen.backends.construct.module import definitions
from qlinkgen.backends.construct.tree import WIDTH, Definition, printed, used
from qlinkgen.model.protocol import Protocol

__all__ = ["Live", "generate", "live", "shared"]

#: Modules that stand beside every generated one, and what a tree uses of them; all else is construct's own.
_SUPPORT = {
    "_fields": "BitFields Bits Boolean Characters Count Flagged Groups Items Message Octets Ranged Scaled",
    "_frames": "CRC Check DelimitedFrame Layout MarkedFrame Part RequestPacket ResponsePacket Stuffing Sum "
    "messages_of",
}
_ORIGINS = {"Decimal": "decimal"} | {
    name: f".{file}" for file, names in _SUPPORT.items() for name in names.split()
}


def generate(protocol: Protocol, options: Options) -> Outputs:
    """The module of a protocol: path below the output folder to text."""
    everything = definitions(protocol, options)
    text = "".join([_head(protocol), _imports(everything), *map(printed, everything)])
    return {f"construct/{protocol.name}.py": text}


def shared() -> Outputs:
    """The modules that every generated one needs beside it."""
    folder = importlib.resources.files(__name__)
    return {f"construct/{name}.py": folder.joinpath(f"{name}.py").read_text("utf-8") for name in _SUPPORT}


def _head(protocol: Protocol) -> str:
    return '"""' + "\n".join(banner(protocol)).replace("\n", "\n\n", 1) + '\n"""\n\n'


def _imports(everything: tuple[Definition, ...]) -> str:
    names = {name for each in everything for name in used(each.node)} - {each.name for each in everything}
    by_origin: dict[str, list[str]] = {}
    for name in sorted(names, key=_order):
        by_origin.setdefault(_ORIGINS.get(name, "construct"), []).append(name)
    blocks = (["decimal"], ["construct"], ["._fields", "._frames"])
    lines = (
        "".join(_import(origin, by_origin[origin]) for origin in block if origin in by_origin)
        for block in blocks
    )
    return "\n".join(filter(None, lines))


def _order(name: str) -> tuple[bool, bool, list[int | str]]:
    """Constants, classes, functions; numbers inside of names by their size, as import sorters have it."""
    parts = re.split("([0-9]+)", name)
    return not name.isupper(), name[0].islower(), [int(part) if part.isdigit() else part for part in parts]


def _import(origin: str, names: list[str]) -> str:
    line = f"from {origin} import {', '.join(names)}\n"
    if len(line) <= WIDTH:
        return line
    return "\n".join([f"from {origin} import (", *(f"    {name}," for name in names), ")\n"])
