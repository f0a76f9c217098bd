"""The protocols of the library, and the library of somebody else that each is held against."""

from __future__ import annotations

import functools
import importlib
import importlib.util
import json
import random
import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import Any, Protocol, cast

import pytest

from qlinkgen.backends.python import load as load_module
from qlinkgen.cli.decode import message_record
from qlinkgen.cli.encode import compose
from qlinkgen.model.message import Direction, Message
from qlinkgen.model.protocol import Protocol as Model
from qlinkgen.plan import Plan, plan_of
from qlinkgen.schema import find, library, load
from qlinkgen.schema.including import GROUPS
from tests.support.random_raw import random_frame

#: A message as `qlinkgen decode` prints it.
Record = Mapping[str, Any]

#: Protocol to the module that it is held against and its name on PyPI.
PEERS: Mapping[str, tuple[str, str]] = {
    "cobs": ("cobs", "cobs"),
    "crsf": ("crsf_parser", "crsf-parser"),
    "dnp3": ("dnp3", "dnp3py"),
    "dynamixel_1": ("dynamixel_sdk", "dynamixel-sdk"),
    "dynamixel_2": ("dynamixel_sdk", "dynamixel-sdk"),
    "mavlink_1": ("pymavlink", "pymavlink"),
    "mavlink_2": ("pymavlink", "pymavlink"),
    "mbus": ("meterbus", "pyMeterBus"),
    "modbus_ascii": ("pymodbus", "pymodbus"),
    "modbus_rtu": ("pymodbus", "pymodbus"),
    "msp": ("yamspy", "yamspy"),
    "nmea_0183": ("pynmea2", "pynmea2"),
    "pelco_d": ("ptz_control_lib", "pyptzcontroller"),
    "ppp": ("yahdlc", "python4yahdlc"),
    "shdlc": ("sensirion_shdlc_driver", "sensirion-shdlc-driver"),
    "slip": ("sliplib", "sliplib"),
    "stm32": ("stm32loader", "stm32loader"),
    "tmcl": ("pytrinamic", "pytrinamic"),
    "ubx": ("pyubx2", "pyubx2"),
    "visca": ("pyvisca", "pyvisca"),
    "vesc": ("pyvesc", "pyvesc"),
    "xbee": ("digi", "digi-xbee"),
}
NAMES = library()


def pairs(text: str) -> dict[str, str]:
    """Names of the schema to those of the other library: "period=measRate ratio=navRate"."""
    return dict(each.split("=") for each in text.split())


class Peer(Protocol):
    """An adapter in `tests.library.peers`."""

    #: Messages that the library neither builds nor reads.
    UNKNOWN: frozenset[str]

    def build(self, record: Record) -> bytes | None:
        """The frame that the library builds of a message; None if it builds no such message."""
        ...

    def read(self, wire: bytes, direction: Direction) -> Record | None:
        """What the library reads in a frame: some or all of its record; None if it reads no such message."""
        ...


def peer(name: str) -> Peer:
    """The adapter of a protocol; skips the test if the library is not installed."""
    module, package = PEERS[name]
    if importlib.util.find_spec(module) is None:
        pytest.skip(f"needs {module} (pip install {package})")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of other people's code
        return cast(Peer, importlib.import_module(f"tests.library.peers.{name}"))


@dataclass(frozen=True)
class Described:
    """A protocol of the library in the forms that the tests use."""

    model: Model
    plan: Plan
    module: ModuleType

    def wire(self, message: Message, rng: random.Random) -> bytes:
        """A frame of random values, made by the interpreter."""
        return random_frame(self.plan, message, rng)

    def record_of(self, message: Message, wire: bytes) -> Record:
        """The record of a frame of a message, which may be told by its turn alone."""
        planned = self.plan.message(message.name)
        if planned.turned:
            return self._record(self.module.MESSAGES[message.name].from_bytes(wire))
        return self.record(wire, self.plan.direction_of(planned))

    def record(self, wire: bytes, direction: Direction) -> Record:
        """The record of a frame, read by the generated decoder, with numbers as JSON has them."""
        suffix = "" if direction == "message" else f"_{direction}"
        return self._record(getattr(self.module, f"decode{suffix}")(wire))

    def _record(self, found: Any) -> Record:
        plain: Record = json.loads(json.dumps(message_record(self.model, found), default=float))
        return plain

    def encoded(self, record: Record) -> bytes:
        """The frame of a record, made by the generated encoder."""
        *_, built = compose(self.model, None, (), (), json.dumps(record), codec=self.module)
        return bytes(built.to_frame())


@functools.cache
def described(name: str) -> Described:
    """A protocol of the library."""
    model = load(find(name))
    return Described(model, plan_of(model), load_module(model))


def text_of(name: str) -> str:
    """The text of a schema, with what it includes."""
    text = find(name).read_text("utf-8")
    included = re.search(r"^include: (\w+)\.yaml\n", text, re.MULTILINE)
    if included is None:
        return text
    ours, theirs = _blocks(text.replace(included[0], "")), _blocks(find(included[1]).read_text("utf-8"))
    for group in GROUPS:
        if group in ours and group in theirs:
            ours[group] = _joined(ours[group], theirs[group])
        elif group in theirs:
            ours[group] = theirs[group]
    return re.sub(r"^    examples:\n(?:      .*\n)+", "", "".join(ours.values()), flags=re.MULTILINE)


def _blocks(text: str, indent: str = "") -> dict[str, str]:
    """The entries of a mapping as text, by their keys; what precedes the first has the key ""."""
    blocks = re.split(rf"^(?={indent}\w+:)", text, flags=re.MULTILINE)
    return {block.partition(":")[0].strip() if index else "": block for index, block in enumerate(blocks)}


def _joined(ours: str, theirs: str) -> str:
    """A group of two files: keys of an entry replace those of the same entry."""
    own, entries = _blocks(ours, "  "), _blocks(theirs, "  ")
    for name, entry in own.items():
        entries[name] = "".join((_blocks(entries.get(name, ""), "    ") | _blocks(entry, "    ")).values())
    return "".join(entries.values())
