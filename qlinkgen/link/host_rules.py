"""What a host knows of its protocol, and of each packet, before anything is sent."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from qlinkgen.link.codec import Command, Fault, Framed, Message, Module
from qlinkgen.link.host_timing import HostTiming


class State:
    """States of the engine; `qlinkgen.link.host` has the table of them."""

    IDLE = "idle"
    READY = "ready"
    SELECTING = "selecting"
    WAITING = "waiting"
    GUARD = "guard"
    FILLING = "filling"
    PROVING = "proving"


class HostCodec(Module, Protocol):
    """A generated module of a protocol of the host kind, such as `qlinkgen.codecs.mc1231a`."""

    @property
    def decode_response(self) -> Callable[[bytes, Any], Message]:  # Any: given `Asked` as the request
        """Function that decodes an answer to a request."""
        ...

    @property
    def Fault(self) -> Callable[[str, int, bytes, str], Fault]:  # noqa: N802  # as the generated module has it
        """Bytes that are no message."""
        ...


@dataclass(frozen=True)
class HostRules:
    """What a host has to know of its protocol beside the schema.

    Attributes:
        proof: request that changes nothing and reads something, as the proof of being in step.
        context: request that is sent before the proof where a packet names no context, None for none.
        contexts: what a request leaves in force, by its class: the class of a context, or None where it is
            not known what. Requests that leave everything as it was are not listed.
        fill: byte that does the least harm, as a command and as data.
        fills: other bytes for it, by the class of the request that was under way.
        refusal: checksum by which a command is refused.
    """

    proof: Framed
    context: Framed | None = None
    contexts: Mapping[type[Framed], type[Framed] | None] = field(default_factory=dict)
    fill: int = 0
    fills: Mapping[type[Framed], int] = field(default_factory=dict)
    refusal: bytes = b"\0\0"


class CommandRules:
    """What is known of a command before it is asked: looked up once, not in each transaction."""

    __slots__ = (
        "answer_time", "check", "check_size", "definition", "head", "makes", "moves", "payload",
        "response", "tries",
    )  # fmt: skip

    def __init__(self, command: Command, timing: HostTiming, rules: HostRules, *, check: bool) -> None:
        response = command.response
        self.definition = command
        self.response = response
        self.check = check and response is not None
        self.head = command.request.MAX_WIRE_SIZE - command.request.MAX_SIZE
        # A packet has no frame that could tell its size, so each answer has one size; or there is none.
        self.payload = response.MAX_SIZE if response else 0
        self.check_size = response.MAX_WIRE_SIZE - response.MAX_SIZE if response else 0
        self.answer_time = timing.deadline(command)
        self.tries = timing.attempts_of(command)
        self.moves = command.request in rules.contexts
        self.makes = rules.contexts.get(command.request)


class Asked:
    """A request as it was sent: all that the check of its answer needs, without encoding it again."""

    __slots__ = ("ID", "NAME", "command", "frame", "payload", "request")

    def __init__(self, request: Framed, command: CommandRules, frame: bytes) -> None:
        self.ID = request.ID
        self.NAME = request.NAME
        self.request = request
        self.command = command
        self.frame = frame
        self.payload = frame[command.head :]

    def to_bytes(self) -> bytes:
        """Return the payload, like the request itself."""
        return self.payload


class WayBack:
    """How far a host is on its way back into step.

    Attributes:
        fill: byte to fill up with.
        rounds: rounds that have failed in this transaction.
        silent: how many of them without anything that came.
        heard: something has come in this round.
        fills: bytes that were sent in this round to fill up.
        completed: they have completed a packet.
    """

    __slots__ = ("completed", "fill", "fills", "heard", "rounds", "silent")

    def __init__(self, fill: int) -> None:
        self.fill = fill
        self.rounds = 0
        self.silent = 0
        self.heard = False
        self.fills = 0
        self.completed = False
