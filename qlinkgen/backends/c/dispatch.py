"""Dispatch tables: one function pointer for each command of a slave, for each response of a master."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from qlinkgen.backends.c.framing import Address, checks
from qlinkgen.backends.c.names import Names
from qlinkgen.model.message import Message
from qlinkgen.model.naming import handler, snake
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.transaction import Allowance, Bus, Command, Repeat
from qlinkgen.plan.tree import MessagePlan


def told_name(names: Names, message: Message) -> str:
    """The member for a message that a master or a listener is told of."""
    stem = names.stem(message)
    return handler(stem.removesuffix("_response") if message.direction == "response" else stem, names.address)


def slave_entries(names: Names, kept: tuple[Message, ...]) -> list[dict[str, Any]]:
    """What a slave can be asked, in schema order."""
    entries, present = [], {message.name for message in kept}
    for message in kept:
        if message.direction == "response":
            continue
        command = names.command_of(message)
        answer = command.response if command else None
        answer = answer if answer and answer.name in present else None
        entries.append(_entry(names, message, answer, command))
    return entries


def _entry(names: Names, message: Message, answer: Message | None, command: Command | None) -> dict[str, Any]:
    addressing = command.addressing if command else "none"
    return {
        "name": handler(snake(command.name) if command else names.stem(message), names.address),
        "constant": names.constant(message),
        "function": names.function(message),
        "has_struct": bool(message.values),
        "has_bytes": bool(message.fields),
        "answered": answer is not None,
        "answer_function": names.function(answer) if answer else "",
        "answer_constant": names.constant(answer) if answer else "",
        "answer_struct": bool(answer and answer.values),
        # A message of no command goes to one node.
        "refuses_broadcast": addressing in ("node", "none"),
        "broadcast_only": addressing == "broadcast",
        "silent_broadcast": answer is not None and addressing == "either",
    }


def master_entries(names: Names, address: Address, kept: Sequence[MessagePlan]) -> list[dict[str, Any]]:
    """What a master can be told, in schema order."""
    told = [message for message in kept if message.direction != "request"]
    return [
        {**check, "name": told_name(names, message.message)}
        for message, check in zip(told, checks(names, address, told), strict=True)
    ]


def transactions(protocol: Protocol, upper: str, commands: tuple[Command, ...]) -> list[dict[str, Any]]:
    """Constants of each transaction."""
    return [
        {
            "constant": f"{upper}_{snake(command.name).upper()}",
            "name": command.name,
            "answered": command.response is not None,
            "bits": _bits(command.response_within, protocol.bus),
            "microseconds": _microseconds(command.response_within),
            "addressing": command.addressing.upper(),
            "repeat": _repeat(command.repeat),
            "counter": command.repeat.counter,
            "in_flight": command.in_flight,
        }
        for command in commands
    ]


def _repeat(repeat: Repeat) -> str:
    if repeat.counter:
        return "BY_COUNTER"
    return "SAFE" if repeat.safe else "UNSAFE"


def _bits(allowance: Allowance, bus: Bus) -> int:
    bits = allowance.byte_times * bus.bits_per_byte
    return -(-bits.numerator // bits.denominator)


def _microseconds(allowance: Allowance) -> int:
    time = allowance.seconds * 1_000_000
    return -(-time.numerator // time.denominator)
