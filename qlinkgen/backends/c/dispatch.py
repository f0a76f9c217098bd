"""Dispatch tables: one function pointer for each command of a slave, or for each response of a master."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.c.echoes import of_reply, of_response
from qlinkgen.backends.c.framing import Address, Expected, Function, expected, payload_arguments
from qlinkgen.backends.c.names import Names, count_type, unsigned
from qlinkgen.backends.c.settled import assigned, differing
from qlinkgen.backends.c.several import Listed, listed_in
from qlinkgen.model.fields import FieldType
from qlinkgen.model.message import Message
from qlinkgen.model.naming import handler, member, snake
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.transaction import Allowance, Bus, Command, Exchange, Repeat, Unknown
from qlinkgen.model.types import Scalar
from qlinkgen.plan.payload import Member
from qlinkgen.plan.tree import MessagePlan, Plan


def callback_name(names: Names, message: Message) -> str:
    """The member for a message that a master or a listener receives."""
    stem = names.stem(message)
    return handler(stem.removesuffix("_response") if message.direction == "response" else stem, names.address)


def handler_name(names: Names, message: Message) -> str:
    """The member for a message that a slave handles."""
    command = names.command_of(message)
    return handler(snake(command.name) if command else names.stem(message), names.address)


@dataclass(frozen=True, slots=True, kw_only=True)
class SlaveEntry:
    """A request to a slave.

    Attributes:
        own: it must not be broadcast.
        unsupported: the result if the slave has no function for it.
        without: the macro that leaves it out.
        right: condition for a valid payload.
        unless_silent: term of a condition that prevents a response to a broadcast.
        replies: functions of other answers.
        initial: statements for the response, beyond its defaults, before the function is called.
        settled: statements for the values of its frame that are always the same.
        proven: the member of the response that is a check value of the request, "" without one.
        turn: its number in a dialogue, 0 if it begins a transaction; ``following`` is that of the next frame.
        listed: the nodes in it, each of which sends an answer; None if it has no list.
        begins: the flag of its answers without an end, "" if they have one; ``stops`` are those that it ends.
    """

    name: str
    constant: str
    function: str
    has_struct: bool
    answered: bool
    answer_function: str
    answer_constant: str
    answer_struct: bool
    own: bool
    broadcast_only: bool
    unsupported: str
    without: str
    right: str
    unless_silent: str
    replies: list[str]
    initial: list[str]
    settled: list[str]
    proven: str
    turn: str
    following: str
    listed: Listed | None
    begins: str
    stops: list[str]

    @property
    def absent(self) -> str:
        """The result if it is left out: a later frame of a dialogue is due only after others."""
        return "0" if self.turn else self.unsupported


class Streaming(NamedTuple):
    """The flag of answers without an end, their command, and the one that stops them."""

    name: str
    command: Command
    stop: Command


@dataclass(frozen=True, slots=True)
class ReplyEntry:
    """A function with which the function of a command answers in another way."""

    name: str
    commands: list[str]
    function: str
    has_struct: bool
    #: Statements for what it repeats of its request, and for values of its frame that are always the same.
    repeated: list[str]
    settled: list[str]

    @property
    def needs_frame(self) -> bool:
        """Whether they read the frame of the request."""
        return any("frame->" in line for line in self.repeated)


@dataclass(frozen=True, slots=True)
class SlaveGroup:
    """Requests with the same kind of recipients; ``otherwise`` is the result for all others."""

    name: str
    text: str
    entries: list[SlaveEntry]
    otherwise: str
    writes: bool


@dataclass(frozen=True, slots=True)
class Callback:
    """A message for a master or a listener; ``asked`` if only its request tells it from others."""

    name: str
    expected: Expected
    asked: bool


@dataclass(frozen=True, slots=True)
class Asked:
    """A request whose answers only it tells from others: their members in the order of trial."""

    constant: str
    answers: list[str]


@dataclass(frozen=True, slots=True)
class Carrier:
    """The message that carries these answers: its member, its macros, and the check of received frames."""

    name: str
    constant: str
    check: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Transaction:
    """Constants of a transaction."""

    constant: str
    answered: bool
    bits: int
    microseconds: int
    addressing: str
    repeat: str
    counter: str
    in_flight: int


@dataclass(frozen=True, slots=True)
class Turn:
    """A frame of a dialogue that a slave waits for."""

    constant: str
    number: int
    name: str


@dataclass(frozen=True, slots=True)
class DialogueEntry:
    """The frames of a dialogue, for a master: name and number of each, and the ids of its messages."""

    name: str
    command: str
    steps: list[tuple[str, str]]


def slave_entries(
    names: Names,
    kept: tuple[Message, ...],
    exchanges: Mapping[str, Exchange],
    *,
    address: str,
    values: Mapping[str, Member],
    reject: str,
    streams: Sequence[Streaming] = (),
) -> list[SlaveEntry]:
    """Requests to a slave, in schema order.

    ``address`` is the member with the address and ``reject`` the function that rejects, "" without one.
    ``values`` are those of frames.
    """
    present = {message.name for message in kept}
    entries = []
    for message in kept:
        if message.direction != "response":
            exchange = exchanges.get(message.name)
            command = exchange.command if exchange else None
            answer = exchange.answers[0] if exchange and exchange.answers else None
            answer = answer if answer and answer.name in present else None
            # A message without a command goes to one node.
            addressing = command.addressing if command else "node"
            others = (
                [each.message for each in command.replies if each.message.name in present] if command else []
            )
            replies = [names.function(each) for each in others] if answer else []
            entries.append(
                _entry(
                    names,
                    message,
                    answer,
                    addressing if address else "",
                    reject,
                    address=address,
                    values=values,
                    replies=replies,
                    exchange=exchange,
                    streaming=streams,
                )
            )
    return entries


def reply_entries(names: Names, plan: Plan, kept: tuple[Message, ...], address: str) -> list[ReplyEntry]:
    """The other answers of a slave, each once; ``address`` is the member with the address."""
    present = {message.name for message in kept}
    found: dict[str, tuple[Message, list[Command]]] = {}
    for command in plan.commands:
        for message in (reply.message for reply in command.replies):
            if message.name in present and command.request.name in present:
                found.setdefault(message.name, (message, []))[1].append(command)
    return [
        ReplyEntry(
            name,
            [command.name for command in those],
            names.function(message),
            bool(message.values),
            of_reply(those, message, plan.protocol.frame, address),
            assigned(message, plan.beside, "slave->parts."),
        )
        for name, (message, those) in found.items()
    ]


def _entry(
    names: Names,
    message: Message,
    answer: Message | None,
    addressing: str,
    reject: str,
    *,
    address: str,
    values: Mapping[str, Member],
    replies: list[str],
    exchange: Exchange | None,
    streaming: Sequence[Streaming],
) -> SlaveEntry:
    command = exchange.command if exchange else None
    following = exchange.following if exchange else None
    function, answer_constant = names.function(message), names.constant(answer) if answer else ""
    target = payload_arguments(message, "&request", "&frame->parts")
    decoded = f"{function}_decode({target}frame->payload, frame->size) == {names.upper}_OK"
    refuses = bool(reject and answer)
    right = [
        decoded if message.fields else "frame->size == 0U",
        *(f"!({each})" for each in differing(message, values, "frame->parts.")),
    ]
    return SlaveEntry(
        name=handler_name(names, message),
        constant=names.constant(message),
        function=function,
        has_struct=bool(message.values),
        answered=answer is not None,
        answer_function=names.function(answer) if answer else "",
        answer_constant=answer_constant,
        answer_struct=bool(answer and answer.values),
        own=addressing in {"node", "none"},
        broadcast_only=addressing == "broadcast",
        unsupported=f"{reject}({answer_constant}_MIN_SIZE, wire, capacity)" if refuses else "0",
        without=f"{names.upper}_WITHOUT_{handler_name(names, message).rstrip('_').upper()}",
        right=" && ".join(f"({each})" for each in right) if len(right) > 1 else right[0],
        unless_silent=" && !slave->broadcast" if answer and addressing == "either" else "",
        replies=replies,
        initial=_initial(command, message, answer, address) if command and answer else [],
        settled=assigned(answer, values, "slave->parts.") if answer else [],
        proven=_proven(command, answer),
        turn=turn_name(names, message) if exchange and exchange.turn else "",
        following=turn_name(names, following) if following else "",
        listed=_listed(exchange.command) if exchange and answer else None,
        begins=next((name for name, command, _ in streaming if answer and command.request is message), ""),
        stops=[name for name, _, stop in streaming if stop.request is message],
    )


def streaming(names: Names, commands: Sequence[Command], kept: Iterable[Message]) -> list[Streaming]:
    """The commands whose answers another one stops, whatever the fields of its request are."""
    present, known = {message.name for message in kept}, {command.name: command for command in commands}
    found = []
    for command in commands:
        if command.stopped is None or not {each.name for each in command.messages} & present:
            continue
        stop = known[command.stopped.command]
        fields = {value.name for value in stop.request.values}
        if stop.request.name in present and not fields.intersection(command.stopped.repeats):
            found.append(Streaming(handler_name(names, command.request), command, stop))
    return found


def _proven(command: Command | None, answer: Message | None) -> str:
    """The member of a response that is a check value of its request, "" without one."""
    if command is None or answer is None or command.proof is None:
        return ""
    return next(member(each.value) for each in command.echoes if each.of == command.proof)


def _listed(command: Command) -> Listed | None:
    """The nodes in a request of which each sends an answer of its own."""
    each = command.each
    return listed_in(command.request, each, "request.") if each and not each.by else None


def _initial(command: Command, sent: Message, answer: Message, address: str) -> list[str]:
    """Statements for what the response repeats, and for its numbers of items that ``sent`` says.

    In a dialogue, ``sent`` need not be the frame with the sizes, nor its first ``answer`` the response.
    """
    if answer is not command.response:
        return []
    fields = {field.name: field for field in answer.fields}
    numbers = {value.name: value.type for value in sent.values}
    sizes = [
        f"response.{name}_{fields[name].quantity} = "
        f"({count_type(fields[name].most)}){items_said(numbers[asked], f'request.{member(asked)}')};"
        for name, asked in (command.sizes if sent is command.sized_by else ())
        if not fields[name].fixed
    ]
    return [*sizes, *of_response(command, sent, answer, address)]


def items_said(kind: FieldType, raw: str) -> str:
    """The number of items that a raw number says."""
    scaling = kind.scaling if isinstance(kind, Scalar) else None
    if scaling is None:
        return raw
    number = f"(size_t){raw}"
    number = f"({number} * {scaling.factor}U)" if scaling.factor > 1 else number
    return f"({number} {'-' if scaling.bias < 0 else '+'} {abs(scaling.bias)}U)"


def turn_name(names: Names, message: Message) -> str:
    """The constant for the turn of a frame."""
    return f"{names.constant(message)}_TURN"


def turns(names: Names, exchanges: Iterable[Exchange], kept: Iterable[Message]) -> list[Turn]:
    """The frames of dialogues that a slave waits for."""
    present = {message.name for message in kept}
    return [
        Turn(turn_name(names, each.sent), each.turn, each.sent.name)
        for each in exchanges
        if each.turn and each.sent.name in present
    ]


def awaited(names: Names, exchanges: Iterable[Exchange], kept: Iterable[MessagePlan]) -> list[str]:
    """The constants of messages of a slave's dialogues that only their turn tells."""
    turned = {each.name for each in kept if each.turned and each.decoded}
    return [names.constant(each.sent) for each in exchanges if each.turn and each.sent.name in turned]


def dialogues(names: Names, commands: Iterable[Command]) -> list[DialogueEntry]:
    """The frames of each dialogue in their order."""
    return [
        DialogueEntry(
            f"{names.prefix}_{snake(command.name)}",
            command.name,
            [
                (message.name, f"{names.constant(message)}_ID")
                for message in (command.request, *(step.message for step in command.steps))
            ],
        )
        for command in commands
        if command.steps
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class Refusal:
    """The reply to an unknown request.

    Attributes:
        values: members and their numbers.
        parameters: those of a function that encodes it with any number, whose statements are ``lines``.
        id: its number, "" if it is constant.
        fits: condition for a number that fits the frame, "" if every one does.
    """

    function: str
    constant: str
    has_struct: bool
    values: list[tuple[str, str]]
    parameters: str
    lines: list[str]
    id: str
    fits: str


def refusal(names: Names, unknown: Unknown, plan: MessagePlan, whole: Function, number: str) -> Refusal:
    """The reply to an unknown request; ``whole`` is the function that encodes it, ``number`` a member."""
    message, fixed = plan.message, unknown.added is None
    constant, added = names.constant(message), unknown.added or 0
    bits = sum(each.bits for each in plan.envelope.id)
    kinds = {value.name: value.type for value in message.values}
    most = unsigned(max(0, (1 << bits) - 1 - added), bits)
    fits = f"frame->{number} <= {most}" if added >= 0 else f"frame->{number} >= {unsigned(-added, bits)}"
    return Refusal(
        function=names.function(message),
        constant=constant,
        has_struct=bool(message.values),
        values=[(member(name), _literal(kinds[name], raw)) for name, raw in unknown.raws],
        parameters=whole.parameters,
        lines=[line.replace(f"{constant}_ID", "id") for line in whole.lines],
        id="" if fixed else f"frame->{number} {'-' if added < 0 else '+'} {unsigned(abs(added), bits)}",
        fits="" if fixed else fits,
    )


def _literal(kind: FieldType, raw: int) -> str:
    assert isinstance(kind, Scalar)
    return unsigned(raw, kind.bits) if raw >= 0 else str(raw)


def refusing(entry: SlaveEntry, prefix: str) -> SlaveEntry:
    """A request that is refused if the slave has no function for it."""
    if not entry.answered:
        return entry
    return replace(entry, unsupported=f"{prefix}_refuse_(slave, frame, wire, capacity)")


def slave_groups(entries: list[SlaveEntry], prefix: str, *, refuses: bool) -> list[SlaveGroup]:
    """The groups of requests; the last one calls the others."""
    own = [entry for entry in entries if entry.own]
    writes = refuses or any(entry.answered for entry in own or entries)
    none = f"{prefix}_refuse_(slave, frame, wire, capacity)" if refuses else "0"
    if not own:
        return [SlaveGroup("any", "All requests.", entries, none, writes)]
    others = [entry for entry in entries if not entry.own]
    call = f"{prefix}_handle_own_(slave, frame, wire, capacity)"
    rest = "Requests that may be broadcast; the others must not be."
    return [
        SlaveGroup("own", "Requests to one node.", own, none, writes),
        SlaveGroup("any", rest, others, f"slave->broadcast ? 0 : {call}", writes=True),
    ]


def callbacks(names: Names, address: Address, kept: Sequence[MessagePlan]) -> list[Callback]:
    """Messages for a master or a listener, in schema order."""
    return [
        Callback(callback_name(names, message.message), expected(names, address, message), message.asked)
        for message in kept
        if message.direction != "request"
    ]


def asked(names: Names, plan: Plan) -> list[Asked]:
    """The requests whose answers only they tell apart."""
    return [
        Asked(
            names.constant(plan.message(request).message),
            [callback_name(names, each.message) for each in answers],
        )
        for request, answers in plan.asked.items()
    ]


def carrier(names: Names, plan: Plan) -> Carrier | None:
    """The message that carries these answers, None if there are none."""
    found = plan.carrier
    if found is None:
        return None
    message = found.message
    return Carrier(callback_name(names, message), names.constant(message), f"{names.prefix}_response_check")


def transactions(protocol: Protocol, upper: str, commands: tuple[Command, ...]) -> list[Transaction]:
    """Constants of each transaction."""
    return [
        Transaction(
            constant=f"{upper}_{snake(command.name).upper()}",
            answered=command.response is not None,
            bits=bits_of(command.response_within, protocol.bus),
            microseconds=microseconds_of(command.response_within),
            addressing=command.addressing.upper(),
            repeat=_repeat(command.repeat),
            counter=command.repeat.counter,
            in_flight=command.in_flight,
        )
        for command in commands
    ]


def _repeat(repeat: Repeat) -> str:
    if repeat.counter:
        return "BY_COUNTER"
    return "SAFE" if repeat.safe else "UNSAFE"


def bits_of(allowance: Allowance, bus: Bus) -> int:
    """The bit times of a time limit, rounded up."""
    bits = allowance.byte_times * bus.bits_per_byte
    return -(-bits.numerator // bits.denominator)


def microseconds_of(allowance: Allowance) -> int:
    """The microseconds of a time limit beside its bit times, rounded up."""
    time = allowance.seconds * 1_000_000
    return -(-time.numerator // time.denominator)
