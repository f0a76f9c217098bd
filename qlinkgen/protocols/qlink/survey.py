"""Finding out who is on a bus, and how they are."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from qlinkgen.codecs import qlink
from qlinkgen.errors import LinkError
from qlinkgen.link.procedure import Ask, Procedure, Tell
from qlinkgen.link.transaction import Reply
from qlinkgen.protocols.qlink.facts import NODES

#: What a node has to send back that does not answer node_info.
_SIGN = b"\x5a\xc3"


@dataclass(frozen=True, slots=True)
class Found:
    """A node that answers.

    Attributes:
        node: its number, 1..16.
        info: who it is, None where it does not support that question.
        seconds: time from the question to the answer.
    """

    node: int
    info: qlink.NodeInfoResponse | None
    seconds: float


@dataclass(frozen=True, slots=True)
class NodeStatus:
    """What one node says of itself; None for what it does not answer.

    Attributes:
        node: its number, 1..16.
        online: it answered something.
        position: motor position, encoder counts.
        inputs: its inputs, bit 0 is input 1.
        last_completion: command of the last completed motor request, 0 while it is not completed.
    """

    node: int
    online: bool
    position: int | None = None
    inputs: int | None = None
    last_completion: int | None = None


def scan(nodes: Iterable[int] = NODES) -> Procedure[list[Found]]:
    """Ask each node who it is; tells each Found as soon as it is found.

    A bus is mostly not full, so nobody is asked three times at once: those who are silent are asked again
    after all others, and at last for an echo, since not every node supports node_info.
    """
    silent = list(nodes)
    found: list[Found] = []
    questions = (_who, _who, _loop)
    for question in questions:
        still: list[int] = []
        for node in silent:
            answer = yield from question(node)
            if answer is None:
                still.append(node)
            else:
                found.append(answer)
                yield Tell(answer)
        silent = still
    return sorted(found, key=lambda each: each.node)


def _who(node: int) -> Procedure[Found | None]:
    reply = yield from _ask_once(qlink.NodeInfoRequest(node=node))
    return None if reply is None else Found(node, reply.response, reply.response_time)


def _loop(node: int) -> Procedure[Found | None]:
    reply = yield from _ask_once(qlink.LoopBackRequest(node=node, data=_SIGN))
    return None if reply is None else Found(node, None, reply.response_time)


def _ask_once(request: qlink.Message) -> Procedure[Reply | None]:
    try:
        reply: Reply = yield Ask(request, attempts=1, trial=True)
    except LinkError:
        return None
    return reply


def status(nodes: Iterable[int] = NODES) -> Procedure[list[NodeStatus]]:
    """Ask each node for its position, inputs and last completion; tells each NodeStatus.

    A node that answers the first question with silence is not asked the others.
    """
    every: list[NodeStatus] = []
    for node in nodes:
        one = yield from _status_of(node)
        every.append(one)
        yield Tell(one)
    return every


def _status_of(node: int) -> Procedure[NodeStatus]:
    inputs = yield from _answer(qlink.ReadRequest(node=node, size=3))
    position = yield from _answer(qlink.MotorPositionRequest(node=node))
    if inputs is None and position is None:
        return NodeStatus(node, online=False)
    poll = yield from _answer(qlink.MotorResponsePollRequest(node=node))
    return NodeStatus(
        node,
        online=True,
        position=None if position is None else position.response.position,
        inputs=None if inputs is None else int.from_bytes(inputs.response.data, "little"),
        last_completion=None if poll is None else poll.response.last_completion,
    )


def _answer(request: qlink.Message) -> Procedure[Reply | None]:
    try:
        reply: Reply = yield Ask(request)
    except LinkError:
        return None
    return reply
