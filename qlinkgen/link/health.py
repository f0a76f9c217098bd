"""Tracks which nodes answer, so that a missing node does not delay the others.

===========  ===========================================================  =================================
state        entered when                                                 a request to the node
===========  ===========================================================  =================================
online       it answered                                                  has all attempts
suspect      a transaction failed                                         has all attempts
offline      ``offline_after`` consecutive transactions failed            fails at once until its next trial,
                                                                          which has one attempt
===========  ===========================================================  =================================

The pause between trials doubles each time, and is at least so long that trials take at most ``share`` of the
bus time.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass

ONLINE = "online"
SUSPECT = "suspect"
OFFLINE = "offline"


@dataclass(frozen=True, slots=True)
class HealthPolicy:
    """When a node is offline, and how often it is tried again.

    Attributes:
        offline_after: consecutive failed transactions after which a node is offline.
        first_pause: seconds before the first trial; each further pause is twice as long.
        longest_pause: longest pause in seconds.
        share: largest part of the bus time for the trials of one node, 0..1.
    """

    offline_after: int = 2
    first_pause: float = 0.1
    longest_pause: float = 5.0
    share: float = 0.02

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        if self.offline_after < 1:
            raise ValueError(f"offline_after must be 1 or more, not {self.offline_after}")
        if not 0 <= self.first_pause <= self.longest_pause:
            raise ValueError(
                f"first_pause {self.first_pause} and longest_pause {self.longest_pause} must be 0 s or more, "
                "in ascending order"
            )
        if not 0 < self.share <= 1:
            raise ValueError(f"share must be above 0 and at most 1, not {self.share}")

    def pause(self, trials: int, cost: float) -> float:
        """Return the seconds to wait after `trials` failed trials, of which the last took `cost` seconds."""
        grown = min(self.first_pause * 2.0 ** min(trials, 60), self.longest_pause)
        return max(grown, cost / self.share)


class NodeHealth:
    """Health of one node.

    Attributes:
        state: online, suspect or offline.
        failures: consecutive failed transactions.
        next_trial: time of the next trial of an offline node.
    """

    __slots__ = ("failures", "next_trial", "state")

    def __init__(self) -> None:
        self.state = ONLINE
        self.failures = 0
        self.next_trial = 0.0


class HealthBook(dict[int, NodeHealth]):
    """Health of each node, by address. Without a policy nothing is recorded."""

    def __init__(self, policy: HealthPolicy | None, untracked: Container[int | None] = (None,)) -> None:
        """Track all addresses except `untracked`: the broadcast address, and None."""
        super().__init__()
        self._policy = policy
        self._untracked = untracked

    def offline(self, node: int | None) -> NodeHealth | None:
        """Return the health of an offline node, None if it is not offline."""
        health = self.get(node) if node is not None else None
        return health if health is not None and health.state is OFFLINE else None

    def answered(self, node: int | None) -> bool:
        """Record an answer of a node; return whether its state has changed."""
        if self._policy is None or node is None or node in self._untracked:
            return False
        health = self.get(node)
        if health is None:
            self[node] = NodeHealth()
            return False
        changed = health.failures > 0
        health.state, health.failures = ONLINE, 0
        return changed

    def failed(self, node: int | None, now: float, cost: float) -> bool:
        """Record a failed transaction that took `cost` seconds; return whether the state has changed."""
        policy = self._policy
        if policy is None or node is None or node in self._untracked:
            return False
        health = self.setdefault(node, NodeHealth())
        before = health.state
        health.failures += 1
        if health.failures < policy.offline_after:
            health.state = SUSPECT
        else:
            health.state = OFFLINE
            health.next_trial = now + policy.pause(health.failures - policy.offline_after, cost)
        return health.state is not before
