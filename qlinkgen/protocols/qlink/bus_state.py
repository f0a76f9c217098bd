"""State of a master between calls, and the procedures that use it.

Common part of the blocking and the asyncio client.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from os import PathLike
from typing import get_args

from qlinkgen.codecs import qlink
from qlinkgen.errors import CommandError
from qlinkgen.link.codec import Message
from qlinkgen.link.procedure import Procedure
from qlinkgen.link.transaction import Question
from qlinkgen.protocols.hexfile import read_hex
from qlinkgen.protocols.qlink import loading, motion, pacing
from qlinkgen.protocols.qlink.arguments import known, positive, whole
from qlinkgen.protocols.qlink.facts import BROADCAST, SYNCS

#: Requests after which a motor may have stopped, so that its last status is outdated.
_STOPPING = (qlink.NodeStopRequest, qlink.ClearFifoRequest, qlink.NodeResetRequest)
#: Syncs of one run: more than a bus can send in its life.
MOST_SYNCS = 1 << 62


class BusState:
    """Counters of motions and syncs.

    Attributes:
        motions: state of the motions, by node.
        syncs: number of the next sync.
        statuses: last motor status of each node, unless outdated by a later request.
    """

    def __init__(self, repeats: motion.Repeats = "answered") -> None:
        """Make the state of a master that has just started.

        Raises:
            ValueError: `repeats` is another word.
        """
        known("repeats", repeats, get_args(motion.Repeats))
        self.statuses: dict[int, int] = {}
        self.motions = defaultdict[int, motion.MotionState](partial(motion.MotionState, repeats=repeats))
        self.syncs = pacing.SyncState()

    def next_sync(self, counter: int | None) -> int:
        """Return the number of the sync to send."""
        number = self.syncs.counter if counter is None else whole("counter", counter, 0, SYNCS.most)
        self.syncs.counter = SYNCS.after(number)
        return number

    def check(self, request: Question) -> None:
        """Refuse a request that the node would refuse according to its last status.

        Raises:
            CommandError: the motor runs, and the position cannot be preset.
        """
        if type(request) is not qlink.PresetMotorPositionRequest:
            return
        node: int = request.node
        status = self.statuses.get(node, 0)
        if status & qlink.MotorStatus.RUNNING:
            raise CommandError(
                f"node {node}: the position cannot be preset while the motor runs (section 7.13), as in the "
                "last status of the node; nothing was sent. Stop the node, or refresh the status with "
                f"motion({node})",
                node=node,
                status=status,
            )

    def note(self, request: Question, response: Message | None) -> None:
        """Update the state after a request that may have been sent, and its response if any."""
        if isinstance(request, qlink.MotionRequest):
            if isinstance(response, qlink.MotionResponse):
                self.statuses[response.node] = response.motor_status
        elif isinstance(request, _STOPPING):
            if request.node == BROADCAST:
                self.statuses.clear()
            else:
                self.statuses.pop(request.node, None)
        elif isinstance(request, qlink.NodeSetupRequest):
            self._set_up(request)

    def _set_up(self, request: qlink.NodeSetupRequest) -> None:
        """Discard the state of the old and the new number of a node that may have been renumbered."""
        if request.node == BROADCAST:
            self.statuses.clear()
        for number in {request.node, request.node_number}:
            self.statuses.pop(number, None)
            if request.node != request.node_number:
                self.motions[number].unknown()

    def stream(
        self,
        words: Mapping[int, Iterable[int]],
        outputs: int | Mapping[int, int],
        patience: float,
        full_pause: float,
    ) -> Procedure[dict[int, int]]:
        """Stream words to nodes."""
        positive("patience", patience, "seconds")
        positive("full_pause", full_pause, "seconds")
        each = outputs if isinstance(outputs, Mapping) else dict.fromkeys(words, outputs)
        return motion.stream(self.motions, words, each, patience=patience, full_pause=full_pause)

    def sync(
        self, interval: float, count: int | None, stop: Callable[[], bool] | None
    ) -> Procedure[pacing.SyncReport]:
        """Send syncs at an interval."""
        if not positive("interval", interval, "seconds"):
            raise ValueError(f"interval={interval!r} must be more than 0 seconds")
        if count is not None:
            whole("count", count, 0, MOST_SYNCS)
        return pacing.sync(self.syncs, interval, count=count, stop=stop or (lambda: False))

    @staticmethod
    def complete(
        node: int, motor_data: bytes, poll_interval: float, timeout: float
    ) -> Procedure[qlink.MotorResponsePollResponse]:
        """Send a motor request and wait for its result."""
        positive("poll_interval", poll_interval, "seconds")
        positive("timeout", timeout, "seconds")
        request = qlink.MotorRequestRequest(node=node, motor_data=motor_data)
        return pacing.complete(request, poll_interval=poll_interval, timeout=timeout)

    @staticmethod
    def load(
        node: int, program: str | PathLike[str] | bytes, piece: int, patience: float
    ) -> Procedure[loading.LoadReport]:
        """Load a file, or a checked text."""
        positive("patience", patience, "seconds")
        text = program if isinstance(program, bytes) else read_hex(program).text
        return loading.load(node, text, piece=piece, patience=patience)
