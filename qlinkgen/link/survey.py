"""Finds out which nodes of a bus answer."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

from qlinkgen.errors import LinkError, Refused
from qlinkgen.link.codec import Framed, Message
from qlinkgen.link.procedure import Ask, Procedure, Tell
from qlinkgen.link.transaction import Reply

R = TypeVar("R")


@dataclass(frozen=True, slots=True)
class Present:
    """A node that answers.

    Attributes:
        node: its address.
        answer: its response or its refusal, None if what it sent was garbled: two nodes may have its address.
        seconds: time from request to answer, or to the end of the wait.
        refused: it refused the request.
    """

    node: int
    answer: Message | None
    seconds: float
    refused: bool = False

    @property
    def garbled(self) -> bool:
        """Whether bytes were received, but no answer."""
        return self.answer is None


def survey(
    nodes: Iterable[int], questions: Sequence[Callable[[int], Framed]], report: Callable[[Present], R]
) -> Procedure[list[R]]:
    """Ask each node the questions in turn, until it answers one; reports each node immediately.

    Most buses are not full, so all nodes are asked one question before the next one; the same question may be
    there twice. Nodes whose answers are garbled are asked again too. ``report`` makes the report of a node.
    """
    silent = list(nodes)
    found: list[Present] = []
    garbled: dict[int, Present] = {}
    for question in questions:
        still: list[int] = []
        for node in silent:
            present = yield from _ask_once(node, question(node))
            if present is None or present.garbled:
                still.append(node)
            if present is not None and present.garbled:
                garbled[node] = present
            elif present is not None:
                found.append(present)
                yield Tell(report(present))
        silent = still
    for node in silent:
        if node in garbled:
            found.append(garbled[node])
            yield Tell(report(garbled[node]))
    return [report(each) for each in sorted(found, key=lambda each: each.node)]


def _ask_once(node: int, request: Framed) -> Procedure[Present | None]:
    """Ask without repeats; return None for silence."""
    try:
        reply: Reply = yield Ask(request, attempts=1, trial=True)
    except Refused as error:
        answer: Message = error.reply  # type: ignore[assignment]  # a message of the generated module
        return Present(node, answer, error.elapsed, refused=True)
    except LinkError as error:
        return Present(node, None, error.elapsed) if error.received else None
    return Present(node, reply.response, reply.response_time)
