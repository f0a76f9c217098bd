"""Runs a program on a node, step by step on the node's clock.

The machine has no clock and does not wait: `run` does as many steps as it may, and `due` says when to call it
again. A program does at most `STEPS` steps in a tick of `TICK` seconds, so one that never waits neither
stops the time of a simulation nor takes a processor for itself. A step that asks for a key in vain ends the
tick. GET and WAIT UNTIL wait until the node has received something.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable

from qlinkgen.bus.ring_status import TX_TIMEOUT
from qlinkgen.codecs import trio
from qlinkgen.protocols.trio.basic.errors import BasicError, Place
from qlinkgen.protocols.trio.basic.expressions import Scope
from qlinkgen.protocols.trio.basic.parser import Program
from qlinkgen.protocols.trio.coordinator_node import CoordinatorNode

#: Most steps in a tick.
STEPS = 20
#: Seconds of a tick.
TICK = 0.001
#: Most subroutines that wait for another one to return.
CALLS = 8


class Machine:
    """A program and its state.

    Attributes:
        program: the program.
        scope: its variables, and the node.
        due: when to call `run`; infinite while it waits for the node to receive something, and at the end.
        ended: it has reached its end, a STOP, or an error.
        failure: the error, if that was the end.
    """

    def __init__(self, program: Program, node: CoordinatorNode) -> None:
        self.program = program
        self.scope = Scope(node)
        self.restart()

    def restart(self) -> None:
        """Begin again, with all variables of the program 0."""
        self.scope.names.clear()
        self.ended = False
        self.failure: BasicError | None = None
        self.due = 0.0
        self._at = 0
        self._calls: list[tuple[str, int, Place]] = []
        self._awake = -math.inf
        self._left = STEPS
        self._tick_ends = -math.inf
        self._unsent: deque[trio.Message] = deque()
        self._unsent_place = Place(self.program.file, 1, 1)
        self._given_up = math.inf

    @property
    def place(self) -> Place | None:
        """The place of the next step, or of the one that waits; None at the end."""
        steps = self.program.steps
        return None if self.ended or self._at >= len(steps) else steps[self._at].place

    def wake(self, now: float) -> None:
        """Look again at what is waited for: the node has received something."""
        if not self.ended:
            self.due = min(self.due, now)

    def run(self, now: float) -> None:
        """Do the steps that are due."""
        if self.ended:
            return
        if now >= self._tick_ends:
            self._left, self._tick_ends = STEPS, now + TICK
        try:
            self.due = self._proceed(now)
        except BasicError as error:
            self.failure = error
            self.ended, self.due = True, math.inf

    def _proceed(self, now: float) -> float:
        """Do steps, and return when to go on."""
        steps = self.program.steps
        while not self.ended:
            if now < self._awake:
                return self._awake
            if self._unsent and not self._send(now):
                return now + TICK
            if self._at >= len(steps):
                self._end()
            elif not self._left:
                return self._tick_ends
            elif not self._do(now):
                return math.inf
            elif self.scope.polled:
                return self._tick_ends
        return math.inf

    def _do(self, now: float) -> bool:
        """Do the next step; return False if it has to be done again."""
        at, self._at = self._at, self._at + 1
        self._left -= 1
        self._now = now
        self.scope.polled = False
        done = self.program.steps[at].run(self)
        if not done:
            self._at = at
        return done

    def _end(self) -> None:
        if self._calls:
            label, _, place = self._calls[-1]
            raise place.error(f"the program has ended inside the subroutine {label}; end that with RETURN")
        self.stop()

    def _send(self, now: float) -> bool:
        """Put messages into the transmit buffer; return False if it is full."""
        link = self.scope.node.link
        while self._unsent:
            with self._unsent_place.refusing():
                if link.send(self._unsent[0], now):
                    self._unsent.popleft()
                    self._given_up = now + TX_TIMEOUT
                    continue
            if now < self._given_up:
                return False
            self._unsent.clear()
            link.refuse(now)
        return True

    # what steps do

    def jump(self, to: int) -> None:
        """See `Runner`."""
        self._at = to

    def call(self, label: str, to: int, place: Place) -> None:
        """See `Runner`.

        Raises:
            BasicError: too many subroutines call one another.
        """
        if len(self._calls) == CALLS:
            raise place.error(f"GOSUB {label}: more than {CALLS} subroutines wait for their RETURN")
        self._calls.append((label, self._at, place))
        self._at = to

    def back(self, place: Place) -> None:
        """See `Runner`.

        Raises:
            BasicError: there is nothing to return to.
        """
        if not self._calls:
            raise place.error("RETURN without GOSUB; put STOP or GOTO before the subroutine")
        _, self._at, _ = self._calls.pop()

    def transmit(self, messages: Iterable[trio.Message], place: Place) -> None:
        """See `Runner`; after `TX_TIMEOUT` without room the rest is dropped, and NETSTAT tells so."""
        self._unsent.extend(messages)
        self._unsent_place = place
        self._given_up = self._now + TX_TIMEOUT

    def sleep(self, seconds: float) -> None:
        """See `Runner`."""
        self._awake = self._now + seconds

    def stop(self) -> None:
        """See `Runner`."""
        self.ended = True
