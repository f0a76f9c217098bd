"""The engine of a slave: one node of a bus."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Literal, Protocol, cast

from qlinkgen.link.codec import (
    Codec,
    Decoder,
    Fault,
    Framed,
    Message,
    address_of,
    echoes_of,
    fill,
    is_message,
    missized,
    prove,
    wrong_size,
)
from qlinkgen.link.echo import EchoCanceller
from qlinkgen.link.events import Frame, heard
from qlinkgen.link.gaps import ABANDONED, Gap, break_of, idle_of
from qlinkgen.link.kept import kept_of
from qlinkgen.link.many import nodes_asked
from qlinkgen.link.numbering import numbering_of, repeat, repeated_of
from qlinkgen.link.slave_dialogue import PENDING, Answers, Handling, Refusal, SlaveDialogue
from qlinkgen.link.slave_streams import Flows
from qlinkgen.link.turn import has_turns
from qlinkgen.link.unknown import unknown_requests

__all__ = ["PENDING", "Node", "Refusal", "SlaveCounters", "SlaveEngine"]

#: Bytes that stuffing may insert into the answer of another node, and not into that of this one.
_INSERTED = 2
#: Most answers that are made before the first of them is sent, of which a trace names the message.
_NAMED = 256


class Node(Protocol):
    """The behaviour of a node; `SlaveHandlers` of a generated bus module has a method for each command."""

    #: Address of the node. A request may change it.
    number: int

    def handle(  # Any: a message of its own protocol
        self, request: Any, now: float
    ) -> Answers | Iterable[Message] | Handling:
        """Execute a request; return its answer, a list of several, or None to send nothing.

        For answers without an end it may return an iterator, which is asked for each when the line is free.
        A dialogue is a generator: it yields the answers to the request, gets the next frame of the
        master as the value of the `yield`, and so on. It returns the answers to the last frame.
        """
        ...


class SlaveCounters:
    """Counts of a slave.

    Attributes:
        requests: requests to this node.
        repeats: those among them that repeat the one before, and get its answer once more.
        broadcasts: requests to all nodes.
        answers: responses handed to the port.
        replaced: responses discarded because another frame arrived before they were sent.
        untimely: frames of a dialogue that were not due, or came too late.
        foreign: frames to and from other nodes.
        unknown: requests to this node with an unknown number, which it refused.
        damaged: damaged frames, by kind. The answers of other nodes are decoded as requests and often count
            here.
    """

    __slots__ = (
        "answers", "broadcasts", "damaged", "foreign", "repeats", "replaced", "requests", "unknown",
        "untimely",
    )  # fmt: skip

    def __init__(self) -> None:
        self.requests = 0
        self.repeats = 0
        self.broadcasts = 0
        self.answers = 0
        self.replaced = 0
        self.untimely = 0
        self.foreign = 0
        self.unknown = 0
        self.damaged: dict[str, int] = {}

    def __repr__(self) -> str:
        return f"SlaveCounters({', '.join(f'{name}={getattr(self, name)!r}' for name in self.__slots__)})"


class SlaveEngine:
    """Decodes the requests to a node, and encodes its answers.

    A handler returns the answer: the response, or another reply of the schema, which it may raise in a
    `Refusal` instead. What it repeats of the request is filled in. An answer that takes longer is given to
    `answer` later; until then the handler returns None, or a reply that means pending.

    Attributes:
        node: the behaviour of the node.
        counters: counts of frames.
        numbering: the counter of its frames, None without one.
        frames: each frame, oldest first, which the driver removes; None, unless somebody is told.
        break_time: seconds of the break that a driver sends before each frame, 0 for none.
        delays: seconds by class of request that its answers take longer than the turnaround; a simulation
            may set them.
    """

    delays: Mapping[type[Framed], float] = MappingProxyType({})

    def __init__(
        self,
        codec: Codec,
        node: Node,
        *,
        turnaround: float = 0.0,
        baud: int | None = None,
        echo: Literal["expect", "none"] = "none",
        host_slack: float = 0.0,
        decoder: Decoder | None = None,
    ) -> None:
        """Make the engine of one node.

        A request is complete before the byte that may be inserted after its checksum arrives; the answer
        waits for that byte, too.

        Args:
            codec: the generated module of the protocol.
            node: the behaviour of the node.
            turnaround: seconds from the request to its answer, so that the master can release the line.
            baud: speed of the line, by default that of the schema.
            echo: whether the adapter echoes sent bytes. An answer can be the same bytes as its request, so
                with an unexpected echo the node would answer itself endlessly.
            host_slack: largest delay with which bytes of one frame arrive; where a silence ends a frame, the
                node waits for it that much longer. After 0.1 s more it no longer awaits the rest of a frame.
            decoder: that of a `PeerEngine`; by default its own.
        """
        if echo not in ("expect", "none"):
            raise ValueError(
                f"echo must be 'expect' or 'none' for a slave, which sends no probe, not {echo!r}"
            )
        if not 0 <= turnaround < float("inf"):
            raise ValueError(f"turnaround must be 0 s or more and finite, not {turnaround}")
        self.node = node
        self.counters = SlaveCounters()
        self.frames: deque[Frame] | None = None
        #: The last answers by their bytes, if somebody is told of frames.
        self._made: dict[bytes, Message] = {}
        self._codec = codec
        self._encode = codec.encode
        self.numbering = numbering_of(codec)
        self._repeated = repeated_of(codec)
        self._kept = kept_of(codec)
        self._broadcast = codec.BUS.broadcast
        self._addressed = codec.BUS.first_node is not None
        self._answering = {
            command.request: command.addressing == "answered_broadcast" for command in codec.COMMANDS.values()
        }
        #: Commands that each node in a list answers, in its order.
        self._listed = {
            each.request: each
            for each in codec.COMMANDS.values()
            if each.many is not None and hasattr(each.many, "each") and not getattr(each.many, "by", None)
        }
        self._commands = {each.request: each for each in codec.COMMANDS.values()}
        self._sized = {command.sized_by: command for command in codec.COMMANDS.values() if command.sizes}
        self._dialogues = {each.request: each for each in codec.COMMANDS.values() if each.steps}
        #: Classes of the frames of masters that are only part of dialogues.
        self._parts = {
            kind for each in self._dialogues.values() for who, kind, _ in each.steps if who == "send"
        }
        self._has_turns = any(map(has_turns, self._dialogues.values()))
        self._wrong = codec.DecodeError
        self._dialogue: SlaveDialogue | None = None
        self._flows = Flows(codec, self._checked)
        self._decoder = decoder or codec.StreamDecoder("request")
        self._turnaround = turnaround
        speed = baud or codec.BUS.baud
        self._byte_time = codec.BUS.bits_per_byte / speed if speed else 0.0
        self._unknown = unknown_requests(codec, self._byte_time)
        self.break_time = break_of(codec, self._byte_time)
        idle = idle_of(codec, self._byte_time)
        self._gap = Gap(idle + host_slack if idle else 0.0, ABANDONED + host_slack)
        self._echo = EchoCanceller(echo)
        self._last = self._answer = b""
        self._further: list[bytes] = []  #: answers that follow it
        self._due = 0.0
        self._in_turn = False  #: the answer follows those of other nodes
        self._request: Framed | None = None  #: the last one for this node

    def receive(self, data: bytes, now: float) -> None:
        """Process bytes received from the line."""
        if self._echo.active:
            data = self._echo.cancel(data)
        self._last = data[-1:]
        if self._unknown is not None and data:
            self._unknown.received(data, now)
        if self._gap.ended(now):
            self._sort(self._decoder.finish(), now)
        if self._has_turns:
            for byte in data:
                self._last = bytes((byte,))
                self._take_byte(self._last, now)
        else:
            self._sort(self._decoder.feed(data), now)
        if data:
            self._gap.heard(now)

    def _take_byte(self, byte: bytes, now: float) -> None:
        """Pass a byte to the message that is due if only its turn tells that, otherwise to the decoder."""
        dialogue = self._dialogue
        if dialogue is None or not dialogue.awaits_turn(now):
            self._sort(self._decoder.feed(byte), now)
            return
        event = dialogue.collect(byte, dialogue.asked, self._wrong)
        if event is not None:
            self._sort((event,), now)
            if not is_message(event):
                self._leave()

    def _sort(self, events: Sequence[Framed | Fault], now: float) -> None:
        for event in events:
            if self.frames is not None:
                self.frames.append(heard(event, now, self._codec))
            if is_message(event):
                self._heard(event, now)
            else:
                damaged = self.counters.damaged
                damaged[event.kind] = damaged.get(event.kind, 0) + 1
                if self._unknown is not None and event.kind == "unknown":
                    self._refuse(self._unknown.answer(event.raw, self._node), now)

    @property
    def _node(self) -> int | None:
        return self.node.number if self._addressed else None

    def _refuse(self, answer: Framed | None, now: float) -> None:
        """Answer a request with an unknown number; None if there is none."""
        if answer is not None:
            self.counters.unknown += 1
            self._request = None
            self._further = []
            self._answer = self._named(answer, self._encode(answer))
            self._due = now + self._turnaround

    def _heard(self, request: Framed, now: float) -> None:
        if self._echo.active and self._echo.is_own(self._encode(request)):
            return
        address, before = address_of(request), self._before(request)
        if self._answer and self._in_turn and address not in (self._broadcast, self.node.number):
            self.counters.foreign += 1  # the answer of an earlier node
            return
        self._replace()
        if before is None or address not in (None, self._broadcast, self.node.number):
            self.counters.foreign += 1
            return
        if address is not None and address == self._broadcast:
            self.counters.broadcasts += 1
            response = self._begun(request, self._told(request, now))
            if not self._answering[type(request)]:
                return
        else:
            self.counters.requests += 1
            if self._kept is not None and (again := self._kept.again(request)):
                self._answer_again(request, again, now)
                return
            response = self._begun(request, self._asked(request, now))
        self._request = request
        self._in_turn = before > 0
        if self._flows and self._flows.next():
            self._due = max(self._due, now + self._turnaround)
        if response is not None and response is not PENDING:
            self._queue(request, response, now)
            self._due = self._ready(request, now) + self._turns(request, before)

    def _told(self, request: Framed, now: float) -> Answers:
        """Return the answers to a broadcast."""
        self._leave()
        if self._kept is not None:
            self._kept.told(request)
        return self._handled(request, now)

    def _asked(self, request: Framed, now: float) -> Answers:
        """Return the answers to a request to this node."""
        if self._kept is not None:
            self._kept.heard(request)
        return self._in_dialogue(request, now) if self._dialogues else self._handled(request, now)

    def _ready(self, request: Framed, now: float) -> float:
        """The time of an answer: after the byte that may be inserted after the request, and its delay."""
        inserted = self._encode(request)[-1:] != self._last
        ready = now + self._turnaround + (self._byte_time if inserted else 0.0)
        return ready + self.delays.get(type(request), 0.0)

    def _answer_again(self, request: Framed, frames: Sequence[bytes], now: float) -> None:
        """Answer the repeat of a request like the request itself."""
        self.counters.repeats += 1
        self._request, self._in_turn = request, False
        self._answer, *self._further = frames
        self._due = self._ready(request, now)

    def _replace(self) -> None:
        """Drop an answer that is not sent yet: the master no longer waits for it, as it sends again."""
        if self._unknown is not None:
            self._unknown.known()
        if self._answer:
            self.counters.replaced += 1
            self._answer = b""
            self._further = []

    def _begun(self, request: Framed, response: Answers) -> Answers:
        """Begin or stop answers without an end; return what is sent once."""
        return self._flows.handled(request, response) if self._flows else response

    def _before(self, request: Framed) -> int | None:
        """The number of nodes that answer before this one, None if it is not among those asked."""
        command = self._listed.get(type(request))
        if command is None:
            return 0
        assert command.many is not None
        nodes = nodes_asked(command.many, request) or ()
        return nodes.index(self.node.number) if self.node.number in nodes else None

    def _turns(self, request: Framed, before: int) -> float:
        """The time that earlier answers take; they have the size of this one if the request says it."""
        if not before:
            return 0.0
        command = self._listed[type(request)]
        assert command.response is not None
        size = len(self._answer) + _INSERTED if command.sizes else command.response.MAX_WIRE_SIZE
        return before * (size * self._byte_time + self._turnaround)

    def _in_dialogue(self, request: Framed, now: float) -> Answers:
        """Return the answers to a frame that may begin, continue or end a dialogue."""
        dialogue = self._dialogue
        if dialogue is not None and dialogue.hears(request, now):
            return dialogue.answer_to(request)
        self._leave()
        if type(request) in self._parts:
            self.counters.untimely += 1
            return None
        command = self._dialogues.get(type(request))
        if command is None:
            return self._handled(request, now)
        try:
            handling = self.node.handle(request, now)
        except Refusal as refusal:
            return refusal.reply
        if isinstance(handling, Generator):
            self._dialogue = dialogue = SlaveDialogue(command, request, handling)
            return dialogue.begin()
        self._dialogue = SlaveDialogue(command, request, None)
        return cast("Answers", handling)  # an iterator only of answers without an end

    def _leave(self) -> None:
        if self._dialogue is not None:
            self._dialogue.leave()
            self._dialogue = None

    def _await_next(self, sent: Sequence[bytes], now: float) -> None:
        """Set the time until which the next frame of a dialogue is awaited."""
        dialogue = self._dialogue
        if dialogue is None or dialogue.within is None or not dialogue.sends:
            return
        assert dialogue.due is not None
        size = sum(map(len, sent)) + dialogue.due.MAX_WIRE_SIZE
        byte_times, seconds = dialogue.within
        dialogue.until = now + self._turnaround + (size + byte_times) * self._byte_time + seconds

    def _queue(self, request: Framed, response: Message | Sequence[Message], now: float) -> None:
        """Encode one answer or several; the further ones follow the first."""
        several: Sequence[Message] = response if isinstance(response, list | tuple) else (response,)
        for each in several:
            if not hasattr(each, "NAME"):
                raise TypeError(self._no_answer(request, each))
        asked = begun = request
        if (dialogue := self._dialogue) is not None:
            asked, begun = dialogue.asked, dialogue.request
            dialogue.until = None
            dialogue.check(several)
        for each in several:
            self._check(asked, each)
            self._fill(begun, each)
        self._further = [self._encoded(request, each) for each in several]
        if self._kept is not None:
            self._kept.answered(request, self._further)
        self._await_next(self._further, now)
        self._answer = self._further.pop(0) if several else b""

    def _no_answer(self, request: Framed, given: object) -> str:
        command = self._commands.get(type(request))
        due = command.response.__name__ if command and command.response else "None"
        return (
            f"the handler of {request.NAME} returned {given!r}, not a message; return {due}, "
            "or another reply of the command"
        )

    def _checked(self, request: Framed, response: Message) -> bytes:
        """Encode one of several answers without an end."""
        self._check(request, response)
        return self._encoded(request, response)

    def _encoded(self, request: Framed, response: Message) -> bytes:
        repeat(self._repeated, request, response)
        if self.numbering is not None:
            self.numbering.answer(response)
        return self._named(response, self._encode(response))

    def _named(self, response: Message, data: bytes) -> bytes:
        """Remember which answer these bytes are, if somebody is told of frames."""
        if self.frames is not None:
            self._made[data] = response
            if len(self._made) > _NAMED:
                del self._made[next(iter(self._made))]
        return data

    def _fill(self, request: Framed, response: Message) -> None:
        """Give an answer what it repeats of the request that began its transaction."""
        command = self._commands.get(type(request))
        if command is None:
            return
        if echoes := echoes_of(command, type(response)):
            fill(echoes, request, response)
        prove(command, request, response)

    def _check(self, request: Framed, response: Message) -> None:
        """Refuse a response of another size than the request asks for, which a master would not accept."""
        command = self._sized.get(type(request))
        if command is None or type(response) is not command.response:
            return
        if name := wrong_size(command, request, response, received=False):
            raise ValueError(missized(response, name, command, request))

    def _handled(self, request: Framed, now: float) -> Answers:
        try:
            # A node returns a generator only for a dialogue.
            return cast("Answers", self.node.handle(request, now))
        except Refusal as refusal:
            return refusal.reply

    def answer(self, request: Framed, response: Message | Sequence[Message], now: float) -> bool:
        """Send the answer to a request that its handler did not answer; return False after another request.

        Answers without an end are given one by one, or several at once, until another command stops them.
        """
        several: Sequence[Message] = response if isinstance(response, list | tuple) else (response,)
        if self._flows and self._flows.add(request, several):
            self._due = max(self._due, now)
        elif request is self._request and not self._flows.is_one(request):
            self._queue(request, response, now)
            self._due = max(self._due, now)
        else:
            self.counters.replaced += 1
            return False
        return True

    def bytes_to_send(self, now: float) -> bytes:
        """Return the answer if it is due."""
        if self._gap.passed(now):
            self._sort(self._decoder.finish(), now)
        if self._unknown is not None and self._unknown.due is not None and now >= self._unknown.due:
            self._refuse(self._unknown.silent(self._node), now)
        answer = self._answer or (self._flows.next() if self._flows else b"")
        if not answer or now < self._due:
            return b""
        if self._answer:
            self._answer = self._further.pop(0) if self._further else b""
        else:
            self._flows.sent()
        pause = max(self._turnaround, self._gap.span)
        self._due = now + len(answer) * self._byte_time + self.break_time + pause
        self.counters.answers += 1
        if self.frames is not None:
            self.frames.append(Frame(now, True, answer, self._made.get(answer)))
        if self._echo.mode == "expect":
            self._echo.sent(answer)
        return answer

    def next_timer(self) -> float | None:
        """Return when an answer is due, or the line has been idle where that matters; None otherwise."""
        silence = self._gap.before(None if self._unknown is None else self._unknown.due)
        if not self._answer and not (self._flows and self._flows.next()):
            return silence
        return self._due if silence is None else min(self._due, silence)
