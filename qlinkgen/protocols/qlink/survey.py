"""Procedures that find the nodes of a bus, and read their status."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from qlinkgen.codecs import qlink
from qlinkgen.errors import LinkError
from qlinkgen.link.codec import Framed
from qlinkgen.link.procedure import Ask, Procedure, Tell
from qlinkgen.link.survey import Present, survey
from qlinkgen.link.transaction import Reply
from qlinkgen.protocols.qlink.facts import NODES

#: Data of the loop_back to nodes that do not answer node_info.
_SIGN = b"\x5a\xc3"
#: The same requests, as values of a command line.
QUESTIONS = (("node_info", ()), ("loop_back", (f"data={_SIGN.hex()}",)))


@dataclass(frozen=True, slots=True)
class Found:
    """A node that answers.

    Attributes:
        node: its number, 1..16.
        info: its answer to node_info, None if it does not support that.
        seconds: time from request to answer, or to the end of the wait.
        garbled: bytes were received, but no answer: two nodes may have this number.
    """

    node: int
    info: qlink.NodeInfoResponse | None
    seconds: float
    garbled: bool = False


@dataclass(frozen=True, slots=True)
class NodeStatus:
    """Status of one node; None for unanswered requests.

    Attributes:
        node: its number, 1..16.
        online: it answered a request.
        position: motor position, encoder counts.
        inputs: its inputs, bit 0 is input 1.
        last_completion: command of the last completed motor request, 0 before completion.
    """

    node: int
    online: bool
    position: int | None = None
    inputs: int | None = None
    last_completion: int | None = None


def scan(nodes: Iterable[int] = NODES) -> Procedure[list[Found]]:
    """Ask each node for its identity; reports each Found immediately.

    Silent nodes are asked again after all others, and finally with loop_back, since not every node supports
    node_info.
    """
    return survey(nodes, (_who, _who, _loop), _found)


def _who(node: int) -> Framed:
    return qlink.NodeInfoRequest(node=node)


def _loop(node: int) -> Framed:
    return qlink.LoopBackRequest(node=node, data=_SIGN)


def _found(present: Present) -> Found:
    info = present.answer if isinstance(present.answer, qlink.NodeInfoResponse) else None
    return Found(present.node, info, present.seconds, present.garbled)


def status(nodes: Iterable[int] = NODES) -> Procedure[list[NodeStatus]]:
    """Ask each node for its position, inputs and last completion; reports each NodeStatus.

    A node that does not answer the first request gets no further ones.
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
