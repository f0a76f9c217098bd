"""Commands of any protocol to try behaviours on: its schema decides which behaviours each must show."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Literal

from qlinkgen.link import Timing
from qlinkgen.link.asked import answer_to
from qlinkgen.link.codec import meanings
from qlinkgen.link.many import is_endless, is_listed
from qlinkgen.model.naming import method
from qlinkgen.sim.smallest import required_values
from tests.bus.wires import codec_of
from tests.library.protocols import described

#: one: one answer. many: several answers. each: an answer of each node in a list. dialogue: several frames of
#: the slave. talk: several frames each way. told: no answer.
Shape = Literal["one", "many", "each", "dialogue", "talk", "told"]
ANSWERED: tuple[Shape, ...] = ("one", "many", "each", "dialogue", "talk")


@dataclass(frozen=True)
class Case:
    """A command, and how to call it.

    Attributes:
        protocol: the protocol.
        command: the command of the generated module.
        where: the address, or the number of what a host selects; empty without one.
        values: arguments of its method.
    """

    protocol: str
    command: Any  # of the module's own class
    where: list[int]
    values: dict[str, Any]

    def __str__(self) -> str:
        """Name it in a failure."""
        return f"{self.protocol}: {self.command.name}"

    @property
    def node(self) -> int | None:
        """The address in the error of a call."""
        return self.where[0] if self.where and self.command.request.ADDRESS else None

    @property
    def shape(self) -> Shape:
        """Kind of its answer."""
        command = self.command
        if command.steps:
            return "talk" if any(who == "send" for who, _, _ in command.steps) else "dialogue"
        if command.response is None:
            return "told"
        if command.many is not None:
            return "each" if is_listed(command.many) else "many"
        return "one"

    @property
    def to_all(self) -> bool:
        """All nodes may get it at once, without an answer."""
        return self.command.addressing in {"either", "broadcast"}

    @property
    def refusable(self) -> bool:
        """A reply refuses it."""
        return any("refused" in meanings(each) for each in self.command.replies.values())

    @property
    def checked(self) -> bool:
        """Its answer has a check value, and no frame of its dialogue is without."""
        plan = described(self.protocol).plan
        kinds = [self.command.response, *(kind for _, kind, _ in self.command.steps)]
        return all(plan.message(kind.NAME).envelope.checks for kind in kinds if kind is not None)

    def deadline(self, timing: Timing) -> float:
        """Seconds from the end of its request to the deadline of the first answer."""
        steps = self.command.steps
        return timing.step(steps[0]) if steps else timing.deadline(self.command, 0)

    @property
    def told_apart(self) -> bool:
        """Its answer differs from those to other commands, whatever the request was."""
        codec = codec_of(self.protocol)
        return self.shape == "one" and answer_to(codec) is None and codec.BUS.kind != "host"


def numbers_of(codec: Any) -> list[int]:
    """Addresses for slaves, of which none is that of the master; 0 for frames without one."""
    first = codec.BUS.first_node
    if first is None:
        return [0]
    _, master = getattr(next(iter(codec.COMMANDS.values())).request, "MASTER", None) or ("", None)
    return [number for number in range(first, first + 4) if number != master]


def called(codec: Any, node: int | None) -> Iterator[tuple[Any, list[int], dict[str, Any]]]:
    """Each command with the address and the required values of a call to a node.

    A frame of a dialogue after its request is an argument, too. Requests of records are left out.
    """
    for command in codec.COMMANDS.values():
        rules = {type(rule).__name__ for rule in command.request.RULES}
        if rules & {"RecordRule", "RecordsRule"}:
            continue
        values = required_values(command.request)
        for who, kind, _ in command.steps:
            if who == "send":
                address = {kind.ADDRESS: node} if kind.ADDRESS else {}
                values[kind.NAME.rpartition(".")[2]] = kind(**required_values(kind), **address)
        if listed := getattr(command.many, "each", ""):
            usual = command.request(**values, **{command.request.ADDRESS: node})
            values[listed] = type(getattr(usual, listed))([node])
        addressed = command.request.ADDRESS and command.addressing != "broadcast"
        where = [node] if addressed and node is not None else []
        yield command, where or selected(codec, command), values


def selected(codec: Any, command: Any) -> list[int]:
    """The number of what a command of a host acts on, if it is an argument of its method."""
    rules = getattr(codec, "RESYNC", None)
    if rules is None or not rules.selects:
        return []
    calls = importlib.import_module(f"{codec.__name__}_bus").HostCalls
    taken = inspect.signature(getattr(calls, method(command.name))).parameters
    return [max(rules.selects)] if rules.selected in taken else []


def cases_of(protocol: str, *shapes: Shape, that: Callable[[Case], bool] = lambda _: True) -> list[Case]:
    """The commands of a protocol with most to tell wrong answers by.

    There is one of each shape that may be repeated, and one that may not.
    """
    found: dict[tuple[Shape, bool], Case] = {}
    codec = codec_of(protocol)
    for command, where, values in called(codec, numbers_of(codec)[0]):
        case = Case(protocol, command, where, values)
        if is_endless(command.many) or case.shape not in shapes or not that(case):
            continue
        best = found.setdefault((case.shape, command.repeat_safe), case)
        if _told(case) > _told(best):
            found[case.shape, command.repeat_safe] = case
    return list(found.values())


def _told(case: Case) -> int:
    """Number of fields of its answers whose values the slave decides."""
    command = case.command
    kinds = [kind for who, kind, _ in command.steps if who == "receive"] or [command.response]
    return sum(
        rule.name not in {kind.ADDRESS, *command.echoes} and type(rule).__name__ in {"IntRule", "ArrayRule"}
        for kind in kinds
        if kind is not None
        for rule in kind.RULES
    )
