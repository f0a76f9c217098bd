"""What really happened on a bus, noted where it happened: by the nodes themselves.

The master sees frames; whether the frame that it took for an answer is one can only be said by who sent it.
So each node writes down every answer that it gives, with the request that it gave it to.
"""

from __future__ import annotations

from collections import deque
from typing import Any

from qlinkgen.codecs import qlink
from qlinkgen.link import SlaveEngine
from qlinkgen.link.codec import Codec
from qlinkgen.protocols.qlink import VirtualNode

#: Requests that are remembered: a copy of one arrives within a few of them, or never.
_SENT = 64
#: Answers that are remembered, to tell an old one from one that nobody gave.
_TOLD = 4096

TRUE, STALE, FORGED = "true", "stale", "forged"


class Ledger:
    """The question under way, and every answer that a node has given to it.

    Attributes:
        frame: the question, as it is on the wire.
        strays: answers that came unasked.
        forged: requests that a node has read out of damaged bytes or strays, and that nobody has sent. They
            pass the CRC by chance, one in 65536 of the badly damaged. The node does not get them.
    """

    def __init__(self) -> None:
        self.frame = b""
        self.forged = 0
        self.strays: deque[bytes] = deque(maxlen=_TOLD)
        self._sent: deque[bytes] = deque(maxlen=_SENT)
        self._answers: list[tuple[bytes, bytes]] = []
        self._told: deque[bytes] = deque(maxlen=_TOLD)

    def begin(self, frame: bytes) -> None:
        """The master asks this now."""
        self._told.extend(answer for _, answer in self._answers)
        self._answers = []
        self.frame = frame
        self._sent.append(frame)

    def asked(self, frame: bytes) -> bool:
        """Whether the master has sent this lately."""
        return frame in self._sent

    def answered(self, frame: bytes, answer: bytes) -> None:
        """A node gives this answer."""
        self._answers.append((frame, answer))

    def judge(self, answer: bytes) -> str:
        """Say what the frame is that the master takes for the answer.

        TRUE: a node gave it to this question. STALE: to another, or it is a stray. FORGED: nobody sent it.
        """
        if (self.frame, answer) in self._answers:
            return TRUE
        known = answer in self._told or answer in self.strays or answer in (each for _, each in self._answers)
        return STALE if known else FORGED


class WitnessNode(VirtualNode):
    """A virtual node that notes what it was asked and what it said."""

    def __init__(self, ledger: Ledger, number: int, **settings: Any) -> None:
        super().__init__(number, record=True, **settings)
        self._ledger = ledger

    def handle(self, request: qlink.Message, now: float) -> qlink.Message | None:
        """As a virtual node, for requests that somebody has sent."""
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
        node: who is there.
        cut: the node hears nothing.
        mute: the node hears, but nobody hears it.
        muted: answers that nobody has heard for that reason.
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
