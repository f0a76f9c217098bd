"""Messages round a simulated ring of 15 nodes with faults on every hop, each one accounted for.

Run as `python -m tests.soak.ring [--messages N] [--seed S]`. Every variable and every text that is sent
names itself, so what arrives is held against what was sent: to the right node, once, and unchanged. What is
lost or changed must be explained by a fault that was injected, and a fault that a node can see must be in its
counters. A message that was dropped as a whole leaves no trace on any node; only the simulation counts it.

Faults that send a message twice are left out: the protocol has no sequence numbers, so a node cannot know.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections import Counter
from dataclasses import dataclass, field
from decimal import Decimal
from typing import Any

from qlinkgen.codecs import trio
from qlinkgen.link.codec import Message
from qlinkgen.link.ring_events import Broken, NetStat, Taken
from qlinkgen.protocols.trio import CoordinatorNode, KeypadNode
from qlinkgen.protocols.trio.client import Node, engine_of
from qlinkgen.sim import FaultPlan
from qlinkgen.sim.ring import RingWire

RING = ("coordinator", "coordinator", "keypad", "coordinator", "coordinator") * 3
#: 2 % of all transmissions over a hop.
FAULTS = "drop=0.005,flip=0.008,truncate=0.004,noise=0.003"
#: Kinds that a node can see; of a whole message that is missing it sees nothing.
VISIBLE = ("flip", "truncate", "noise")
#: Messages under way at the same time, at most.
BURST = 4
VARIABLES = 251


@dataclass
class Entry:
    """A message that names itself."""

    sent_to: int
    message: trio.Message
    delivered: int = 0


@dataclass
class Account:
    """What became of everything that was sent.

    Attributes:
        sent: messages.
        delivered: of them, those that arrived at their node unchanged.
        lost: those that did not.
        twice: deliveries of what had been delivered before.
        misdelivered: intact messages at another node: header and end byte were hit alike.
        altered: what arrived changed where no checksum is sent, or under another type.
        missed: variables that arrived changed although their checksum was right.
        wrong: variables that arrived changed although their checksum was wrong. Must be none.
        unexplained: bursts with a loss, a change or a fault at a node for which no fault was injected, or
            with a visible fault that no node has counted. Must be none.
        injected: faults by kind.
        seen: faults that nodes have counted, by kind.
        netstat: how many nodes have which status bit at the end.
    """

    sent: int = 0
    delivered: int = 0
    lost: int = 0
    twice: int = 0
    misdelivered: int = 0
    altered: int = 0
    missed: int = 0
    wrong: int = 0
    unexplained: int = 0
    injected: dict[str, int] = field(default_factory=dict)
    seen: Counter[str] = field(default_factory=Counter)
    netstat: Counter[str] = field(default_factory=Counter)

    @property
    def clean(self) -> bool:
        """Nothing happened that must not."""
        balanced = self.delivered + self.lost == self.sent
        return balanced and not (self.twice or self.wrong or self.unexplained)

    def __str__(self) -> str:
        rows = {name: value for name, value in vars(self).items() if not isinstance(value, dict)}
        text = [f"{name:14} {value:8}" for name, value in rows.items()]
        for name in ("injected", "seen", "netstat"):
            text.append(f"{name:14} " + ", ".join(f"{k} {v}" for k, v in getattr(self, name).items() if v))
        return "\n".join(text)


class Soak:
    """One run."""

    def __init__(self, seed: int, faults: str = FAULTS, baud: int | None = None) -> None:
        self.account = Account()
        self.plan = FaultPlan.parse(f"{faults},seed={seed}")
        self._random = random.Random(f"soak {seed}")
        self._nodes: list[Node] = [_node(kind, baud) for kind in RING]
        self._wire = RingWire(trio, baud=baud, faults=self.plan, chunks="random", outside=False)
        self._links = [engine_of(node) for node in self._nodes]
        for link in self._links:
            link.verbose = True
            self._wire.attach(link)
        self._wire.advance(0.0)
        self._number = 0

    def run(self, messages: int) -> Account:
        """Send so many messages, in bursts, and settle after each burst."""
        while self.account.sent < messages:
            self._burst(self._random.randint(1, min(BURST, messages - self.account.sent)))
        self.account.injected = {kind: self.plan.counts[kind] for kind in self.plan.rates}
        for link in self._links:
            self.account.netstat.update(bit.name or "" for bit in NetStat if link.netstat & bit)
        return self.account

    def _burst(self, size: int) -> None:
        account, before = self.account, {kind: self.plan.counts[kind] for kind in self.plan.rates}
        entries = [self._send() for _ in range(size)]
        while self._wire.step(float("inf")):
            pass
        changes, seen = self._collect({self._key(entry.message): entry for entry in entries})
        delivered = sum(entry.delivered > 0 for entry in entries)
        account.sent += size
        account.delivered += delivered
        account.lost += size - delivered
        injected = {kind: self.plan.counts[kind] - count for kind, count in before.items()}
        # A changed byte is seen by the receiver, unless the message is dropped before it gets there.
        visible = any(injected[kind] for kind in VISIBLE if kind != "flip" or not injected["drop"])
        odd = changes or seen or delivered < size
        if (odd and not any(injected.values())) or (visible and not changes and not seen):
            account.unexplained += 1

    def _send(self) -> Entry:
        chance = self._random
        source, address = chance.randrange(len(RING)), chance.randint(1, len(RING))
        self._number += 1
        message: trio.Message
        if chance.random() < 0.6:
            number = self._number % VARIABLES
            message = trio.DirectVariableTransfer(address=address, number=number, value=Decimal(self._number))
        else:
            text = f"<{self._number:x}>" * chance.randint(1, 3)
            message = trio.CharacterTransfer(address=address, characters=text)
        link = self._links[source]
        if not link.send(message, self._wire.now):
            raise AssertionError("the transmit buffer of a node that was idle has no room")
        self._wire.wake(link)
        return Entry((source + address) % len(RING), message)

    def _key(self, message: Message) -> tuple[Any, ...]:
        return (type(message), *(getattr(message, name) for name in message.FIELDS))

    def _collect(self, entries: dict[tuple[Any, ...], Entry]) -> tuple[int, int]:
        """Hold what has arrived against what was sent; return the changes, and the faults seen by nodes."""
        changes = seen = 0
        for place, link in enumerate(self._links):
            seen += link.counters.skipped
            link.counters.skipped = 0
            for event in link.events:
                if isinstance(event, Taken):
                    changes += self._taken(place, event, entries)
                elif isinstance(event, Broken):
                    self.account.seen[event.kind] += 1
                    seen += 1
            link.events.clear()
        return changes, seen

    def _taken(self, place: int, event: Taken, entries: dict[tuple[Any, ...], Entry]) -> bool:
        entry = entries.get(self._key(event.message))
        account = self.account
        if entry is None:
            if isinstance(event.message, trio.DirectVariableTransfer):
                right = event.frame[13:15] == sent_crc(event.frame[1:13])
                account.missed += right
                account.wrong += not right
            else:
                account.altered += 1
            return True
        if entry.sent_to != place:
            account.misdelivered += 1
            return True
        account.twice += entry.delivered > 0
        entry.delivered += 1
        return False


def _node(kind: str, baud: int | None) -> Node:
    if kind == "coordinator":
        return CoordinatorNode(baud=baud)
    keypad = KeypadNode(baud=baud)
    keypad.offset, keypad.link.passes = 1, True
    return keypad


def sent_crc(payload: bytes) -> bytes:
    """The two bytes that are sent of a CRC-16/IBM-3740, worked out bit by bit apart from the codec."""
    register = 0xFFFF
    for byte in payload:
        register ^= byte << 8
        for _ in range(8):
            register = (register << 1 ^ 0x1021 if register & 0x8000 else register << 1) & 0xFFFF
    return bytes((register & 0x7F, register >> 8 & 0x7F))


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Account for every message on a ring with faults.")
    parser.add_argument("--messages", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--faults", default=FAULTS, help=f"a fault plan (default: {FAULTS})")
    parser.add_argument("--baud", type=int, help="let bytes take their time (slow: each byte is an event)")
    return parser.parse_args()


def main() -> int:
    """Run, and print the account."""
    options = arguments()
    start = time.monotonic()
    account = Soak(options.seed, options.faults, options.baud).run(options.messages)
    print(account)
    print(f"{time.monotonic() - start:.0f} s; {'in order' if account.clean else 'NOT IN ORDER'}")
    return 0 if account.clean else 1


if __name__ == "__main__":
    sys.exit(main())
