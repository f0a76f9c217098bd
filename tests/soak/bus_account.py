"""The account of a soak: injected faults, their counters, and the sums that must be equal."""

from __future__ import annotations

import hashlib
from collections import Counter, deque
from collections.abc import Callable
from typing import Any, NamedTuple

from qlinkgen.codecs import qlink
from qlinkgen.link import LinkCounters, events
from qlinkgen.sim import FaultPlan, Wire
from qlinkgen.sim.faults import TO_SLAVES, Injected
from qlinkgen.sim.wire import LINE, OUTSIDE
from tests.soak.bus_ledger import FORGED, STALE, Ledger, Station

#: Seconds for which a fault can have an effect: separate noise follows within 10 ms, an extra copy within 1
#: ms, and a frame takes up to 6 ms more.
LINGERS = 0.02
#: Transactions, and seconds, after which a fault must have been counted.
_SHOWN_WITHIN = 4
_SHOWN_AFTER = 0.5
#: Requests without an answer: only the node can notice the loss of one, if at all.
_UNANSWERED = {0x03, 0x04, 0x05}
#: motor_request and node_sync, which must not be repeated.
_ONCE = {0x16, 0x05}
#: node_program_load, whose answer may take 10 ms more.
_PATIENT = 0x06


class _Open(NamedTuple):
    fault: Injected
    transaction: int
    trouble: int


class Equation(NamedTuple):
    """Two sums that must be equal.

    Attributes:
        left: name of the left sum.
        right: name of the right sum.
        values: both.
        doubt: the allowed difference.
    """

    left: str
    right: str
    values: tuple[int, int]
    doubt: int = 0

    @property
    def holds(self) -> bool:
        """Whether they are equal."""
        return abs(self.values[0] - self.values[1]) <= self.doubt

    def __str__(self) -> str:
        return f"{self.left}: {self.values[0]}; {self.right}: {self.values[1]}"


class Account:
    """Watches a bus, and keeps the sums.

    Attributes:
        transactions: calls to the bus, refused ones included.
        outcomes: how they ended.
        wrong: accepted answers that belong to another request.
        forged: accepted answers without a sender; they have passed the CRC by chance.
        slowest: longest call, as a part of its worst case.
        unexplained: timeouts without a cause.
        unseen: faults not counted, by kind.
        injected: faults that were injected, by kind.
        heard: bytes received by the master.
        decoded: bytes of them that are in frames, good and damaged.
        inserted: frames near to damage with a byte inserted after them, since their checksum ends in A5.
            After a damaged frame it belongs to no frame, and it may be missing after a good one.
        pieces: transmissions received, by source.
        unheard: faults in requests without an answer.
        told: requests sent without an answer.
    """

    def __init__(self, plan: FaultPlan, wire: Wire, ledger: Ledger, stations: list[Station]) -> None:
        self.transactions = 0
        self.outcomes: Counter[str] = Counter()
        self.wrong: list[str] = []
        self.forged = 0
        self.slowest = 0.0
        self.unexplained: list[str] = []
        self.unseen: Counter[str] = Counter()
        self.injected: Counter[str] = Counter()
        self.heard = 0
        self.told = 0
        self.decoded = 0
        self.inserted = 0
        self.unheard = 0
        self._plan = plan
        self._wire = wire
        self._ledger = ledger
        self._stations = stations
        self._recent: deque[Injected] = deque(maxlen=64)
        self._open: list[_Open] = []
        self._trouble = 0
        self._before = 0
        self._elsewhere = 0
        self._skipped: Callable[[], int] = lambda: 0
        self._digest = hashlib.sha256()
        self._timeouts: list[tuple[float, float]] = []
        self._sent_at = 0.0
        self.pieces: Counter[str] = Counter()
        wire.taps.append(self._hear)

    @property
    def digest(self) -> str:
        """Digest of all frames sent and received, with their times."""
        return self._digest.hexdigest()[:16]

    @property
    def asked(self) -> int:
        """Transactions except the refused ones."""
        return self.transactions - self.outcomes["refused"]

    @property
    def paced(self) -> bool:
        """Whether bytes take time on the virtual clock."""
        return bool(self._wire.baud)

    def _hear(self, _now: float, source: str, data: bytes) -> None:
        self.pieces[source] += 1
        if source != OUTSIDE:
            self.heard += len(data)

    # Events of the engine -----------------------------------------------------------------------------------

    def watch(self, skipped: Callable[[], int]) -> None:
        """Set the function that returns the number of bytes outside frames."""
        self._skipped = skipped

    def event(self, event: events.Event) -> None:
        """Take an event of the master's engine."""
        kind = type(event)
        line = b""
        if kind is events.Sent:
            self._sent_at = event.at
            line = event.frame  # type: ignore[union-attr]
            if event.attempt > 1 and line[3] in _ONCE:  # type: ignore[union-attr]
                self.wrong.append(f"transaction {self.transactions}: {line.hex()} was sent again")
        elif kind is events.Answered:
            line = event.response.to_frame()  # type: ignore[union-attr]
            self.decoded += len(line)
            self.inserted += (
                line.endswith(b"\xa5\0") and bool(self._recent) and event.at - self._recent[-1].at < LINGERS
            )
        elif kind is events.Stray:
            line = event.message.to_frame()  # type: ignore[union-attr]
            self.decoded += len(line)
            self._trouble += 1
            self.inserted += line.endswith(b"\xa5\0")
        elif kind is events.Damaged:
            line = event.fault.raw  # type: ignore[union-attr]
            self.decoded += len(line)
            self._trouble += 1
            self.inserted += line.endswith(b"\xa5")
        elif kind is events.TimedOut:
            self._timeouts.append((self._sent_at, event.at))
            self._trouble += 1
        self._digest.update(b"%s %r %s" % (kind.__name__.encode(), event.at, line))

    # Transactions -------------------------------------------------------------------------------------------

    def begin(self, request: qlink.Message) -> tuple[int, int, int]:
        """A call begins; returns the counts of the simulation so far."""
        self._ledger.begin(request.to_frame())
        self._before = self._trouble + self._elsewhere
        return self._simulated()

    def _simulated(self) -> tuple[int, int, int]:
        return self._wire.collisions, self._plan.counts.silenced, sum(map(_unwilling, self._stations))

    def end(self, before: tuple[int, int, int], outcome: str, response: Any, part: float, at: float) -> None:
        """A call has ended.

        Args:
            before: result of `begin`.
            outcome: name of the error, "answered", or "told".
            response: the accepted answer, or None.
            part: the duration, as a part of its worst case.
            at: time in seconds.
        """
        self.transactions += 1
        self.outcomes[outcome] += 1
        self.told += outcome == "told"
        self.slowest = max(self.slowest, part)
        if response is not None:
            self._judge(response)
        faults, self._plan.log = self._plan.log or [], []
        self._recent.extend(faults)
        self._explain(before)
        self._follow(faults, at)

    def _judge(self, response: qlink.Message) -> None:
        answer = response.to_frame()
        verdict = self._ledger.judge(answer)
        if verdict == STALE:
            self.wrong.append(f"transaction {self.transactions}: {response} is the answer to another request")
        self.forged += verdict == FORGED

    def _explain(self, before: tuple[int, int, int]) -> None:
        """Check the cause of every timeout: a fault, a collision, or a node that is absent or silent."""
        if not self._timeouts:
            return
        timeouts, self._timeouts = self._timeouts, []
        number = self._ledger.frame[4]
        there = any(each.node.number == number and not each.cut and not each.mute for each in self._stations)
        if not there or self._simulated() != before:
            return
        for sent, over in timeouts:
            if not any(
                sent - LINGERS <= fault.at <= over and fault.kind != "delay" for fault in self._recent
            ):
                self.unexplained.append(
                    f"transaction {self.transactions}: {self._ledger.frame.hex()} at {sent:.6f}"
                )

    def _follow(self, faults: list[Injected], at: float) -> None:
        """Check that every fault is counted as a timeout, stray, damaged frame or bytes outside frames."""
        if not faults and not self._open:
            return
        now = self._trouble + self._counted_elsewhere()
        for fault in faults:
            self.injected[fault.kind] += 1
            self.unheard += fault.direction == TO_SLAVES and self._ledger.frame[3] in _UNANSWERED
            if not self._harmless(fault):
                self._open.append(_Open(fault, self.asked, self._before))
        self._elsewhere = now - self._trouble
        still: list[_Open] = []
        for each in self._open:
            if now > each.trouble:
                continue
            if self.asked - each.transaction < _SHOWN_WITHIN or at - each.fault.at < _SHOWN_AFTER:
                still.append(each)
            else:
                self.unseen[each.fault.kind] += 1
        self._open = still

    def _counted_elsewhere(self) -> int:
        """Counts without an event: bytes outside frames at the master, and the counters of the nodes."""
        nodes = sum(_repeated(each) for each in self._stations)
        return nodes + self._skipped()

    def _harmless(self, fault: Injected) -> bool:
        """Whether a fault has no visible effect: the answer is in time, or the lost request has no answer."""
        code = self._ledger.frame[3]
        if fault.direction == TO_SLAVES and code in _UNANSWERED:
            return fault.kind not in {"stray", "noise"}
        return fault.kind == "delay" or (fault.kind == "late" and code == _PATIENT)

    def complaints(self) -> list[str]:
        """Errors found, a few of each kind."""
        unseen = [f"{count} {kind} were not counted" for kind, count in self.unseen.items()]
        found = [*self.wrong[:5], *unseen]
        if self.paced:  # in real time other programs may have the processor
            found += self.unexplained[:5]
            found += [f"a call took {self.slowest:.3f} of its worst case"] if self.slowest > 1 else []
        return found

    # The end ------------------------------------------------------------------------------------------------

    def equations(self, total: LinkCounters) -> list[Equation]:
        """The sums that must be equal once the line is quiet."""
        counts = self._plan.counts
        master, slaves = counts.to_master, counts.to_slaves
        refused = self.outcomes["refused"]
        sent = Equation(
            "requests sent + copies - dropped",
            "transmissions of the master on the line",
            (total.requests + slaves["duplicate"] - slaves["drop"], self.pieces[OUTSIDE]),
        )
        return [
            *([sent] if self.paced else []),  # without baud two requests may arrive as one
            Equation(
                "requests sent that require an answer",
                "answers + timeouts",
                (total.requests - self.told, total.answers + total.timeouts),
            ),
            Equation(
                "transactions",
                "first attempts + refused since the node is offline + line not quiet",
                (self.transactions, total.requests - total.repeats + refused + self.outcomes["unsent"]),
            ),
            Equation(
                "answers of the slaves + copies - dropped - silenced - cable cut",
                "transmissions of slaves on the line",
                (
                    sum(each.counters.answers for each in self._stations)
                    + master["duplicate"]
                    - master["drop"]
                    - counts.silenced
                    - sum(each.muted for each in self._stations),
                    sum(n for source, n in self.pieces.items() if source not in {OUTSIDE, LINE}),
                ),
            ),
            Equation(
                "strays + noise injected",
                "transmissions without a sender on the line",
                (counts["stray"] + counts["noise"], self.pieces[LINE]),
            ),
            Equation(
                "bytes received by the master",
                "bytes of answers, strays and damaged frames + bytes outside frames",
                (self.heard, self.decoded + total.skipped),
                self.inserted,
            ),
        ]


def _unwilling(station: Station) -> int:
    counts = station.node.statistics
    return counts.unsupported + counts.refused_presets + counts.overruns + counts.refused_pieces


def _repeated(station: Station) -> int:
    counts = station.node.statistics
    return counts.duplicates + counts.repeated_pieces + counts.repeated_syncs + counts.missed_syncs
