"""A record of the answers on a bus, made by the nodes themselves.

Only the sender can tell whether a frame accepted by the master is an answer to the request. So each node
records every answer with its request.
"""

from __future__ import annotations

from collections import deque
from typing import Any

from qlinkgen.codecs import qlink
from qlinkgen.link import SlaveEngine
from qlinkgen.link.codec import Codec
from qlinkgen.protocols.qlink import VirtualNode

#: Number of requests kept: a copy of one arrives within a few of them, or never.
_SENT = 64
#: Number of answers kept, to distinguish an old one from one without a sender.
_TOLD = 4096

TRUE, STALE, FORGED = "true", "stale", "forged"


class Ledger:
    """The current request, and every answer of a node to it.

    Attributes:
        frame: the wire bytes of the request.
        strays: answers without a request.
        forged: requests that a node has decoded from damaged bytes or strays, without a sender. They pass the
            CRC by chance, one in 65536 of the badly damaged. They are not passed to the node.
    """

    def __init__(self) -> None:
        self.frame = b""
        self.forged = 0
        self.strays: deque[bytes] = deque(maxlen=_TOLD)
        self._sent: deque[bytes] = deque(maxlen=_SENT)
        self._answers: list[tuple[bytes, bytes]] = []
        self._told: deque[bytes] = deque(maxlen=_TOLD)

    def begin(self, frame: bytes) -> None:
        """The master sends this request now."""
        self._told.extend(answer for _, answer in self._answers)
        self._answers = []
        self.frame = frame
        self._sent.append(frame)

    def asked(self, frame: bytes) -> bool:
        """Whether the master has sent this recently."""
        return frame in self._sent

    def answered(self, frame: bytes, answer: bytes) -> None:
        """A node gives this answer."""
        self._answers.append((frame, answer))

    def judge(self, answer: bytes) -> str:
        """Classify the frame accepted by the master as the answer.

        TRUE: a node's answer to this request. STALE: to another request, or a stray. FORGED: it has no
            sender.
        """
        if (self.frame, answer) in self._answers:
            return TRUE
        known = answer in self._told or answer in self.strays or answer in (each for _, each in self._answers)
        return STALE if known else FORGED


class WitnessNode(VirtualNode):
    """A virtual node that records its requests and answers."""

    def __init__(self, ledger: Ledger, number: int, **settings: Any) -> None:
        super().__init__(number, record=True, **settings)
        self._ledger = ledger

    def handle(self, request: qlink.Message, now: float) -> qlink.Message | None:
        """Handle a request as a virtual node, if it has a sender."""
        frame = request.to_frame()
        if not self._ledger.asked(frame):
            self._ledger.forged += 1
            return None
        response = super().handle(request, now)
        if response is not None:
            self._ledger.answered(frame, response.to_frame())
        return response


class Station(SlaveEngine):
    """A node's place on the line, where its cable can be cut.

    Attributes:
        node: the node.
        cut: the node receives nothing.
        mute: the node receives, but its answers are lost.
        muted: number of answers lost in that way.
    """

    node: WitnessNode
    cut = False
    mute = False
    muted = 0

    def __init__(self, codec: Codec, node: WitnessNode) -> None:
        super().__init__(codec, node)

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes that are on the line."""
        if not self.cut:
            super().receive(data, now)

    def bytes_to_send(self, now: float) -> bytes:
        """Return the answer that is due."""
        answer = super().bytes_to_send(now)
        if answer and self.mute:
            self.muted += 1
            return b""
        return answer
