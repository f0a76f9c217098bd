"""The kinds of bus, and the options of port commands that each of them allows."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from enum import Enum

import click
from click.core import ParameterSource

from qlinkgen.cli.boundary import Failure
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan.ends import Gaps, Hunt, InStep, Marks, Rescan
from qlinkgen.plan.framing import frame_plan


class Kind(Enum):
    """Kind of bus that the commands can drive."""

    BUS = "master_slave"
    RING = "ring"
    HOST = "host"


BUS, RING, HOST = Kind

#: Texts for each kind: of a protocol, and of the protocols that an option requires.
_IS: Mapping[Kind, str] = {
    BUS: "is a bus with a master",
    RING: "is a ring",
    HOST: "has one host and one device",
}
_WITH: Mapping[Kind, str] = {BUS: "a bus with a master", RING: "a ring", HOST: "a host with one device"}

#: Option, by parameter name, to the kinds that it applies to; options not listed apply to all.
Belongs = Mapping[str, Collection[Kind]]


def kind_of(protocol: Protocol) -> Kind:
    """Return the kind of bus of a protocol. Raises Failure if it is not supported."""
    match protocol.bus.kind, frame_plan(protocol.frame).receiver:
        case "host", InStep():
            return HOST
        case "ring", Marks():
            return RING
        case "master_slave" | "link", Hunt() | Rescan() | Marks() | Gaps():
            return BUS
    raise Failure(
        f"{protocol.name}: frames of this kind on a bus of kind {protocol.bus.kind} can be encoded and "
        "decoded, but not driven; supported are frames of parts with master_slave or link, marked with ring, "
        "packet with host"
    )


def check_options(name: str, kind: Kind, belongs: Belongs) -> None:
    """Refuse options that do not apply to this kind of bus."""
    context = click.get_current_context()
    for parameter in context.command.params:
        kinds = belongs.get(parameter.name or "", (kind,))
        given = context.get_parameter_source(parameter.name or "") is ParameterSource.COMMANDLINE
        if given and kind not in kinds:
            goes_with = " or ".join(_WITH[each] for each in kinds)
            raise Failure(f"{parameter.opts[-1]} requires {goes_with}; {name} {_IS[kind]}: omit it")
