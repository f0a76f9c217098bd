"""A node of any protocol with a master, derived from the schema alone."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import cast

from qlinkgen.link.asked import answer_to
from qlinkgen.link.codec import Codec, Command, Echoes, Framed, Many, Message, is_message
from qlinkgen.link.device import DeviceCodec
from qlinkgen.link.many import is_endless, is_listed, nodes_asked
from qlinkgen.link.slave_dialogue import Handling, Refusal
from qlinkgen.link.turn import is_turned
from qlinkgen.model.transaction import Proof
from qlinkgen.plan import Plan
from qlinkgen.plan.codec import Codec as Interpreter
from qlinkgen.plan.content import with_decided
from qlinkgen.sim.memory import Memory
from qlinkgen.sim.refusals import Refusals
from qlinkgen.sim.smallest import items_of, required_values, with_smallest
from qlinkgen.sim.tables import Table
from qlinkgen.sim.values import Values


class GenericNode:
    """Answers every command with the values given to it, otherwise with the defaults of its response.

    Echoed fields repeat the request, and required fields have their smallest legal value. A list whose size
    the request tells has its items again and again. Without a memory, written values cannot be read back.

    Attributes:
        number: address of the node; 0 for frames without one.
        requests: number of requests.
    """

    def __init__(
        self,
        codec: Codec | DeviceCodec,
        number: int = 0,
        plan: Plan | None = None,
        *,
        values: Values | None = None,
        memory: Memory | None = None,
        tables: Sequence[Table] = (),
        refusals: Refusals | None = None,
    ) -> None:
        """Make a node of a generated module.

        Args:
            codec: the module.
            number: its address.
            plan: the plan of the same protocol gives the defaults of fields that echoed ones decide.
            values: values of its answers.
            memory: keeps what requests set, in place of these values.
            tables: keep what requests set under a number.
            refusals: the requests that it refuses.
        """
        self.number = number
        self._values = values
        self._memory = memory
        self._tables = tables
        self._refusals = refusals
        self._now = 0.0
        self.requests = 0
        self._codec = codec
        self._interpreter = Interpreter(plan) if plan else None
        self._commands = {command.request: command for command in codec.COMMANDS.values()}
        self._required = {
            command.response: required_values(command.response)
            for command in codec.COMMANDS.values()
            if command.response is not None
        }

    def handle(
        self, request: Framed, now: float
    ) -> Message | list[Message] | Iterator[Message] | Handling | None:
        """Return the response or responses to a request; None if the command has none or is unknown.

        Raises:
            Refusal: it refuses the request.
        """
        self.requests += 1
        self._now = now
        command = self._commands.get(type(request))
        if command is not None and self._refusals and (refusal := self._refusals.of(command)):
            reply, given = refusal
            answer = self._answer(reply.message, request, reply.echoes, {})
            if reply.meaning(answer) != "refused":
                answer = self._answer(reply.message, request, reply.echoes, given)
            raise Refusal(answer)
        if self._memory:
            self._memory.keep(request)
        for table in self._tables:
            table.keep(request)
        if command is None or command.response is None:
            return None
        if command.steps:
            return self._talk(command, request)
        sizes = _sizes(command, request)
        if command.many is None:
            return self._answer(command.response, request, command.echoes, sizes)
        return self._several(command, command.many, request, sizes)

    def example(self, command: Command) -> Message:
        """Return the response of a command that has one, to the request with the smallest legal values."""
        assert command.response is not None
        values = required_values(command.request)
        if address := command.request.ADDRESS:
            values[address] = self.number
        make: Callable[..., Framed] = command.request
        request = make(**values)
        return self._answer(command.response, request, command.echoes, _sizes(command, request))

    def _several(
        self, command: Command, many: Many, request: Framed, values: dict[str, object]
    ) -> list[Message] | Iterator[Message]:
        """Return as few answers as there may be; those without an end all the time."""
        assert command.response is not None
        if is_listed(many):
            nodes = nodes_asked(many, request)
            own = [{**values, many.by: node} for node in nodes or ()] if many.by else [values]
            return [self._answer(command.response, request, command.echoes, each) for each in own]
        if many.until is not None:
            field, first, _ = many.until
            values = {**values, field: first}
        count = int(getattr(request, many.counted_by)) if many.counted_by else many.count
        one = self._answer(command.response, request, command.echoes, values)
        if is_endless(many):
            return itertools.repeat(one)
        if many.reply is None:
            rest = (self._answer(command.response, request, command.echoes, values) for _ in range(1, count))
            return [one, *rest]
        return [one, self._answer(many.reply, request, command.replies[many.reply].echoes, {})]

    def _talk(self, command: Command, request: Framed) -> Handling:
        """Yield the answers to each frame of a dialogue."""
        sizes = _sizes(command, request)
        answers: list[Message] = []
        for who, kind, _ in command.steps:
            if who == "send":
                sizes |= _sizes(command, (yield answers))
                answers = []
            else:
                last = kind is command.response
                answers.append(
                    self._answer(kind, request, command.echoes if last else {}, sizes if last else {})
                )
        return answers

    def _answer(
        self, kind: type[Message], request: Framed, echoes: Echoes, given: Mapping[str, object]
    ) -> Message:
        required = dict(self._required.get(kind) or required_values(kind))
        values = dict(required)
        own = self._own(kind.NAME)
        values |= own
        values |= {name: getattr(request, of) if isinstance(of, str) else of for name, of in echoes.items()}
        values |= {name: _repeated(own.get(name), each) for name, each in given.items()}
        for table in self._tables:
            kept = table.of(kind.NAME, request, values)
            own, values = {**own, **kept}, {**values, **kept}
        if address := kind.ADDRESS:
            required[address] = values[address] = self.number
        make: Callable[..., Message] = kind
        if own and given:
            for name in list(self._ruled_out(make, required, values)):
                del values[name]
        message = with_smallest(make(**values))
        settled = self._settled(self._interpreter, message, request) if self._interpreter else message
        if settled is not message:
            for name in own.keys() - echoes.keys():
                if getattr(settled, name) is not None:
                    setattr(settled, name, values[name])
        return settled

    def _ruled_out(
        self, kind: Callable[..., Message], required: Mapping[str, object], values: Mapping[str, object]
    ) -> Iterator[str]:
        """The fields that a new answer has, and that it does not have with these values of others."""
        usual = kind(**required)
        for name in values.keys() - required.keys():
            others = {each: value for each, value in values.items() if each != name}
            if getattr(usual, name) is not None and getattr(kind(**others), name) is None:
                yield name

    def _own(self, name: str) -> dict[str, object]:
        """Return the values given to the node for an answer, and those that requests have set."""
        values = self._values.of(name, self._now) if self._values else {}
        kept = {**values, **self._memory.of(name)} if self._memory else values
        return {name: value for name, value in kept.items() if value is not None}  # absent unless decided

    def _settled(self, interpreter: Interpreter, message: Message, request: Framed) -> Message:
        """Return an answer in which the fields that echoed values decide have their defaults."""
        plan = interpreter.plan.message(message.NAME)
        deciding = {test.value for field in plan.message.fields for test in field.when}
        if not deciding.intersection(plan.message.echoes):
            return message
        codec = cast(Codec, self._codec)  # packets have no such fields
        asked = codec.encode(request)
        decoded = interpreter.decode(asked, "request")
        values = {**decoded.beside, **decoded.values, request.ADDRESS: decoded.address}
        command = next(each for each in interpreter.plan.commands if each.request.name == request.NAME)
        repeated = command.repeated(plan.message).items()
        told = {
            name: values[of] if isinstance(of, str) else of
            for name, of in repeated
            if not isinstance(of, Proof)  # which the engine gives it
        }
        settled = with_decided(plan.payload, told)
        address = self.number if message.ADDRESS else None
        wire = interpreter.encode(message.NAME, settled, address, asked)
        if is_turned(type(message)):
            return type(message).from_bytes(wire)
        (heard,) = filter(is_message, codec.StreamDecoder("response").feed(wire))
        make = answer_to(codec)
        return make(request, heard) if make else heard


def _sizes(command: Command, asked: Framed) -> dict[str, object]:
    """Return as many items of each field of the response as a frame asks for."""
    found: dict[str, object] = {}
    if command.response is not None and type(asked) is command.sized_by:
        for name, number, _ in command.sizes:
            found |= items_of(command.response, name, getattr(asked, number))
    return found


def _repeated(own: object, asked: object) -> object:
    """Return own items in the number of those asked for; without own ones, those."""
    if not isinstance(own, list | bytes | str) or not isinstance(asked, type(own)) or not own:
        return asked
    return (own * (len(asked) // len(own) + 1))[: len(asked)]
