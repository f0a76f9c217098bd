"""Findings of ``qlinkgen doctor`` about an open port, and its advice."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Literal

from qlinkgen._dataclass import dataclass
from qlinkgen.link.codec import Module
from qlinkgen.link.echo import PROBE
from qlinkgen.transport.conversation import host_slack, timing_of
from qlinkgen.transport.port import Ability, Port

#: A latency above this takes longer than most transactions.
TOO_SLOW = 0.002

#: Seconds without a byte after which a line is idle; a polling master pauses far less.
QUIET = 0.1

RULE = 'ACTION=="add", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", ATTR{latency_timer}="1"'
RULE_FILE = "/etc/udev/rules.d/99-qlinkgen.rules"

#: Where udev keeps names of adapters that do not depend on the socket.
BY_ID = Path("/dev/serial/by-id")


@dataclass(frozen=True, slots=True)
class Advice:
    """One recommendation or note."""

    kind: Literal["fix", "note"]
    text: str


@dataclass(frozen=True, slots=True)
class Echo:
    """The result of sending one byte.

    Attributes:
        heard: the byte was received; None if other traffic makes this uncertain.
        seconds: time until the first byte was received.
        received: the bytes received, as hex.
    """

    heard: bool | None
    seconds: float | None
    received: str


@dataclass(frozen=True, slots=True)
class Cost:
    """The terms of a transaction's deadline, in seconds.

    `longest` is the size of request and response; `frame_ends` the silence or break that marks frames.
    """

    command: str
    longest: int
    on_wire: float
    allowance: float
    host_slack: float
    frame_ends: float
    deadline: float


def cost(port: Port, codec: Module) -> Cost:
    """Compute the duration of the longest transaction on a port."""
    timing = timing_of(codec, port)
    command = max(codec.COMMANDS.values(), key=timing.deadline)
    deadline, allowance = timing.deadline(command), timing.allowance(command)
    on_wire = deadline - allowance - timing.slack
    ends = timing.slack - timing.host_slack
    size = round(on_wire / timing.byte_time)
    return Cost(command.name, size, on_wire, allowance, timing.host_slack, ends, deadline)


def probe(port: Port) -> Echo:
    """Send a byte of an echo probe on an idle line and listen for it."""
    if noise := port.read(QUIET):
        return Echo(None, None, noise.hex())
    sent = port.now()
    port.write(PROBE[:1])
    received = port.read(QUIET + host_slack(port))
    seconds = port.now() - sent
    if not received:
        return Echo(False, None, "")
    return Echo(True if received == PROBE[:1] else None, seconds, received.hex())


def advise(port: Port, name: str, echo: Echo | None) -> list[Advice]:
    """Return recommendations and notes."""
    return [*_of_latency(port), *_of_line(port), *_of_name(name), *_of_echo(echo)]


def _of_latency(port: Port) -> list[Advice]:
    found = port.capabilities
    if found.latency is not None:
        return [_too_slow(found.latency)] if found.latency > TOO_SLOW else []
    assumed = f"{host_slack(port) * 1000:.0f} ms of host slack are assumed"
    if found.low_latency is Ability.YES or not found.driver:
        return [Advice("note", f"its latency is unknown ({found.latency_source}), so {assumed}")]
    return [
        Advice(
            "note",
            f"the driver {found.driver} refused low latency; try `sudo setserial {port.name} low_latency`: "
            f"if that fails too, it does not support it. Its latency is unknown, so {assumed}",
        )
    ]


def _too_slow(latency: float) -> Advice:
    return Advice(
        "fix",
        f"the adapter holds bytes back for {latency * 1000:.0f} ms; `echo '{RULE}' | sudo tee {RULE_FILE}`, "
        "then reconnect it",
    )


def _of_line(port: Port) -> list[Advice]:
    if port.capabilities.paced is Ability.NO:
        return [
            Advice("note", "bytes ignore the baud rate here: the timing differs from that of a serial line")
        ]
    return []


def _of_name(name: str) -> list[Advice]:
    """Recommend a stable name: the number in ttyUSB0 depends on the order of connection."""
    if os.path.realpath(name) != str(Path(name).absolute()) or not BY_ID.is_dir():
        return []
    same = [link for link in sorted(BY_ID.iterdir()) if os.path.realpath(link) == name]
    return [Advice("note", f"{same[0]} is a stable name of this adapter")] if same else []


def _of_echo(echo: Echo | None) -> list[Advice]:
    if echo is None or echo.heard is False:
        return []
    if echo.heard:
        return [
            Advice(
                "note",
                "the port receives its own bytes, as on two wires; masters of qlinkgen detect this",
            )
        ]
    text = f"unexpected bytes on this line ({echo.received[:32]})"
    fix = "stop other masters; otherwise check baud rate, termination and bias of the line"
    return [Advice("fix", f"{text}; {fix}")]
