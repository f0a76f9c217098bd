"""Second pass, the destination and the source of frames.

Where there are commands, the node answers, and the other one is the master: in a request the destination is
the node, in a response the source. So each of both is two parts of the model, one for each direction, of
which one has the address and the other the number of the master. On a link without commands both are values
of every frame.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import get_args

from qlinkgen.model.frame import Direction, Part, PartBits, Party
from qlinkgen.model.types import Scalar
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.report import Reporter, listed
from qlinkgen.schema.source import Path

#: Names of the address and of the number of the master in messages.
_NODE, _MASTER = "node", "master"
_RULE = "bad-party"
#: The direction in which a party is the master.
_OF_MASTER: dict[Party, Direction] = {"destination": "response", "source": "request"}


def with_parties(
    parts: tuple[Part, ...], file: SchemaFile, path: Path, report: Reporter
) -> tuple[Part, ...] | None:
    """The parts of a frame, those with a destination or a source as they are in each direction.

    None after an error.
    """
    return _Parties(parts, file, path, report).resolved()


class _Parties:
    """The parties of one frame."""

    def __init__(self, parts: tuple[Part, ...], file: SchemaFile, path: Path, report: Reporter) -> None:
        self._parts = parts
        self._commands = file.commands
        self._bus = file.bus
        self._path = path
        self._report = report
        self._found = {bits.party: (part, bits) for part in parts for bits in part.bits if bits.party}
        self._addressed = any(bits.role == "address" for part in parts for bits in part.bits)

    @property
    def _asks(self) -> bool:
        """Whether a node answers a master; a link may have messages alone."""
        return self._bus.kind != "link" or bool(self._commands)

    @property
    def _own(self) -> tuple[int, int, int]:
        """The number of a master by default, and the least and the highest that it can have."""
        if self._bus.kind != "link" or self._bus.nodes is None:
            return self._bus.master or 0, 0, self._most
        low, high = self._bus.nodes
        return low if self._bus.master is None else self._bus.master, low, high

    @property
    def _most(self) -> int:
        """The highest number that every party can have."""
        return min((1 << bits.bits) - 1 for _, bits in self._found.values())

    def resolved(self) -> tuple[Part, ...] | None:
        """The parts as they are in each direction, None after an error."""
        if not self._found:
            return self._parts
        if self._is_wrong():
            return None
        if not self._asks:
            return tuple(_changed(part, self._in_range) for part in self._parts)
        if self._addressed:
            return tuple(_changed(part, self._master) for part in self._parts)
        return tuple(each for part in self._parts for each in self._each_way(part))

    def _is_wrong(self) -> bool:
        """Report what keeps the parties from being told."""
        fault = self._fault()
        if fault is not None:
            place, what, hint = fault
            needs = (place, ("bus",), self._path)
            self._report.error(_RULE, place, what, hint, of_key=True, needs=needs)
        return fault is not None

    def _fault(self) -> tuple[Path, str, str] | None:
        party, (part, bits) = next(iter(self._found.items()))
        place = self._place(part, bits)
        if self._path[0] == "frames":
            hint = "use role: address for the node, or describe the kind in a file of its own"
            return place, f"several kinds of frame have no {party}", hint
        if self._bus.kind not in ("link", "master_slave"):
            hint = "use kind: master_slave or kind: link, or role: address"
            return place, f"a frame on a {self._bus.kind} has no {party}", hint
        if not self._asks:
            return None
        if fault := self._split_fault():
            return fault
        if self._bus.kind == "link":
            return self._link_fault()
        if self._bus.master is None:
            what = f"{bits.name} is the number of the master in frames of one direction, but the bus has none"
            return ("bus",), what, "add master: 0, or another number"
        if self._bus.master > self._most:
            what = f"master {self._bus.master} does not fit {listed(self._found)}"
            return ("bus", "master"), what, f"use 0..{self._most}"
        return self._type_fault()

    def _type_fault(self) -> tuple[Path, str, str] | None:
        if len({_container(of.bits) for _, of in self._found.values()}) > 1:
            part, bits = next(iter(self._found.values()))
            what = f"{listed(self._found)} have different types"
            return self._place(part, bits), what, "give both the same type"
        return None

    def _link_fault(self) -> tuple[Path, str, str] | None:
        """Each end of a link may ask, so the number of a master is one of the nodes."""
        master, nodes = self._bus.master, self._bus.nodes
        if master is not None and nodes is not None and not nodes[0] <= master <= nodes[1]:
            what = f"master {master} is not one of the nodes"
            return ("bus", "master"), what, f"use {nodes[0]}..{nodes[1]}"
        return self._type_fault()

    def _split_fault(self) -> tuple[Path, str, str] | None:
        """What keeps the node and the master from being told apart."""
        for party, (part, bits) in self._found.items():
            place, other = self._place(part, bits), "source" if party == "destination" else "destination"
            way = _OF_MASTER[party]
            if self._addressed and part.only != way:
                what = f"{bits.name} is the {party} in both directions, beside an address"
                hint = f"add if: {{direction: {way}}}, where it is the master, or use role: {other}"
                return place, what, f"{hint} for the address"
            if not self._addressed and other not in self._found:
                what = f"the frame has a {party}, but no {other}"
                return place, what, f"add a part with role: {other}, or use role: address for the node"
            if not self._addressed and part.only:
                return (*place, "if"), f"{bits.name} is the node in one direction", "remove the condition"
        return None

    def _place(self, part: Part, bits: PartBits) -> Path:
        inside = ("bits", bits.name) if bits.name != part.name else ()
        return (*self._path, part.name, *inside)

    def _each_way(self, part: Part) -> Iterator[Part]:
        """A part as it is in each direction, if it has a party."""
        if not any(bits.party for bits in part.bits):
            yield part
            return
        for way in get_args(Direction):
            bits = tuple(self._towards(each, way) for each in part.bits)
            whole = part.role == "bits" and [each.role for each in bits] == ["address"]
            alone = whole and part.scalar is not None and bits[0].bits == part.scalar.bits
            yield replace(part, bits=bits, only=way, role="address" if alone else part.role)

    def _towards(self, bits: PartBits, way: Direction) -> PartBits:
        """Bits of a part in a direction."""
        if not bits.party:
            return bits
        if _OF_MASTER[bits.party] == way:
            return replace(self._master(bits), name=_MASTER)
        return replace(bits, name=_NODE, role="address", type=None, party="")

    def _master(self, bits: PartBits) -> PartBits:
        """The number of the master."""
        assert bits.type is not None
        # Both directions have one value, and so one range.
        default, low, high = self._own
        number = replace(bits.type, default=default, minimum=low, maximum=high)
        return replace(bits, type=number, party="master", doc=bits.doc or "Number of the master")

    def _in_range(self, bits: PartBits) -> PartBits:
        """The number of one of the nodes of a link, or of all."""
        assert bits.type is not None
        if self._bus.nodes is None:
            return bits
        (low, high), every = self._bus.nodes, self._bus.broadcast
        both = [low, high, every] if every is not None and bits.party == "destination" else [low, high]
        number: Scalar = replace(bits.type, minimum=min(both), maximum=max(both), default=low)
        return replace(bits, type=number)


def _container(bits: int) -> int:
    """Bits of the integer that holds a number of so many bits."""
    return next(each for each in (8, 16, 32, 64) if bits <= each)


def _changed(part: Part, change: Callable[[PartBits], PartBits]) -> Part:
    """A part, the bits of parties in it changed."""
    return replace(part, bits=tuple(change(each) if each.party else each for each in part.bits))
