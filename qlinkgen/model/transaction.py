"""Transactions: request, response, timing and repetition."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field
from fractions import Fraction
from types import MappingProxyType
from typing import Literal

from qlinkgen._dataclass import dataclass
from qlinkgen.model.checksum import Checksum
from qlinkgen.model.message import Message
from qlinkgen.model.texts import Labels, Text

#: "node": one node; "broadcast": all nodes; "either": one or all, and only requests to one node are answered;
#: "answered_broadcast": one or all, and a broadcast is answered too, so that only one node may be on the bus;
#: "none": the frame has no address.
Addressing = Literal["node", "broadcast", "either", "answered_broadcast", "none"]
#: "refused": the slave does not do it; "again": it asks for the request once more; "pending": the answer
#: follows later; "done": an answer like the response, of another form.
Means = Literal["refused", "again", "pending", "done"]
#: Who sends the request of a command: the first side of a link or the master of a bus, the second, or both.
Asker = Literal["first", "second", "either"]
BusKind = Literal["master_slave", "link", "ring", "host"]


@dataclass(frozen=True, slots=True)
class Allowance:
    """Response time limit: ``byte_times`` at the speed of the bus plus ``seconds``."""

    byte_times: Fraction = Fraction(0)
    seconds: Fraction = Fraction(0)


@dataclass(frozen=True, slots=True)
class Repeat:
    """Whether a request may be repeated after a missing response."""

    #: Repeating the request is harmless.
    safe: bool
    #: Field by which the slave distinguishes a repeat from a new request, "" if there is none.
    counter: str = ""


@dataclass(frozen=True, slots=True)
class Case:
    """Raw values from ``first`` to ``last`` of the field that decides what a reply means."""

    first: int
    last: int
    means: Means
    #: Name of the value, "" if it is written as a number.
    name: str = ""


@dataclass(frozen=True, slots=True)
class Reply:
    """An answer other than the response, or a response that may refuse the request."""

    name: str
    message: Message
    #: What it means, unless a case says otherwise.
    means: Means = "refused"
    #: Value of the message that decides, "" if nothing does.
    switch: str = ""
    cases: tuple[Case, ...] = ()
    #: Time from the first pending reply to the answer; None: that of the response.
    within: Allowance | None = None
    #: Time from a reply that asks for the request once more until it is sent.
    after: Allowance = Allowance()

    @property
    def meanings(self) -> tuple[Means, ...]:
        """Everything that it can mean."""
        return tuple(dict.fromkeys((self.means, *(case.means for case in self.cases))))

    def means_by(self, raw: int) -> Means:
        """What it means with a raw value of the deciding field; the first case that has it counts."""
        found = (case.means for case in self.cases if case.first <= raw <= case.last)
        return next(found, self.means)


@dataclass(frozen=True, slots=True)
class Proof:
    """A check value of an answer that covers parts of the frame of its request, by their names in ``over``.

    Then it covers the bytes of the answer from ``begin`` up to itself; they are the last but its ``size``.
    """

    algorithm: Checksum
    over: tuple[str, ...]
    begin: int
    size: int


#: What a value of an answer has from its request: the name of a value of it, a number that is the same in all
#: requests of a command, or a check value.
Repeated = str | int | Proof


@dataclass(frozen=True, slots=True)
class Echo:
    """A value of an answer that follows from its request."""

    answer: str
    value: str
    of: Repeated


@dataclass(frozen=True, slots=True)
class Unknown:
    """The reply of a slave to a request with a number that it does not know.

    Attributes:
        message: the reply, to any of the commands.
        added: what its number adds to that of the request, None if it has one of its own.
        raws: fields and their raw numbers; others have their defaults.
    """

    message: Message
    added: int | None
    raws: tuple[tuple[str, int], ...]


@dataclass(frozen=True, slots=True)
class ByCount:
    """A fixed number of answers, or as many as a field of the request says, at most ``most``."""

    most: int
    field: str = ""


@dataclass(frozen=True, slots=True)
class ByField:
    """Answers up to one whose field has a raw value from ``first`` to ``last``."""

    field: str
    first: int
    last: int


@dataclass(frozen=True, slots=True)
class ByReply:
    """Answers up to a reply, which is not one of them."""

    reply: Message


@dataclass(frozen=True, slots=True)
class ByTime:
    """All answers that come in a time."""

    within: Allowance


@dataclass(frozen=True, slots=True)
class ByEach:
    """An answer from each node in a list of the request, of at most ``most``.

    ``key`` is the field with the node in records of that list, "" if it has the nodes themselves. ``by`` is
    the value of an answer with its node, "" for the address of its frame.
    """

    field: str
    most: int
    key: str = ""
    by: str = ""


@dataclass(frozen=True, slots=True)
class ByCommand:
    """Answers come until another command stops them.

    ``within`` is the time limit from one answer to the next, None for that of the first. ``repeats`` are
    values of the stopping request that repeat the value of the same name in the request.
    """

    command: str
    within: Allowance | None = None
    repeats: tuple[str, ...] = ()


#: The end of several answers to one request.
Many = ByCount | ByField | ByReply | ByTime | ByEach | ByCommand


@dataclass(frozen=True, slots=True)
class Step:
    """A frame of a dialogue after its request."""

    message: Message
    #: The master sends it, otherwise the slave.
    sent: bool
    #: Time limit from the frame before it; None for the master: the slave waits until the next request.
    within: Allowance | None = None


@dataclass(frozen=True, slots=True)
class Command:
    """A transaction: a request and its response, None if it is not answered.

    The response of a dialogue is the last message that the slave sends.
    """

    name: str
    id: int
    request: Message
    response: Message | None
    addressing: Addressing
    response_within: Allowance
    repeat: Repeat
    #: Maximum number of outstanding requests.
    in_flight: int = 1
    doc: Text = ""
    section: Text = ""
    confirmed: bool = True
    #: Answers other than the response.
    replies: tuple[Reply, ...] = ()
    #: Fields of the response, and the fields of ``sized_by`` that say how many items they have.
    sizes: tuple[tuple[str, str], ...] = ()
    #: What the master sends that has the latter: the request or a step; None without sizes.
    sized_by: Message | None = None
    #: The end of the answers, None if there is one.
    many: Many | None = None
    #: The frames after the request; () for a request and its response.
    steps: tuple[Step, ...] = ()
    #: What the response means, None if it always answers the request.
    outcome: Reply | None = None
    #: The side that sends the request.
    asker: Asker = "first"
    #: The number of the next request to the node, where frames have a counter; None: that after its own.
    restart: int | None = None
    #: What the fields of its answers repeat.
    echoes: tuple[Echo, ...] = ()
    #: Protocol-specific attributes; names and values are declared in the schema.
    attributes: Labels = field(default_factory=lambda: MappingProxyType({}))

    @property
    def each(self) -> ByEach | None:
        """The list whose nodes answer one by one, None for other commands."""
        return self.many if isinstance(self.many, ByEach) else None

    def repeated(self, answer: Message | None) -> Mapping[str, Repeated]:
        """The values of one of its answers that follow from its request: `Echo.of` by their names."""
        if answer is None:
            return {}
        own = {each.value: each.of for each in self.echoes if each.answer == answer.name}
        return {**{name: name for name in answer.echoed}, **own}

    @property
    def proof(self) -> Proof | None:
        """How its response proves its request, None if it does not."""
        found = self.repeated(self.response).values()
        return next((each for each in found if isinstance(each, Proof)), None)

    @property
    def stopped(self) -> ByCommand | None:
        """The command that stops the answers, None for other commands."""
        return self.many if isinstance(self.many, ByCommand) else None

    @property
    def meant(self) -> tuple[Reply, ...]:
        """All answers that may mean something else than done; the response is the last one."""
        return self.replies if self.outcome is None else (*self.replies, self.outcome)

    @property
    def messages(self) -> tuple[Message, ...]:
        """Its request, its response or the messages of its steps, and its other replies."""
        followed = {step.message.name: step.message for step in self.steps}
        if self.response is not None:
            followed.setdefault(self.response.name, self.response)
        return (self.request, *followed.values(), *(reply.message for reply in self.replies))

    @property
    def answers(self) -> tuple[Message, ...]:
        """Its response and its other replies."""
        response = () if self.response is None else (self.response,)
        return (*response, *(reply.message for reply in self.replies))


@dataclass(frozen=True, slots=True)
class Exchange:
    """A frame that the master sends in a transaction, and the answers to it.

    ``turn`` numbers the frames of all dialogues that a slave waits for, from 1; it is 0 for a request.
    """

    command: Command
    sent: Message
    answers: tuple[Message, ...]
    turn: int = 0
    #: What the master sends next, None if that was the last frame.
    following: Message | None = None


def exchanges_of(commands: Iterable[Command]) -> Iterator[Exchange]:
    """What the master sends in transactions, in its order."""
    turn = 0
    for command in commands:
        if not command.steps:
            yield Exchange(command, command.request, (command.response,) if command.response else ())
            continue
        sent, answers, first = command.request, list[Message](), 0
        for step in command.steps:
            if step.sent:
                yield Exchange(command, sent, tuple(answers), first, step.message)
                turn += 1
                sent, answers, first = step.message, [], turn
            else:
                answers.append(step.message)
        yield Exchange(command, sent, tuple(answers), first)


@dataclass(frozen=True, slots=True)
class Resync:
    """How a host comes back in step with its device, which may wait for the rest of a packet."""

    #: Command without data or effect, whose answer shows that both are in step.
    command: str
    #: Byte that ends a packet which the device has begun.
    fill: int
    #: Other bytes that end the packets of some commands.
    fills: Mapping[str, int]


@dataclass(frozen=True, slots=True)
class Selection:
    """What commands of a host act on, such as an axis, until another one is selected."""

    #: Attribute of commands, and its values for those that act on the selected one.
    attribute: str
    values: tuple[int | bool | str, ...]
    #: Numbers, and the commands that select them.
    commands: Mapping[int, str]
    #: Commands after which it is unknown what is selected.
    lost_by: tuple[str, ...]

    def decides(self, command: Command) -> bool:
        """Whether a command acts on what is selected."""
        return command.attributes.get(self.attribute) in self.values


@dataclass(frozen=True, slots=True)
class Bus:
    """The line and its nodes. ``nodes`` is the (first, last) address, None if frames have no address."""

    kind: BusKind
    nodes: tuple[int, int] | None
    broadcast: int | None
    #: Usual speed of the line in bit/s, None if the document does not state it.
    baud: int | None
    bits_per_byte: int
    response_within: Allowance
    section: Text = ""
    #: Names of the sides of a link; () for others, and for a link that does not name them.
    sides: tuple[str, ...] = ()
    #: Of a host, None if the document does not state it.
    resync: Resync | None = None
    selection: Selection | None = None
