"""Every message of the dialects that pymavlink contains: `python -m tests.importers.dialects [NAME ...]`.

Each dialect is imported for MAVLink 1 and 2 with the files that it includes. Random messages are encoded by
the interpreter, read by pymavlink, packed by it again, and decoded and encoded by the generated Python.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import math
import struct
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random
from time import process_time
from types import FrameType, ModuleType
from typing import Any, Literal

from qlinkgen.backends.c import generate as generate_c
from qlinkgen.backends.python import generate as generate_python
from qlinkgen.backends.python import load as load_module
from qlinkgen.importers.checking import written
from qlinkgen.importers.mavlink import read_mavlink
from qlinkgen.importers.names import schema_name
from qlinkgen.importers.notes import Notes
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import Options, plan_of
from qlinkgen.plan.codec import Codec
from qlinkgen.schema import loads
from tests.support.random_raw import random_address, random_beside, random_values

Version = Literal[1, 2]


@dataclass(frozen=True)
class Dialect:
    """A dialect: our model, module and interpreter, and pymavlink's module."""

    model: Protocol
    module: ModuleType
    codec: Codec
    theirs: Any

    def kind(self, message: Message) -> Any:
        """Their class of a message."""
        return self.theirs.mavlink_map[message.id]


def source(name: str, version: Version) -> Path:
    """The file of a dialect in pymavlink."""
    folder = Path(importlib.import_module("pymavlink").__file__ or "").parent
    return folder / "dialects" / f"v{version}0" / f"{name}.xml"


def imported(name: str, version: Version) -> tuple[Protocol, str]:
    """The model of a dialect, and its schema."""
    notes = Notes(f"{name}.xml")
    text = written(read_mavlink(source(name, version), notes, version=version), notes)
    model, faults = loads(text, f"{name}.yaml")
    assert model is not None, faults
    return model, text


def dialect(name: str, version: Version) -> Dialect:
    """A dialect in all forms; no message of pymavlink is missing."""
    model, _ = imported(name, version)
    theirs = importlib.import_module(f"pymavlink.dialects.v{version}0.{name}")
    assert {each.id for each in model.messages} == set(theirs.mavlink_map)
    return Dialect(model, load_module(model), Codec(plan_of(model)), theirs)


def compare(found: Dialect, message: Message, rng: Random) -> None:
    """One random message, both ways."""
    values = dict(zip((each.name for each in message.values), random_values(message, rng), strict=True))
    beside, address = random_beside(found.model, message, rng), random_address(message, rng)
    wire = found.codec.encode(message.name, values | beside, address)
    read = found.theirs.MAVLink(None).decode(bytearray(wire))
    assert read.get_msgId() == message.id
    for name in read.fieldnames:
        own = values.get(schema_name(name))
        assert own is None or same(own, _raw(read, name)), (message.name, name, own, wire.hex(" "))
    header = read.get_header()
    link = found.theirs.MAVLink(None, header.srcSystem, header.srcComponent)
    link.seq = header.seq
    theirs = bytes(read.pack(link))
    decoded = found.module.decode(theirs)
    if not _flags(wire, found):  # it sends none
        assert theirs == wire, message.name
        assert decoded.to_frame() == wire, message.name
    assert message.name == decoded.NAME
    assert decoded.to_bytes() == found.module.decode(wire).to_bytes()


def _flags(wire: bytes, found: Dialect) -> int:
    return wire[3] if wire[0] == 0xFD else 0


def _raw(read: Any, name: str) -> Any:
    value = getattr(read, name)
    return getattr(read, f"_{name}_raw") if isinstance(value, str) else value


def same(own: Any, theirs: Any) -> bool:
    """Whether raw values of ours are those of pymavlink: numbers, lists of them, padded text."""
    if isinstance(own, bytes):
        return own.rstrip(b"\0") == bytes(theirs).rstrip(b"\0")
    if isinstance(own, list):
        return len(own) == len(theirs) and all(map(same, own, theirs))
    if isinstance(theirs, float):
        return own in _patterns(theirs) or math.isnan(theirs)
    return bool(own == theirs)


def _patterns(number: float) -> set[int]:
    """The bits of a number in the sizes of floats."""
    found = {int.from_bytes(struct.pack("<d", number), "little")}
    with contextlib.suppress(OverflowError):
        found.add(int.from_bytes(struct.pack("<f", number), "little"))
    return found


# The command ------------------------------------------------------------------------------------------------

NAMES = ("minimal", "standard", "common", "ardupilotmega")


def generation(text: str, name: str) -> float:
    """Seconds of processor time to read a schema and to generate C and Python."""
    start = process_time()
    model, _ = loads(text, f"{name}.yaml")
    assert model is not None
    for generate in (generate_c, generate_python):
        generate(model, Options(package="python/wire"))
    return process_time() - start


def steps(text: str, name: str) -> int:
    """Calls of functions to do the same, which do not depend on the machine."""
    count = 0

    def note(frame: FrameType, event: str, argument: object) -> None:  # of sys.setprofile
        nonlocal count
        count += event in {"call", "c_call"}

    before = sys.getprofile()
    sys.setprofile(note)
    try:
        generation(text, name)
    finally:
        sys.setprofile(before)
    return count


def shares(name: str, version: Version, cost: Callable[[str, str], float]) -> list[tuple[int, float]]:
    """Numbers of messages, a quarter, half and all of a dialect, and what generating them costs."""
    path = source(name, version)
    names = [each.name for each in read_mavlink(path, Notes("x"), version=version).sections["messages"]]
    found = []
    for part in (4, 2, 1):
        chosen = names[::part]
        notes = Notes("x")
        text = written(read_mavlink(path, notes, version=version, only=chosen), notes)
        found.append((len(chosen), min(cost(text, name) for _ in range(2))))  # the first one fills caches
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare every message of dialects, and print what generating them costs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("names", nargs="*", default=NAMES, metavar="NAME")
    parser.add_argument("--values", type=int, default=20, help="random values of each message")
    options = parser.parse_args(arguments)
    for name in options.names:
        for version in (1, 2):
            found = dialect(name, version)
            start = process_time()
            every(found, options.values)
            seconds = process_time() - start
            print(f"{name}, MAVLink {version}: {len(found.model.messages)} messages agree, {seconds:.1f} s")
        for count, seconds in shares(name, 2, generation):
            print(f"  {count} messages: {seconds:.2f} s to generate, {seconds / count * 1000:.1f} ms each")
    return 0


def every(found: Dialect, number: int) -> None:
    """Random values of every message."""
    for message in found.model.messages:
        rng = Random(message.name)
        for _ in range(number):
            compare(found, message, rng)


if __name__ == "__main__":
    sys.exit(main())
