"""The expected state of a node after all calls: a simple model.

A successful call has one outcome. A failed one may have reached the node or not: both outcomes are possible
until the next successful call.
"""

from __future__ import annotations

from qlinkgen.codecs import qlink
from tests.soak.bus_ledger import WitnessNode

Settings = tuple[float, float, int]


class Mismatch(AssertionError):
    """A node, or an answer, differs from the model."""


class Held:
    """The expected state of one node.

    Attributes:
        node: the node itself, read directly.
        outputs: the possible values of its 24 outputs.
        settings: the possible settings by node_setup: T1, T2, position type.
        motor: data of the motor requests that can be the last one.
        space: words that certainly fit into its FIFO.
        certain: words of path acknowledged by the node.
        reached: lowest number of motor requests that reached the node.
        sent: highest number of them.
    """

    def __init__(self, node: WitnessNode) -> None:
        self.node = node
        self.outputs = {0}
        self.settings: set[Settings] = {(node.t1_delay, node.t2_delay, int(node.position_type))}
        self.motor: set[bytes] = {b""}
        self.space = 0
        self.certain = 0
        self.reached = 0
        self.sent = 0
        self._looked_at = 0

    # Words of path ------------------------------------------------------------------------------------------

    def words(self, sure: list[int], doubtful: list[int]) -> None:
        """The node has acknowledged the words in `sure`; it may also have queued some of `doubtful`."""
        assert self.node.record is not None
        fresh = self.node.record.words[self._looked_at :].tolist()
        if fresh[: len(sure)] != sure or fresh[len(sure) :] not in ([], doubtful):
            raise Mismatch(
                f"node {self.node.number}: has queued {fresh}; must be {sure}, and perhaps {doubtful}"
            )
        self._looked_at += len(sure)
        self.certain += len(sure)

    def words_dropped(self, doubtful: list[int]) -> None:
        """Words in doubt were dropped: the node has taken them already, or never will."""
        self.words([], doubtful)
        assert self.node.record is not None
        self._looked_at = len(self.node.record.words)

    # The rest -----------------------------------------------------------------------------------------------

    def wrote(self, value: int, mask: int, *, surely: bool) -> None:
        """Outputs under a mask were written, or perhaps."""
        written = {each & ~mask | value & mask for each in self.outputs}
        self.outputs = written if surely else self.outputs | written
        self.check()

    def wrote_perhaps(self, *outputs: int) -> None:
        """Each of these may have been written to outputs 1 to 8, by a motion in doubt."""
        self.outputs |= {each & ~0xFF | value for each in self.outputs for value in outputs}
        self.check()

    def set_up(self, settings: Settings, *, surely: bool) -> None:
        """node_setup was done, or perhaps."""
        self.settings = {settings} if surely else self.settings | {settings}
        self.check()

    def was_reset(self, *, surely: bool) -> None:
        """node_reset was done, or perhaps."""
        self.outputs = {0} if surely else self.outputs | {0}
        self.motor = {b""} if surely else self.motor | {b""}
        self.check()

    def motor_asked(self, data: bytes, *, surely: bool) -> None:
        """A motor request was taken, or perhaps."""
        self.sent += 1
        self.reached += surely
        self.motor = {data} if surely else self.motor | {data}

    def told_info(self, info: qlink.NodeInfoResponse) -> None:
        """The node has reported its settings."""
        told = (info.t1_delay, info.t2_delay, int(info.position_type))
        if told not in self.settings or info.serial_number != self.node.serial_number:
            raise Mismatch(f"node {self.node.number}: {info}, must be one of {self.settings}")
        self.settings = {told}

    def told_motor(self, answer: qlink.MotorResponsePollResponse) -> None:
        """The node has reported the completed motor request."""
        data = bytes(answer.motor_data)
        if answer.last_completion and (answer.last_completion != 0x16 or data not in self.motor):
            raise Mismatch(f"node {self.node.number}: {answer}, must be one of {self.motor}")

    def check(self) -> None:
        """Compare the node with the model."""
        node = self.node
        if node.outputs not in self.outputs:
            seen = ", ".join(f"{each:06x}" for each in sorted(self.outputs)[:8])
            raise Mismatch(f"node {node.number}: outputs {node.outputs:06x}, must be one of {seen}")
        if (node.t1_delay, node.t2_delay, int(node.position_type)) not in self.settings:
            raise Mismatch(f"node {node.number}: its settings are none of {self.settings}")
        path = node.path
        if path.queued != path.drained + path.dropped + path.waiting or path.queued != node.statistics.words:
            raise Mismatch(f"node {node.number}: its path has lost or invented words")
        if node.statistics.overruns:
            raise Mismatch(f"node {node.number}: received more words than it had room for")
        if not self.reached <= node.statistics.motor_requests:
            raise Mismatch(f"node {node.number}: has taken fewer motor requests than it has acknowledged")
