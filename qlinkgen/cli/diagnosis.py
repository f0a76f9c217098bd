"""What ``qlinkgen doctor`` finds out about an open port, and what it advises."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from qlinkgen.codecs import qlink
from qlinkgen.transport.conversation import host_slack, timing_of
from qlinkgen.transport.port import Ability, Port

#: What is reckoned with: the request that a motion program sends all day long.
COMMAND = qlink.COMMANDS["motion"]

#: A latency above this costs more than most transactions themselves last.
TOO_SLOW = 0.002

#: Seconds without a byte after which a line counts as quiet; a master that polls leaves far less.
QUIET = 0.1

#: Q.link receivers hunt for the preamble A5 A5, so to them this byte is nothing.
PROBE = b"\x00"

RULE = 'ACTION=="add", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", ATTR{latency_timer}="1"'
RULE_FILE = "/etc/udev/rules.d/99-qlinkgen.rules"

#: Where udev keeps names that belong to an adapter instead of a plug.
BY_ID = Path("/dev/serial/by-id")


@dataclass(frozen=True, slots=True)
class Advice:
    """One thing to do, or to know."""

    kind: Literal["fix", "note"]
    text: str


@dataclass(frozen=True, slots=True)
class Echo:
    """What came back after one byte was sent.

    Attributes:
        heard: the byte came back; None where others were sending, so nothing can be said.
        seconds: time until something came.
        received: what came, as hex.
    """

    heard: bool | None
    seconds: float | None
    received: str


@dataclass(frozen=True, slots=True)
class Cost:
    """The terms of one transaction's deadline, in seconds; `longest` is its request and its answer."""

    command: str
    longest: int
    on_wire: float
    allowance: float
    host_slack: float
    deadline: float


def cost(port: Port) -> Cost:
    """Reckon what a transaction takes on a port."""
    timing = timing_of(qlink, port)
    longest = COMMAND.request.MAX_WIRE_SIZE + (COMMAND.response.MAX_WIRE_SIZE if COMMAND.response else 0)
    terms = timing.on_wire(longest), timing.allowance(COMMAND), timing.host_slack
    return Cost(COMMAND.name, longest, *terms, timing.deadline(COMMAND))


def probe(port: Port) -> Echo:
    """Send one byte on a quiet line and listen for it."""
    if noise := port.read(QUIET):
        return Echo(None, None, noise.hex())
    sent = port.now()
    port.write(PROBE)
    received = port.read(QUIET + host_slack(port))
    seconds = port.now() - sent
    if not received:
        return Echo(False, None, "")
    return Echo(True if received == PROBE else None, seconds, received.hex())


def advise(port: Port, name: str, echo: Echo | None) -> list[Advice]:
    """Say what to change, and what to know."""
    return [*_of_latency(port), *_of_line(port), *_of_name(name), *_of_echo(echo)]


def _of_latency(port: Port) -> list[Advice]:
    found = port.capabilities
    if found.latency is not None:
        return [_too_slow(found.latency)] if found.latency > TOO_SLOW else []
    assumed = f"{host_slack(port) * 1000:.0f} ms of host slack are reckoned with"
    if found.low_latency is Ability.YES or not found.driver:
        return [Advice("note", f"its latency is unknown ({found.latency_source}), so {assumed}")]
    return [
        Advice(
            "note",
            f"the driver {found.driver} refused low latency; try `sudo setserial {port.name} low_latency`: "
            f"if that is refused too, it has no such mode. Its latency is unknown, so {assumed}",
        )
    ]


def _too_slow(latency: float) -> Advice:
    return Advice(
        "fix",
        f"the adapter holds bytes back for {latency * 1000:.0f} ms; `echo '{RULE}' | sudo tee {RULE_FILE}`, "
        "then unplug it and plug it in again",
    )


def _of_line(port: Port) -> list[Advice]:
    if port.capabilities.paced is Ability.NO:
        return [Advice("note", "this is no real line: its timing says nothing about one")]
    return []


def _of_name(name: str) -> list[Advice]:
    """A number such as in ttyUSB0 depends on the order of plugging in."""
    if os.path.realpath(name) != str(Path(name).absolute()) or not BY_ID.is_dir():
        return []
    same = [link for link in sorted(BY_ID.iterdir()) if os.path.realpath(link) == name]
    return [Advice("note", f"{same[0]} is a name that stays with this adapter")] if same else []


def _of_echo(echo: Echo | None) -> list[Advice]:
    if echo is None or echo.heard is False:
        return []
    if echo.heard:
        return [
            Advice(
                "note",
                "the port hears what it sends, as on two wires; masters of qlinkgen find that out themselves",
            )
        ]
    text = f"others are sending on this line ({echo.received[:32]})"
    fix = "end other masters; if there is none, check baud rate, termination and bias of the line"
    return [Advice("fix", f"{text}; {fix}")]
