"""Each counter agrees with the events that it counts."""

from __future__ import annotations

import random
from collections import Counter
from typing import Any

import pytest

from qlinkgen.codecs import qlink
from qlinkgen.errors import LinkError
from qlinkgen.link import HealthPolicy, LinkCounters
from qlinkgen.link.events import (
    Answered,
    Damaged,
    EchoBroken,
    EchoFound,
    Event,
    Failed,
    HealthChanged,
    Refused,
    Sent,
    Stray,
    TimedOut,
)
from qlinkgen.link.master import MasterEngine
from qlinkgen.sim import Echo, FaultPlan
from qlinkgen.transport.blocking import BlockingMaster
from tests.link.line import Arrivals, bus, changed, drive, make, request_of, taken

ASK = qlink.MotorPositionRequest(node=3)
GOT = qlink.MotorPositionResponse(node=3).to_frame()


def recounted(events: list[Event]) -> LinkCounters:  # noqa: C901  # a table
    """The counters computed from events."""
    total = LinkCounters()
    broken = False
    for event in events:
        match event:
            case Sent():
                assert not broken
                total.requests += 1
                total.repeats += event.attempt > 1
            case Answered():
                total.answers += 1
                total.partial_echoes += broken
                broken = False
            case TimedOut():
                total.timeouts += 1
                total.collisions += broken
                broken = False
            case Failed():
                total.failures += 1
            case Refused():
                total.refused += 1
            case Stray():
                total.strays += 1
                total.late += event.late
            case Damaged():
                total.count_damaged(event.fault.kind)
            case EchoBroken(received=b""):
                total.missing_echoes += 1
            case EchoBroken():
                broken = True
            case EchoFound() | HealthChanged():
                pass
    return total


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("echo", ["none", "expect", "auto"])
def test_sums_over_a_bad_line(seed: int, echo: Any) -> None:
    plan = FaultPlan(
        seed=seed, drop=0.05, flip=0.05, truncate=0.05, delay=0.05, late=(0.05, 0.003, 0.02), duplicate=0.02,
        stray=0.05, noise=0.05, silent=0.01,
    )  # fmt: skip
    own = False if echo == "none" else Echo(partial=0.05, changed=0.0, seed=seed)
    chunks: Any = ["frame", "byte", "random"][seed % 3]
    _, port, _ = bus(3, 4, 5, faults=plan, echo=own, chunks=chunks)
    engine = make(echo=echo, slack=0.002, health=HealthPolicy(first_pause=0.01, longest_pause=0.1))
    events: list[Event] = []
    master = BlockingMaster(engine, port, on_event=events.append)
    chance = random.Random(seed)
    outcomes: Counter[str] = Counter()
    for _ in range(250):
        command = chance.choice(list(qlink.COMMANDS.values()))
        request = request_of(command, chance.choice([3, 4, 5, 9]))
        attempts = chance.choice([None, 1, 2])
        try:
            reply = master.transact(request, attempts=attempts)
            outcomes["answered" if reply.response is not None else "told"] += 1
        except LinkError:
            outcomes["failed"] += 1
            port.sleep(0.005)  # with all nodes offline, time does not advance otherwise
    assert not engine.busy
    expected = recounted(events).as_dict()
    counted = engine.total.as_dict()
    del counted["skipped"], expected["skipped"]  # bytes outside frames have no event
    assert counted == expected
    assert counted["answers"] == outcomes["answered"] > 0
    assert int(str(counted["failures"])) + int(str(counted["refused"])) == outcomes["failed"] > 0
    told = sum(isinstance(event, Sent) for event in events)
    assert told == int(str(counted["timeouts"])) + outcomes["answered"] + outcomes["told"]
    for node in (3, 4, 5, 9):
        ours = [event for event in events if getattr(event, "node", None) == node]
        mine, of_node = recounted(ours), engine.counters[node]
        for name in ("requests", "repeats", "answers", "timeouts", "failures", "refused", "damaged"):
            assert getattr(of_node, name) == getattr(mine, name), (node, name)
        for name in ("collisions", "partial_echoes", "missing_echoes"):
            assert getattr(of_node, name) == getattr(mine, name), (node, name)


def scenario(engine: MasterEngine, arrivals: Arrivals, **options: Any) -> dict[str, Any]:
    """The counters of node 3 that are not zero, after one transaction."""
    drive(engine, ASK, arrivals, **options)
    return {name: value for name, value in engine.counters[3].as_dict().items() if value}


def test_each_counter_by_hand() -> None:
    assert scenario(make(), [(0.0017, GOT)]) == {"requests": 1, "answers": 1}
    assert scenario(make(), []) == {"requests": 3, "repeats": 2, "timeouts": 3, "failures": 1}
    assert scenario(make(), [(0.0017, changed(GOT, 5))], attempts=1) == {
        "requests": 1, "timeouts": 1, "failures": 1, "damaged": {"crc": 1},
    }  # fmt: skip
    assert scenario(make(), [(0.0001, GOT)], attempts=1) == {
        "requests": 1, "timeouts": 1, "failures": 1, "strays": 1, "late": 1,
    }  # fmt: skip


def test_what_is_damaged_while_nothing_is_asked_belongs_to_no_node() -> None:
    engine = make()
    drive(engine, ASK, [(0.0017, GOT)])
    taken(engine)
    engine.receive(changed(GOT, 5), 0.5)
    assert engine.counters[None].damaged == {"crc": 1}
    assert engine.counters[3].damaged == {}
    (event,) = taken(engine)
    assert isinstance(event, Damaged)
    assert event.node is None


def test_bytes_in_no_frame() -> None:
    engine = make()
    drive(engine, ASK, [(0.0016, b"\x01\x02\x03"), (0.0017, GOT)])
    assert engine.total.skipped == 3


def test_sums() -> None:
    one, two = LinkCounters(), LinkCounters()
    one.requests, two.requests, one.late = 2, 3, 1
    one.count_damaged("crc")
    two.count_damaged("crc")
    two.count_damaged("length")
    whole = LinkCounters.total([one, two])
    assert whole.as_dict() == LinkCounters().as_dict() | {
        "requests": 5, "late": 1, "damaged": {"crc": 2, "length": 1},
    }  # fmt: skip
    assert one.damaged == {"crc": 1}
    assert repr(whole) == "LinkCounters(damaged={'crc': 2, 'length': 1}, late=1, requests=5)"
    assert set(whole.as_dict()) == set(LinkCounters.__slots__)
    assert all(f"{name}:" in (LinkCounters.__doc__ or "") for name in LinkCounters.__slots__)
