"""``qlinkgen send`` for a chip set: one transaction, for an axis."""

from __future__ import annotations

from typing import Literal

import click

from qlinkgen.cli import jsonlines
from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.decode import message_record
from qlinkgen.cli.wire_options import Line, open_free
from qlinkgen.codecs import mc1231a
from qlinkgen.codecs.mc1231a_bus import AxisCalls
from qlinkgen.link.codec import Framed
from qlinkgen.link.transaction import Packet
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.protocols.mc1231a import Host
from qlinkgen.protocols.mc1231a.facts import AXES, SELECT


def send_to_chip(
    protocol: Protocol,
    message: Message,
    request: Framed,
    port: str,
    *,
    axis: int | None,
    checksum: Literal["always", "never"],
    check: bool,
    attempts: int,
    slack: float | None,
    baud: int | None,
    line: Line,
) -> None:
    """Select the axis if one is given, send the packet, and print the response."""
    _check_axis(message, axis)
    axes = _checked_axes(request, axis) if check else []
    context = None if axis is None else SELECT[axis]
    with (
        open_free(protocol, port, baud, line) as opened,
        Host(opened, checksum=checksum, attempts=attempts, slack=slack) as host,
    ):
        response = host.transact(Packet(request, context)).response
        if checksum == "always" or response.FIELDS:  # otherwise the host did not wait for a response
            click.echo(jsonlines.line(message_record(protocol, response)))
        for each in axes:
            host.raise_command_error(each)


def _check_axis(message: Message, axis: int | None) -> None:
    if axis is not None and not hasattr(AxisCalls, message.command):
        raise Failure(f"{message.command} does not depend on the current axis; omit --axis {axis}")


def _checked_axes(request: Framed, axis: int | None) -> list[int]:
    """Return the axes whose status word is to be read."""
    if axis is not None:
        return [axis]
    if isinstance(request, mc1231a.MultiUpdateRequest):
        return [each for each in AXES if request.axes >> (each - 1) & 1]
    raise Failure("--check reads the status word of an axis; add --axis 1 or --axis 2")
