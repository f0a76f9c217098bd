"""One soak: a bus, its nodes, faults, traffic, and the account."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from qlinkgen.codecs import qlink
from qlinkgen.errors import LinkError
from qlinkgen.link import LinkCounters
from qlinkgen.link.transaction import Reply
from qlinkgen.protocols.qlink import Bus
from qlinkgen.sim import FaultPlan, VirtualPort, Wire
from qlinkgen.sim.fault_kinds import KINDS, RateLike
from qlinkgen.sim.faults import FaultCounts
from qlinkgen.sim.pty_bus import PtyBus
from qlinkgen.transport import Port, open_port
from tests.soak.bus_account import Account, Equation
from tests.soak.bus_ledger import Ledger, Station, WitnessNode
from tests.soak.bus_model import Held, Mismatch
from tests.soak.bus_traffic import ABSENT, NUMBERS, UNSUPPORTED, Traffic

#: Numbers of the nodes at the beginning.
NODES = (1, 2, 3, 4, 5)
#: Host slack in seconds: longer than the longest answer, so a late one is late for every command.
SLACK = 0.012
#: Seconds: later than any deadline except that of node_program_load, and within the silence before a repeat.
LATE = (0.018, 0.024)
#: On a pty the simulator may not run for a while; the slack has to cover that.
PTY_SLACK = 0.05
#: Late answers over a pty: seconds later than the slack.
PTY_LATE = (0.012, 0.035)
#: Chance of each kind of fault in one transmission: nine of them hit 5 % of the answers.
SHARE = 0.05 / 9
#: Share of the damaged frames that may pass the CRC; by chance it is one in 65536.
BY_CHANCE = 16 / 65536
#: Seconds after which no bytes are in transit.
SETTLES = 0.3


class SoakBus(Bus):
    """A bus that passes every transaction to the account."""

    def __init__(self, port: Port, account: Account, slack: float) -> None:
        super().__init__(port, echo="none", slack=slack, on_event=account.event)
        self._account = account
        account.watch(lambda: self.engine.total.skipped)

    def transact(self, request: Any, *, attempts: int | None = None, trial: bool = False) -> Reply:
        """As a bus."""
        account, port = self._account, self.port
        before, began, response = account.begin(request), port.now(), None
        outcome = "refused"
        try:
            reply = super().transact(request, attempts=attempts, trial=trial)
            response = reply.response
            outcome = "told" if response is None else "answered"
        except LinkError as error:
            offline = "not sent" in error.message
            outcome = type(error).__name__ if error.attempts else "refused" if offline else "unsent"
            raise
        finally:
            command = qlink.COMMANDS[request.NAME.partition(".")[0]]
            most = self.engine.timing.worst_case(command, attempts)
            now = port.now()
            account.end(before, outcome, response, (now - began) / most, now)
        return reply


@dataclass
class Result:
    """The result of a soak."""

    name: str
    seed: int
    operations: int
    failed: int
    seconds: float
    account: Account
    total: LinkCounters
    counts: FaultCounts
    collisions: int
    forged_requests: int
    words: int
    pieces: int
    repeats: int
    unwilling: int
    unheard: int
    equations: list[Equation]
    complaints: list[str]


class Soak:
    """A bus of five nodes with faults, and its user."""

    def __init__(
        self, rates: Mapping[str, RateLike], *, baud: int | None, seed: int, steady: bool = False
    ) -> None:
        """Faults occur at these rates; with `baud` None bytes take no time.

        On a `steady` bus no cable is cut, and no absent node gets a request.
        """
        self.seed = seed
        self._steady = steady
        self.ledger = Ledger()
        self.plan = FaultPlan(**rates, seed=seed, strays=self._stray, keep_log=True)  # type: ignore[arg-type]
        self.wire = Wire(baud=baud, faults=self.plan)
        self.stations = {number: self._station(number) for number in NODES}
        for station in self.stations.values():
            self.wire.attach(station)
        self.account = Account(self.plan, self.wire, self.ledger, list(self.stations.values()))
        self._counters: Callable[[int], int] = lambda _: 0

    def _station(self, number: int) -> Station:
        node = WitnessNode(
            self.ledger,
            number,
            capacity=(48, 12, 255, 20, 100)[number - 1],
            rate=(1000.0, 200.0, 8000.0, 3000.0, 500.0)[number - 1],
            started=True,
            position_type=number % 3,
            serial_number=0xA5A5_0000 + number,
            motor_seconds=0.02,
            unsupported=UNSUPPORTED if number == 3 else (),
        )
        return Station(qlink, node)

    def _stray(self, chance: random.Random) -> bytes:
        """A valid answer, but not to the request: from an absent node, or to another command.

        No slave can take it for a request. On a line without baud nothing keeps a stray from meeting the next
        question, so there a node's own strays are all motions with another counter.
        """
        if chance.random() < 0.3:
            return qlink.MotionResponse(node=chance.choice(ABSENT), counter=chance.randrange(256)).to_frame()
        asked = self.ledger.frame
        node = asked[4] if chance.random() < 0.5 and asked[4] in NUMBERS else chance.choice(NUMBERS)
        counter = self._counters(node) + 100 & 0xFF
        answers: list[qlink.Message] = [qlink.MotionResponse(node=node, counter=counter, fifo_space=255)]
        if self.wire.baud:
            answers += [
                qlink.MotorPositionResponse(node=node, position=chance.getrandbits(31)),
                qlink.MotorResponsePollResponse(node=node, last_completion=0x16, motor_data=b"stray"),
                qlink.NodeInfoResponse(node=node, serial_number=chance.getrandbits(32)),
                qlink.ReadResponse(node=node, data=bytes(chance.choice((1, 3, 26)))),
                qlink.WriteResponse(node=node),
                qlink.SetOutputsResponse(node=node),
                qlink.MotorRequestResponse(node=node),
                qlink.PresetMotorPositionResponse(node=node),
            ]
        others = [answer for answer in answers if (answer.ID, node) != (asked[3], asked[4])]
        frame = chance.choice([*answers[:1] * 3, *others]).to_frame()
        self.ledger.strays.append(frame)
        return frame

    def run(self, name: str, port: Port, slack: float, transactions: int) -> Result:
        """Use the bus until `transactions` are done, wait until it is quiet, and compare the sums."""
        bus = SoakBus(port, self.account, slack)
        self._counters = lambda number: bus.state.motions[number].counter
        held = {number: Held(station.node) for number, station in self.stations.items()}
        traffic = Traffic(bus, held, self.stations, self.seed, steady=self._steady)
        complaints: list[str] = []
        began, operations = port.now(), 0
        try:
            while self.account.asked < transactions:
                traffic.step()
                operations += 1
            self._settle(bus, traffic)
        except Mismatch as error:
            complaints.append(f"operation {operations}: {error}")
        complaints += self.account.complaints()
        forged = self.account.forged + self.ledger.forged
        if forged > BY_CHANCE * sum(bus.engine.total.damaged.values()) + 2:
            complaints.append(f"{forged} frames without a sender have passed the CRC: more than by chance")
        equations = [] if complaints else self.account.equations(bus.engine.total)
        complaints += [str(each) for each in equations if not each.holds]
        statistics = [each.node.statistics for each in held.values()]
        return Result(
            name=name,
            seed=self.seed,
            operations=operations,
            failed=traffic.failed,
            seconds=port.now() - began,
            account=self.account,
            total=bus.engine.total,
            counts=self.plan.counts,
            collisions=self.wire.collisions,
            forged_requests=self.ledger.forged,
            words=sum(each.words for each in statistics),
            pieces=sum(each.program_pieces for each in statistics),
            unwilling=sum(
                each.unsupported + each.refused_presets + each.overruns + each.refused_pieces
                for each in statistics
            ),
            unheard=self.account.unheard,
            repeats=sum(each.duplicates + each.repeated_pieces for each in statistics),
            equations=equations,
            complaints=complaints,
        )

    def _settle(self, bus: SoakBus, traffic: Traffic) -> None:
        """Without faults: check that every node answers and agrees with the model."""
        traffic.mend()
        self.wire.faults = None
        bus.port.sleep(SETTLES)
        found = [each.node for each in bus.scan(sorted(traffic.nodes) if self._steady else NUMBERS)]
        if found != sorted(traffic.nodes):
            raise Mismatch(f"nodes {found} answer, must be {sorted(traffic.nodes)}")
        traffic.finish()


def virtual(transactions: int, seed: int, rates: Mapping[str, RateLike] | None = None) -> Result:
    """Soak on the virtual clock."""
    soak = Soak(faults(LATE) if rates is None else rates, baud=115200, seed=seed)
    port = VirtualPort(soak.wire, reaction=(0.0, 0.0005), seed=seed)
    return soak.run("virtual clock", port, SLACK, transactions)


def pty(transactions: int, seed: int, slack: float = PTY_SLACK) -> Result:
    """Soak over a pty, in real time, with the simulated line in a thread."""
    rates = faults((slack + PTY_LATE[0], slack + PTY_LATE[1]))
    soak = Soak(rates, baud=None, seed=seed)
    with PtyBus(soak.wire) as line, open_port(line.path) as port:
        return soak.run("pty", port, slack, transactions)


def faults(late: tuple[float, float]) -> dict[str, RateLike]:
    """Faults of all kinds, so many that they hit 5 % of the answers.

    A copy follows at once: a node would carry out a copy of a request received after the next request.
    """
    rates: dict[str, RateLike] = dict.fromkeys(KINDS, SHARE)
    return {**rates, "late": (SHARE, *late), "silent": (SHARE, 0.02, 0.2), "duplicate": (SHARE, 0.0, 0.0)}
