"""``qlinkgen send`` for the host of a device: one transaction, for what is selected."""

from __future__ import annotations

from types import ModuleType
from typing import Literal

import click

from qlinkgen.bus.making import make_host
from qlinkgen.cli import jsonlines
from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.decode import message_record
from qlinkgen.cli.hosting import rules_of, selected_packet
from qlinkgen.cli.wire_options import Line, open_free
from qlinkgen.link.codec import Framed
from qlinkgen.model.protocol import Protocol
from qlinkgen.protocols.registry import support_of
from qlinkgen.transport.blocking import BlockingMaster


def send_to_device(
    protocol: Protocol,
    codec: ModuleType,
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
    """Select what is to be selected, send the packet, and print the response."""
    packet = selected_packet(protocol, rules_of(protocol, codec), request, axis, given=f"--axis {axis}")
    try:
        verify = support_of(protocol).check_after(request, axis) if check else None
    except ValueError as error:
        raise Failure(str(error)) from None
    with open_free(protocol, port, baud, line) as opened:
        host = BlockingMaster(
            make_host(codec, opened, checksum=checksum, attempts=attempts, slack=slack), opened
        )
        response = host.transact(packet).response
        # Otherwise the host did not wait for a response.
        if response is not None and (checksum == "always" or response.FIELDS):
            click.echo(jsonlines.line(message_record(protocol, response)))
        if verify is not None:
            host.run(verify)
