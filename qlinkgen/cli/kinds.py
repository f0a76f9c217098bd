"""The kinds of bus, and which option of a command on a port goes with which of them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from enum import Enum

import click
from click.core import ParameterSource

from qlinkgen._resources import schemas_dir
from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.common import find_schema
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan.framing import Hunt, InStep, Marks, Rescan, frame_plan


class Kind(Enum):
    """What there is to drive."""

    BUS = "master_slave"
    RING = "ring"
    HOST = "host"


BUS, RING, HOST = Kind

#: What a protocol of each kind is, and what an option goes with.
_IS: Mapping[Kind, str] = {
    BUS: "is a bus with a master",
    RING: "is a ring",
    HOST: "has one host and one device",
}
_WITH: Mapping[Kind, str] = {BUS: "a bus with a master", RING: "a ring", HOST: "a host with one device"}
_SHIPPED: Mapping[str, Kind] = {"qlink": BUS, "trio": RING, "mc1231a": HOST}

#: Option, as the command's parameter, to the kinds that it goes with; those not listed go with all.
Belongs = Mapping[str, Collection[Kind]]


def is_shipped(name: str, which: str) -> bool:
    """Whether a PROTOCOL is one that ships, so that what was written for it alone can be used."""
    return name == which or find_schema(name).resolve() == (schemas_dir() / f"{which}.yaml").resolve()


def shipped_kind(name: str) -> tuple[str, Kind] | None:
    """The protocol that a PROTOCOL is, and its kind, if it is one that ships."""
    return next(((each, kind) for each, kind in _SHIPPED.items() if is_shipped(name, each)), None)


def kind_of(protocol: Protocol) -> Kind:
    """What kind of bus a protocol is for. Raises Failure where nothing here can drive it."""
    match protocol.bus.kind, frame_plan(protocol.frame).receiver:
        case "host", InStep():
            return HOST
        case "ring", Marks():
            return RING
        case "master_slave", Hunt() | Rescan() | Marks():
            return BUS
    raise Failure(
        f"{protocol.name}: frames of this kind on a bus of kind {protocol.bus.kind} can be encoded and "
        "decoded, not driven; what can be is frames with master_slave, marked ones with ring, packets "
        "with host"
    )


def check_options(name: str, kind: Kind, belongs: Belongs) -> None:
    """Refuse options that were given and do not go with this kind of bus."""
    context = click.get_current_context()
    for parameter in context.command.params:
        kinds = belongs.get(parameter.name or "", (kind,))
        given = context.get_parameter_source(parameter.name or "") is ParameterSource.COMMANDLINE
        if given and kind not in kinds:
            goes_with = " or ".join(_WITH[each] for each in kinds)
            raise Failure(f"{parameter.opts[-1]} goes with {goes_with}; {name} {_IS[kind]}: leave it out")
