"""Common parts of the commands that drive, or are, the device of a host."""

from __future__ import annotations

from types import ModuleType

from qlinkgen.cli.boundary import Failure
from qlinkgen.link.codec import Framed
from qlinkgen.link.host_rules import HostRules
from qlinkgen.link.transaction import Packet
from qlinkgen.model.protocol import Protocol


def check_resync(protocol: Protocol) -> None:
    """Refuse a host of which the schema does not say how it comes back in step."""
    if protocol.bus.resync is None:
        raise Failure(
            f"{protocol.name} does not say how its host comes back in step; "
            "add resync to its bus, such as resync: {command: get_status}"
        )


def rules_of(protocol: Protocol, codec: ModuleType) -> HostRules:
    """Return what a host sends of itself. Raises Failure if the schema does not say so."""
    check_resync(protocol)
    return HostRules.of(codec)


def selected_packet(
    protocol: Protocol, rules: HostRules, request: Framed, number: int | None, *, given: str
) -> Packet:
    """Return a request for what is selected by a number; ``given`` is how the number was given.

    Raises:
        Failure: the command does not depend on it, or the number cannot be selected.
    """
    message = protocol.by_name[request.NAME]
    selection, command = protocol.bus.selection, protocol.command_of(message)
    if number is not None and not (selection and command and selection.decides(command)):
        what = f"the current {selection.attribute}" if selection else "anything that is selected"
        raise Failure(f"{message.command} does not depend on {what}; omit {given}")
    try:
        return rules.packet(request, number)
    except ValueError as error:
        raise Failure(f"{given}: {error}") from None
