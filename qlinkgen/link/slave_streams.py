"""Answers without an end, as a slave sends them: as many as it likes, until another command stops them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import cast

from qlinkgen.link.codec import Codec, Framed, Message
from qlinkgen.link.many import stops
from qlinkgen.link.slave_dialogue import PENDING, Answers

#: Encodes an answer to a request.
Encode = Callable[[Framed, Message], bytes]


class _Flow:
    """The answers to one request that are still to be sent."""

    __slots__ = ("answers", "ready", "request")

    def __init__(self, request: Framed, answers: Iterator[Message]) -> None:
        self.request = request
        self.answers = answers
        self.ready = deque[bytes]()  #: encoded ones


class Flows:
    """The requests whose answers have no end, and that were not stopped yet."""

    def __init__(self, codec: Codec, encode: Encode) -> None:
        self._encode = encode
        self._stops = {command.request: stop for command, stop in stops(codec)}
        self._commands = {command.request: command for command in codec.COMMANDS.values()}
        self._open = deque[_Flow]()

    def __bool__(self) -> bool:
        """Whether a protocol has such answers."""
        return bool(self._stops)

    def is_one(self, request: Framed) -> bool:
        """Whether the answers to a request have no end."""
        return type(request) in self._stops

    def handled(self, request: Framed, response: Answers | Iterable[Message]) -> Answers:
        """Take what a handler has returned, if it begins such answers; return what is sent once.

        A handler returns the first answer, several, or an iterator of all; or `PENDING`.
        """
        if self._has_stopped(request, response):
            self._keep(lambda each: not self._stops[type(each)].by(request, each))
        if type(request) not in self._stops or response is None:
            return cast("Answers", response)
        self._keep(lambda each: each != request)  # begun once more
        if response is PENDING:
            self._open.append(_Flow(request, iter(())))
        elif isinstance(response, Iterable):
            self._open.append(_Flow(request, iter(response)))
        elif type(response) is self._commands[type(request)].response:
            self._open.append(_Flow(request, iter((response,))))
        else:
            return response
        return None

    def add(self, request: Framed, answers: Iterable[Message]) -> bool:
        """Add answers to a request; return whether it was not stopped."""
        flow = next((each for each in self._open if each.request is request), None)
        if flow is not None:
            flow.ready += [self._encode(request, each) for each in answers]
        return flow is not None

    def next(self) -> bytes:
        """Return the next answer, b"" if there is none; it is the next one until it is `sent`."""
        for _ in range(len(self._open)):
            flow = self._open[0]
            if not flow.ready and (answer := next(flow.answers, None)) is not None:
                flow.ready.append(self._encode(flow.request, answer))
            if flow.ready:
                return flow.ready[0]
            self._open.rotate(-1)
        return b""

    def sent(self) -> None:
        """Pass on to the next answer; requests take turns."""
        self._open[0].ready.popleft()
        self._open.rotate(-1)

    def _has_stopped(self, request: Framed, response: object) -> bool:
        """Whether a request was carried out that may stop answers."""
        command = self._commands.get(type(request))
        if command is None or command.response is None:
            return True
        return response is not None and (response is PENDING or type(response) is command.response)

    def _keep(self, kept: Callable[[Framed], bool]) -> None:
        self._open = deque(flow for flow in self._open if kept(flow.request))
