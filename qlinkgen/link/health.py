"""Which nodes are there, so that one that is not does not cost the others their time.

===========  ===========================================================  =================================
state        how a node gets there                                        what a request to it does
===========  ===========================================================  =================================
online       it answered                                                  all attempts
suspect      a transaction with it failed                                 all attempts
offline      ``offline_after`` transactions failed one after the other    fails at once until its next trial,
                                                                          which is one attempt
===========  ===========================================================  =================================

The pause between two trials grows from trial to trial, and is never so short that trials take more than
``share`` of the bus.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass

ONLINE = "online"
SUSPECT = "suspect"
OFFLINE = "offline"


@dataclass(frozen=True, slots=True)
class HealthPolicy:
    """When a node is given up, and how often it is tried again.

    Attributes:
        offline_after: failed transactions in a row that make a node offline.
        first_pause: seconds before the first trial; each further pause is twice as long ...
        longest_pause: ... up to this many seconds.
        share: most of the bus's time that the trials of one node may take, 0..1.
    """

    offline_after: int = 2
    first_pause: float = 0.1
    longest_pause: float = 5.0
    share: float = 0.02

    def __post_init__(self) -> None:
        """Refuse what would never, or always, leave a node alone."""
        if self.offline_after < 1:
            raise ValueError(f"offline_after: {self.offline_after} was given; give 1 failure or more")
        if not 0 <= self.first_pause <= self.longest_pause:
            raise ValueError(
                f"first_pause: {self.first_pause} was given with a longest_pause of {self.longest_pause}; "
                "give seconds, 0 or more, and the longest last"
            )
        if not 0 < self.share <= 1:
            raise ValueError(f"share: {self.share} was given; give a part of the bus's time, above 0 up to 1")

    def pause(self, trials: int, cost: float) -> float:
        """Seconds to wait after `trials` failed trials, of which the last took `cost` seconds."""
        grown = min(self.first_pause * 2.0 ** min(trials, 60), self.longest_pause)
        return max(grown, cost / self.share)


class NodeHealth:
    """Health of one node.

    Attributes:
        state: online, suspect or offline.
        failures: failed transactions in a row.
        next_trial: when an offline node is asked again.
    """

    __slots__ = ("failures", "next_trial", "state")

    def __init__(self) -> None:
        self.state = ONLINE
        self.failures = 0
        self.next_trial = 0.0


class HealthBook(dict[int, NodeHealth]):
    """Health of each node that was asked, by address. Without a policy nothing is noted."""

    def __init__(self, policy: HealthPolicy | None, nobody: Container[int | None] = (None,)) -> None:
        """Addresses in `nobody` are no node's: the broadcast address, and none at all."""
        super().__init__()
        self._policy = policy
        self._nobody = nobody

    def offline(self, node: int | None) -> NodeHealth | None:
        """Return the health of a node that is offline, None where it is not."""
        health = self.get(node) if node is not None else None
        return health if health is not None and health.state is OFFLINE else None

    def answered(self, node: int | None) -> bool:
        """Note that a node is there; returns whether its state has changed."""
        if self._policy is None or node is None or node in self._nobody:
            return False
        health = self.get(node)
        if health is None:
            self[node] = NodeHealth()
            return False
        changed = health.failures > 0
        health.state, health.failures = ONLINE, 0
        return changed

    def failed(self, node: int | None, now: float, cost: float) -> bool:
        """Note a failed transaction that took `cost` seconds; returns whether the state has changed."""
        policy = self._policy
        if policy is None or node is None or node in self._nobody:
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
