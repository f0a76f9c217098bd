"""Messages round a simulated ring of 15 nodes with faults on every hop; each message is accounted for.

Run as `python -m tests.soak.ring [--messages N] [--seed S]`. Every variable and text identifies itself, so
the received ones are compared with the sent ones: at the right node, once, and unchanged. Each loss or change
must be explained by an injected fault, and a fault visible to a node must be in its counters. A message
dropped as a whole is not visible to any node; only the simulation counts it.

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

from qlinkgen.bus.ring_status import engine_of
from qlinkgen.codecs import trio
from qlinkgen.link.codec import Message
from qlinkgen.link.ring_events import Broken, NetStat, Taken
from qlinkgen.protocols.trio import CoordinatorNode, KeypadNode
from qlinkgen.protocols.trio.client import Node
from qlinkgen.sim import FaultPlan
from qlinkgen.sim.ring import RingWire

RING = ("coordinator", "coordinator", "keypad", "coordinator", "coordinator") * 3
#: 2 % of all transmissions over a hop.
FAULTS = "drop=0.005,flip=0.008,truncate=0.004,noise=0.003"
#: Kinds visible to a node; the loss of a whole message is not.
VISIBLE = ("flip", "truncate", "noise")
#: Most messages in transit at the same time.
BURST = 4
VARIABLES = 251


@dataclass
class Entry:
    """A message that identifies itself."""

    sent_to: int
    message: trio.Message
    delivered: int = 0


@dataclass
class Account:
    """The results of all messages sent.

    Attributes:
        sent: messages.
        delivered: of them, those that arrived at their node unchanged.
        lost: of them, those that did not arrive.
        twice: repeated deliveries of a message.
        misdelivered: intact messages at another node: header and end byte were changed alike.
        altered: messages changed without a checksum, or received under another type.
        missed: changed variables received with a correct checksum.
        wrong: changed variables received with a wrong checksum. Must be 0.
        unexplained: bursts with a loss, a change or a fault at a node without an injected fault, or with a
            visible fault that no node has counted. Must be 0.
        injected: faults by kind.
        seen: faults that nodes have counted, by kind.
        netstat: number of nodes with each status bit at the end.
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
        """Whether the run has no errors."""
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
        """Send `messages`, in bursts, and settle after each burst."""
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
        # The receiver sees a changed byte, unless the message is dropped before.
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
            raise AssertionError("the transmit buffer of an idle node is full")
        self._wire.wake(link)
        return Entry((source + address) % len(RING), message)

    def _key(self, message: Message) -> tuple[Any, ...]:
        return (type(message), *(getattr(message, name) for name in message.FIELDS))

    def _collect(self, entries: dict[tuple[Any, ...], Entry]) -> tuple[int, int]:
        """Compare received and sent messages; return the changes, and the faults seen by nodes."""
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
    """The two bytes sent of a CRC-16/IBM-3740, computed bit by bit, independent of the codec."""
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
    parser.add_argument("--baud", type=int, help="simulate line time (slow: each byte is an event)")
    return parser.parse_args()


def main() -> int:
    """Run, and print the account."""
    options = arguments()
    start = time.monotonic()
    account = Soak(options.seed, options.faults, options.baud).run(options.messages)
    print(account)
    print(f"{time.monotonic() - start:.0f} s; {'no errors' if account.clean else 'ERRORS'}")
    return 0 if account.clean else 1


if __name__ == "__main__":
    sys.exit(main())
