"""A Motion Coordinator that runs a program."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Unpack

from qlinkgen.codecs import trio
from qlinkgen.link.ring import RingNode
from qlinkgen.link.ring_events import NetStat
from qlinkgen.protocols.trio.basic.machine import Machine
from qlinkgen.protocols.trio.basic.parser import Program
from qlinkgen.protocols.trio.coordinator_node import CoordinatorNode
from qlinkgen.protocols.trio.options import NodeOptions


class ProgramLink(RingNode):
    """The engine of a node with a program, which it runs with its timer: any driver of a node drives both.

    Attributes:
        machine: the program.
    """

    def __init__(
        self,
        machine: Machine,
        on_message: Callable[[trio.Message, float], object],
        **options: Unpack[NodeOptions],
    ) -> None:
        """Make an engine; the options are those of `RingNode`."""
        self.machine = machine
        super().__init__(on_message=on_message, **options)

    def next_timer(self) -> float | None:
        """Return when the engine or the program is due."""
        due = super().next_timer()
        first = min(self.machine.due, math.inf if due is None else due)
        return None if first == math.inf else first

    def handle_timer(self, now: float) -> None:
        """Break a message after too long a silence, and run the program."""
        super().handle_timer(now)
        if now >= self.machine.due:
            self.machine.run(now)

    def raise_status(self, bit: NetStat, now: float) -> None:
        """Set a bit of the network status, for which the program may wait."""
        super().raise_status(bit, now)
        self.machine.wake(now)


class ProgrammedNode(CoordinatorNode):
    """A Motion Coordinator that runs a program.

    Attributes:
        machine: the program and its state.
    """

    def __init__(self, program: Program, **options: Unpack[NodeOptions]) -> None:
        """Make a node that begins its program when it is driven; the options are those of `RingNode`."""
        self.machine = Machine(program, self)
        super().__init__(**options)

    def _make_link(self, **options: Unpack[NodeOptions]) -> RingNode:
        return ProgramLink(self.machine, self._handle, **options)

    def reset(self) -> None:
        """Switch off and on: the program begins again; variables VR are kept."""
        super().reset()
        self.machine.restart()

    def _handle(self, message: trio.Message, now: float) -> None:
        super()._handle(message, now)
        self.machine.wake(now)
