"""The budget of headers and slave: CI fails 10 % above it, and if an answer is late."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from benchmarks.firmware_answers import Run
from benchmarks.firmware_build import AVR, CORTEX_M0, TARGETS, Target
from benchmarks.firmware_measure import Measured
from benchmarks.firmware_size import PAYLOAD, Core, Messages
from benchmarks.report import Goal

SLACK = 1.1
TIME = "us"
SPARE = 5  # microseconds before its deadline that the slowest answer begins


@dataclass(frozen=True)
class Limit:
    """Bytes of flash: core with its first message, get and put of each further one; bytes of stack."""

    core: int
    message: int
    stack: int


LIMITS = {CORTEX_M0.name: Limit(380, 100, 64), AVR.name: Limit(570, 150, 32)}
RECEIVER = 10  # bytes of RAM on top of the longest payload
# Flash, and all of the RAM with the stack. Most of the RAM is the store for a loaded program.
SLAVES = {"microbit": (6200, 5600), "lm3s6965evb": (6200, 5600), "atmega328p": (8620, 1250)}


@dataclass(frozen=True)
class Allowance:
    """A message above the budget: CI's limit by target, and the reason."""

    flash: Mapping[str, int]
    reason: str


# By protocol and message. These have not met the budget, as the page shows.
ALLOWANCES = {
    ("qlink", "node_info.response"): Allowance(
        {CORTEX_M0.name: 120, AVR.name: 184},
        "seven fields in eleven bytes; the budget is for five in nine",
    ),
    ("qlink", "motion.request"): Allowance(
        {CORTEX_M0.name: 128, AVR.name: 164},
        "any number of words, derived from the size and checked both ways",
    ),
    ("qlink", "motion.response"): Allowance(
        {CORTEX_M0.name: 104, AVR.name: 172}, "avr-gcc 5 uses no displacement for the pointer to the message"
    ),
    ("trio", "character_transfer"): Allowance(
        {CORTEX_M0.name: 116, AVR.name: 190},
        "every character is checked, in encoding and decoding",
    ),
    ("trio", "direct_variable_transfer"): Allowance(
        {CORTEX_M0.name: 324, AVR.name: 1018},
        "64 bits in groups of seven, shifted on processors of 32 and 8 bits",
    ),
}


# Stack above the budget, by target and user of the stack: CI's limit. The page shows it.
DEEPEST = "deepest stack of a message with its frame"
DISPATCHING = "stack of a slave that dispatches all commands"
PAYLOADS = "stack of a core for any payload"
STACK_ALLOWANCES = {
    (CORTEX_M0.name, DEEPEST): 88,
    (CORTEX_M0.name, DISPATCHING): 160,
    (CORTEX_M0.name, PAYLOADS): 104,
    (AVR.name, DISPATCHING): 62,
}


def allowed(target: Target, protocol: str, message: str) -> int:
    """Bytes of flash that a message may add."""
    allowance = ALLOWANCES.get((protocol, message))
    return allowance.flash[target.name] if allowance else LIMITS[target.name].message


def goals(measured: Measured) -> list[Goal]:
    """Every figure with a limit; of the messages the largest ones."""
    found = []
    for target in TARGETS:
        for name, costs in measured.messages[target.name].items():
            found += message_goals(target, name, costs.fields)
    return [*_other_goals(measured), *found]


def _other_goals(measured: Measured, *, held: bool = False) -> list[Goal]:
    """All but the flash of messages; with `held`, the limits are CI's instead of the budget."""
    found = []
    for target in TARGETS:
        found += core_goals(target, measured.core[target.name]["FOLD"])
        found += [_stack_goal(target, what, stack, held) for what, stack in deep_stacks(measured, target)]
        for name, costs in measured.messages[target.name].items():
            found += stack_goals(target, name, costs.fields)
            found.append(receiver_goal(target, name, measured.buffers[target.name][name]))
    for port, (flash, ram) in SLAVES.items():
        slave = measured.slaves[port]
        found.append(Goal(f"slave on {port}: flash", slave.size.flash, flash, "bytes"))
        found.append(Goal(f"slave on {port}: RAM with stack", slave.ram, ram, "bytes"))
    return [*found, answer_goal(measured.run)]


def core_goals(target: Target, core: Core) -> list[Goal]:
    """Receiver, encode, folded CRC and one message: flash and stack."""
    limit, what = LIMITS[target.name], f"{target.title}: receiver, encode, folded CRC, one message"
    return [
        Goal(what, core.size.flash, limit.core, "bytes"),
        Goal(f"{what}: stack", core.stack, limit.stack, "bytes"),
    ]


def message_goals(target: Target, protocol: str, messages: Messages) -> list[Goal]:
    """Get and put: each message above the budget, or the largest, and the average."""
    limit, what = LIMITS[target.name].message, f"{target.title}, {protocol}: get and put"
    largest = max(messages.each, key=lambda name: messages.each[name].size.flash)
    above = [name for name, each in messages.each.items() if each.size.flash > limit]
    return [
        *(
            Goal(f"{what}, {name}", messages.each[name].size.flash, limit, "bytes")
            for name in above or [largest]
        ),
        Goal(f"{what}, average of all messages", messages.mean, limit, "bytes"),
    ]


def stack_goals(target: Target, protocol: str, messages: Messages) -> list[Goal]:
    """The deepest stack of a message and that of the receiver."""
    limit, what = LIMITS[target.name], f"{target.title}, {protocol}"
    deepest, place = max((each.stack, name) for name, each in messages.each.items())
    return [
        Goal(f"{what}: deepest stack of get and put, {place}", deepest, limit.stack, "bytes"),
        Goal(f"{what}: stack of the receiver", messages.receive_stack, limit.stack, "bytes"),
    ]


def receiver_goal(target: Target, protocol: str, sizes: Mapping[str, int]) -> Goal:
    """RAM for receiving."""
    limit = RECEIVER + sizes["payload"]
    return Goal(f"{target.title}, {protocol}: RAM to receive", sizes["receiver"], limit, "bytes")


def deep_stacks(measured: Measured, target: Target) -> list[tuple[str, int]]:
    """Stacks deeper than that of one message with its fields: a name, for STACK_ALLOWANCES, and bytes."""
    messages = measured.messages[target.name]["qlink"].framed.each
    return [
        (DEEPEST, max(each.stack for each in messages.values())),
        (DISPATCHING, measured.dispatch[target.name]["all"].stack),
        (PAYLOADS, measured.core[target.name][PAYLOAD].stack),
    ]


def _stack_goal(target: Target, what: str, stack: int, held: bool) -> Goal:
    budget = LIMITS[target.name].stack
    limit = STACK_ALLOWANCES.get((target.name, what), budget) if held else budget
    return Goal(f"{target.title}, qlink: {what}", stack, limit, "bytes")


def answer_goal(run: Run) -> Goal:
    """The slowest answer of the AVR slave, and its limit by the protocol less what it has to spare."""
    which, reply = run.slowest, run.replies[run.slowest]
    return Goal(f"slave on atmega328p: slowest answer, {which}", reply.us, reply.allowed_us - SPARE, TIME)


def each_message(target: Target, protocol: str, messages: Messages) -> list[Goal]:
    """The flash of get and put of every message, and of all of them, with CI's limits."""
    what = f"{target.title}, {protocol}"
    found = [
        Goal(f"{what}: {name}", each.size.flash, allowed(target, protocol, name), "bytes")
        for name, each in messages.each.items()
    ]
    mean = sum(goal.limit for goal in found) / len(found)
    return [*found, Goal(f"{what}: average of all messages", messages.mean, mean, "bytes")]


def complaints(measured: Measured) -> list[str]:
    """Each figure further above its limit than the slack, as a sentence; every message is checked."""
    found = _other_goals(measured, held=True)
    for target in TARGETS:
        for protocol, costs in measured.messages[target.name].items():
            found += each_message(target, protocol, costs.fields)
    return [f"{goal.what}: {figure(goal)}" for goal in found if broken(goal)]


def broken(goal: Goal) -> bool:
    """Whether CI fails for it: bytes have a slack, a time limit of the protocol has none."""
    return goal.measured > (1.0 if goal.unit == TIME else SLACK) * goal.limit


def figure(goal: Goal) -> str:
    """The measured value and the limit."""
    return f"{goal.measured:.0f} of {goal.limit:.0f} {goal.unit}"
