"""What headers and slave may take, and whether they do: CI fails 10 % above, and where an answer is late."""

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


@dataclass(frozen=True)
class Limit:
    """Bytes of flash: core with its first message, get and put of each further one; bytes of stack."""

    core: int
    message: int
    stack: int


LIMITS = {CORTEX_M0.name: Limit(450, 100, 64), AVR.name: Limit(550, 150, 32)}
RECEIVER = 10  # bytes of RAM on top of the longest payload
# Flash, and all of the RAM with the stack. Most of the RAM is the store for a program that is loaded.
SLAVES = {"microbit": (6750, 5600), "lm3s6965evb": (6750, 5600), "atmega328p": (9200, 1250)}


@dataclass(frozen=True)
class Allowance:
    """A message that takes more than the budget: how much CI lets it have by target, and why it does."""

    flash: Mapping[str, int]
    reason: str


# By protocol and message. What is here has not met the budget, and the page says so.
ALLOWANCES = {
    ("qlink", "node_info.response"): Allowance(
        {CORTEX_M0.name: 120, AVR.name: 184},
        "seven fields in eleven bytes; the budget is that of five in nine",
    ),
    ("qlink", "motion.request"): Allowance(
        {CORTEX_M0.name: 128, AVR.name: 164}, "words of any number, told by the size and checked both ways"
    ),
    ("qlink", "motion.response"): Allowance(
        {CORTEX_M0.name: 104, AVR.name: 172}, "avr-gcc 5 has no displacement for the pointer to the message"
    ),
    ("trio", "character_transfer"): Allowance(
        {CORTEX_M0.name: 116, AVR.name: 190},
        "every character is looked at, before it is sent and when it came",
    ),
    ("trio", "direct_variable_transfer"): Allowance(
        {CORTEX_M0.name: 324, AVR.name: 1018}, "64 bits in groups of seven, shifted on processors of 32 and 8"
    ),
}


# Stack that is above the budget, by target and what takes it: how much CI lets it have. The page says so.
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
    """Every figure that has a limit; of the messages those that take most."""
    found = []
    for target in TARGETS:
        for name, costs in measured.messages[target.name].items():
            found += message_goals(target, name, costs.fields)
    return [*_other_goals(measured), *found]


def _other_goals(measured: Measured, *, held: bool = False) -> list[Goal]:
    """Everything but the flash of messages; `held` to what CI lets it have instead of the budget."""
    found = []
    for target in TARGETS:
        found += core_goals(target, measured.core[target.name]["LOOP"])
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
    """Receiver, encode, bitwise CRC and one message: flash and stack."""
    limit, what = LIMITS[target.name], f"{target.title}: receiver, encode, bitwise CRC, one message"
    return [
        Goal(what, core.size.flash, limit.core, "bytes"),
        Goal(f"{what}: stack", core.stack, limit.stack, "bytes"),
    ]


def message_goals(target: Target, protocol: str, messages: Messages) -> list[Goal]:
    """Get and put: each message above the budget, or the largest, and what one takes on average."""
    limit, what = LIMITS[target.name].message, f"{target.title}, {protocol}: get and put"
    largest = max(messages.each, key=lambda name: messages.each[name].size.flash)
    above = [name for name, each in messages.each.items() if each.size.flash > limit]
    return [
        *(
            Goal(f"{what}, {name}", messages.each[name].size.flash, limit, "bytes")
            for name in above or [largest]
        ),
        Goal(f"{what}, all messages, for each of them", messages.mean, limit, "bytes"),
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
    """RAM that receiving takes."""
    limit = RECEIVER + sizes["payload"]
    return Goal(f"{target.title}, {protocol}: RAM to receive", sizes["receiver"], limit, "bytes")


def deep_stacks(measured: Measured, target: Target) -> list[tuple[str, int]]:
    """What goes deeper than one message with its fields: a name, for STACK_ALLOWANCES, and bytes."""
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
    """The slowest answer of the AVR slave, and the time that the protocol allows it."""
    which, reply = run.slowest, run.replies[run.slowest]
    return Goal(f"slave on atmega328p: slowest answer, {which}", reply.us, reply.allowed_us, TIME)


def each_message(target: Target, protocol: str, messages: Messages) -> list[Goal]:
    """The flash of get and put of every message, and of all of them, by what CI lets them have."""
    what = f"{target.title}, {protocol}"
    found = [
        Goal(f"{what}: {name}", each.size.flash, allowed(target, protocol, name), "bytes")
        for name, each in messages.each.items()
    ]
    mean = sum(goal.limit for goal in found) / len(found)
    return [*found, Goal(f"{what}: all messages, for each of them", messages.mean, mean, "bytes")]


def complaints(measured: Measured) -> list[str]:
    """What is more than the slack above its limit, a sentence each; each message is looked at."""
    found = _other_goals(measured, held=True)
    for target in TARGETS:
        for protocol, costs in measured.messages[target.name].items():
            found += each_message(target, protocol, costs.fields)
    return [f"{goal.what}: {figure(goal)}" for goal in found if broken(goal)]


def broken(goal: Goal) -> bool:
    """Whether CI fails for it: bytes have their slack, a time that the protocol allows has none."""
    return goal.measured > (1.0 if goal.unit == TIME else SLACK) * goal.limit


def figure(goal: Goal) -> str:
    """What was measured, and the limit."""
    return f"{goal.measured:.0f} of {goal.limit:.0f} {goal.unit}"
