"""Rules of a host's protocol and its commands, and the state of a request."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, Self

from qlinkgen.link.codec import Command, Fault, Framed, Message, Module
from qlinkgen.link.host_timing import HostTiming
from qlinkgen.link.transaction import Packet


class Resync(Protocol):
    """How a host comes back in step with its device, and what its commands act on, of a generated module."""

    command: str
    fill: int
    fills: Mapping[str, int]
    rejected: bytes
    selected: str
    selects: Mapping[int, str]
    lost_by: tuple[str, ...]


class HostCodec(Module, Protocol):
    """A generated module of a protocol of the host kind, such as `qlinkgen.codecs.mc1231a`."""

    @property
    def decode_response(self) -> Callable[[bytes, Any], Message]:  # Any: given `Asked` as the request
        """Function that decodes the answer to a request."""
        ...

    @property
    def RESYNC(self) -> Resync:  # noqa: N802
        """How the host comes back in step; modules have it whose schema says so."""
        ...

    @property
    def Fault(self) -> Callable[[str, int, bytes, str], Fault]:  # noqa: N802  # as the generated module has it
        """Bytes that are not a message."""
        ...


@dataclass(frozen=True)
class HostRules:
    """How a host comes back in step with its device, in messages of the generated module.

    Attributes:
        proof: request without side effects whose answer verifies that host and device are in step.
        context: context request sent before the proof if the packet has no context; None for none.
        contexts: context in force after a request, by its class: the class of a context request, or None if
            unknown. Requests that do not change the context are not listed.
        fill: the least harmful byte, both as a command and as data.
        fills: other fill bytes, by the class of the pending request.
        refusal: checksum of a refused command, empty if there is none.
        selected: what some context requests select, such as "axis"; "" if nothing is selected.
        selects: these requests, by the number of what they select.
    """

    proof: Framed
    context: Framed | None = None
    contexts: Mapping[type[Framed], type[Framed] | None] = field(default_factory=dict)
    fill: int = 0
    fills: Mapping[type[Framed], int] = field(default_factory=dict)
    refusal: bytes = b""
    selected: str = ""
    selects: Mapping[int, Framed] = field(default_factory=dict)

    @classmethod
    def of(cls, codec: HostCodec) -> Self:
        """Make the rules that a schema states."""
        stated, commands = codec.RESYNC, codec.COMMANDS
        selects = {number: _bare(commands[name]) for number, name in stated.selects.items()}
        contexts: dict[type[Framed], type[Framed] | None] = {
            type(each): type(each) for each in selects.values()
        }
        contexts |= {commands[name].request: None for name in stated.lost_by}
        return cls(
            proof=_bare(commands[stated.command]),
            context=next(iter(selects.values()), None),
            contexts=contexts,
            fill=stated.fill,
            fills={commands[name].request: fill for name, fill in stated.fills.items()},
            refusal=stated.rejected,
            selected=stated.selected,
            selects=selects,
        )

    def packet(self, request: Framed, number: int | None) -> Packet:
        """Return the packet of a request, for the selected number if one is given.

        Raises:
            ValueError: the number cannot be selected.
        """
        if number is None:
            return Packet(request)
        context = self.selects.get(number)
        if context is None:
            raise ValueError(f"{self.selected} must be {_either(self.selects)}, not {number!r}")
        return Packet(request, context)


def _bare(command: Command) -> Framed:
    """Return the request of a command without data."""
    make: Callable[[], Framed] = command.request
    return make()


def _either(numbers: Iterable[int]) -> str:
    *first, last = map(str, numbers)
    return f"{', '.join(first)} or {last}" if first else last


class CommandRules:
    """Sizes, deadline and effect of a command, computed once instead of for each transaction."""

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
        # Packets have no length, so every answer of a command has the same size, 0 if there is none.
        self.payload = response.MAX_SIZE if response else 0
        self.check_size = response.MAX_WIRE_SIZE - response.MAX_SIZE if response else 0
        self.answer_time = timing.deadline(command)
        self.tries = timing.attempts_of(command)
        self.moves = command.request in rules.contexts
        self.makes = rules.contexts.get(command.request)


class Asked:
    """A request as sent, with all that decoding its answer needs, without encoding it again."""

    __slots__ = ("ID", "NAME", "command", "frame", "payload", "request")

    def __init__(self, request: Framed, command: CommandRules, frame: bytes) -> None:
        self.ID = request.ID
        self.NAME = request.NAME
        self.request = request
        self.command = command
        self.frame = frame
        self.payload = frame[command.head :]

    def to_bytes(self) -> bytes:
        """Return the payload."""
        return self.payload
