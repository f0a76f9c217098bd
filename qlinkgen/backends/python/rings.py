"""The calls of a node of a ring, and its handlers: a typed method for each message."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

from qlinkgen._dataclass import dataclass
from qlinkgen.backends import python_text
from qlinkgen.backends.python import docstrings
from qlinkgen.backends.python.calls import (
    BusModule,
    Caller,
    Method,
    Server,
    caller_doc,
    make_caller,
)
from qlinkgen.backends.python.layout import WIDTH, wrapped
from qlinkgen.backends.python.ports import Asker, Ports
from qlinkgen.model.naming import ring_method
from qlinkgen.plan import MessagePlan, Plan
from qlinkgen.plan.ends import Marks


@dataclass(frozen=True)
class Telling:
    """A message that a method sends."""

    request: MessagePlan
    further: tuple[MessagePlan, ...] = ()

    @property
    def name(self) -> str:
        """Name of the method."""
        return ring_method(self.request.name)


def ring_module(plan: Plan) -> RingModule | None:
    """The module of a ring; None if its nodes have nothing to send, or its frames are not those of a ring."""
    told = [Telling(message) for message in plan.messages if message.message.direction == "message"]
    return RingModule(plan, told) if told and isinstance(plan.frame.receiver, Marks) else None


class RingModule(BusModule):
    """Collects the variables of the template for a ring."""

    each = "message"

    def __init__(self, plan: Plan, told: Sequence[Telling]) -> None:
        """``told`` are the messages that nodes send to one another."""
        super().__init__(plan, ())
        self._told = told

    @cached_property
    def ports(self) -> Ports:
        """The modules with classes that open ports."""
        return Ports(self._plan, [Asker("Ring", "RingCalls", ring=True)], slave=False, nodes=self._nodes())

    @property
    def _titles(self) -> tuple[str, str]:
        return "calls of a node", "its handlers"

    def _callers(self, *, host: bool) -> list[Caller]:  # noqa: ARG002  # as for a bus
        return [self._ring_caller(asynchronous=each) for each in (False, True)]

    def _ring_caller(self, *, asynchronous: bool) -> Caller:
        name = "RingCalls"
        doc = caller_doc(name, "calls of a node", (), asynchronous=asynchronous, each=self.each)
        methods = [self._telling(each, asynchronous=asynchronous) for each in self._told]
        return make_caller(name, doc, methods, asynchronous=asynchronous, one=False)

    def _telling(self, told: Telling, *, asynchronous: bool) -> Method:
        address = self._place.address
        head = self._head(told, address, "None", asynchronous=asynchronous)
        doc = _summary(told.request)
        if not asynchronous:
            doc += self._arguments(told, f"{address}: Nodes along the ring to the receiver, {self._nodes()}.")
        given = [f"{address}={address}", *self._given(told)]
        message = wrapped(f"_message = {self._class(told.request)}(", given, ")", 8)
        wait = "await " if asynchronous else ""
        return Method(head, python_text.docstring(doc), [*message, f"{wait}self.tell(_message)"])

    def _servers(self) -> list[Server]:
        return [
            Server(
                "RingHandlers",
                "a node",
                "_METHODS",
                [f'{self._class(each.request)}: "{each.name}"' for each in self._told],
                [self._taking(each) for each in self._told],
            )
        ]

    def _taking(self, told: Telling) -> Method:
        arguments = ["self", f"message: {self._class(told.request)}", "now: float"]
        head = wrapped(f"def {told.name}(", arguments, ") -> None:", 4)
        return Method(head, python_text.docstring(_summary(told.request)), [])


def _summary(message: MessagePlan) -> list[str]:
    stated = message.message
    text = docstrings.opening(stated.doc or stated.name, stated.section)
    unconfirmed = () if stated.confirmed else ("", docstrings.UNCONFIRMED)
    return [*docstrings.paragraph(text, WIDTH - 12), *unconfirmed]
