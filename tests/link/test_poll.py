"""Polling: periods, the order of requests, what was skipped, and silent nodes."""

from __future__ import annotations

import asyncio
from collections import Counter
from contextlib import aclosing, closing
from itertools import pairwise, takewhile
from typing import Any

import pytest

from qlinkgen.codecs import qlink
from qlinkgen.errors import NoReply
from qlinkgen.link import HealthPolicy
from qlinkgen.link.poll import Key, Periods, Polled, Poller, PollStatistics
from qlinkgen.transport.aio import AsyncMaster
from qlinkgen.transport.blocking import BlockingMaster
from tests.link.line import BYTE, bus, make

POLICY = HealthPolicy(first_pause=0.4, longest_pause=1.6, share=1.0)


def polled(
    periods: dict[Key, float], *nodes: int, until: float = 1.0, baud: int = 115200, **options: Any
) -> tuple[list[Polled], dict[Key, PollStatistics], list[Any]]:
    """The outcomes up to a time on a line with some nodes."""
    _, port, stations = bus(*nodes, baud=baud)
    poller = Poller(qlink, periods, **options)
    with closing(BlockingMaster(make(baud=baud), port).iterate(poller.run())) as outcomes:
        found = list(takewhile(lambda each: each.time < until, outcomes))
    return found, poller.statistics, stations


def test_each_request_has_its_period() -> None:
    periods: dict[Key, float] = {(3, "motor_position"): 0.1, (4, "motor_position"): 0.25, (4, "read"): 0.5}
    requests: dict[Key, Any] = {(4, "read"): qlink.ReadRequest(node=4, size=2)}
    found, statistics, _ = polled(periods, 3, 4, requests=requests)
    assert Counter((each.node, each.command) for each in found) == {
        (3, "motor_position"): 10,
        (4, "motor_position"): 4,
        (4, "read"): 2,
    }
    assert [each.outcome.position for each in found if each.command == "motor_position"][:2] == [3000, 4000]
    assert found == sorted(found, key=lambda each: each.time)
    first = [each.time for each in found if each.node == 3]
    assert first[-1] - first[0] == pytest.approx(0.9)
    for key, each in statistics.items():
        assert (each.failed, each.skipped, each.held) == (0, 0, 0)
        assert each.answered == each.jitter.count == each.response.count
        assert each.jitter.most <= 3 * 40 * BYTE, key  # the others of one moment
        assert 0 < each.response.mean <= each.response.most


def test_no_more_is_asked_than_the_line_can_carry() -> None:
    """All requests go on, none at its period; what was left out is counted."""
    periods: dict[Key, float] = {(node, "motor_position"): 0.01 for node in (3, 4, 5)}
    found, statistics, stations = polled(periods, 3, 4, 5, until=10.0, baud=9600)
    counts = Counter(each.node for each in found)
    assert max(counts.values()) - min(counts.values()) <= 1
    assert sum(counts.values()) < 1000
    for (node, _), each in statistics.items():
        assert each.skipped > 0
        turns = each.answered + each.skipped
        assert turns == pytest.approx(1000, abs=6), node
        assert each.jitter.most > 0.01
        assert each.jitter.deviation > 0
    assert [len(station.heard) for station in stations] == [each.answered for each in statistics.values()]


def test_a_silent_node_is_left_alone_and_comes_back() -> None:
    periods: dict[Key, float] = {(3, "motor_position"): 0.05, (9, "motor_position"): 0.05, (9, "read"): 0.05}
    requests: dict[Key, Any] = {(9, "read"): qlink.ReadRequest(node=9, size=2)}
    wire, port, (_, late) = bus(3, 9)
    quiet = late.handle
    late.handle = lambda request, now: None if now < 2.0 else quiet(request, now)  # type: ignore[method-assign]
    poller = Poller(qlink, periods, requests=requests, policy=POLICY)
    with closing(BlockingMaster(make(), port).iterate(poller.run())) as outcomes:
        found = list(takewhile(lambda each: each.time < 4.0, outcomes))
    assert wire is port.wire
    failed = [each.time for each in found if each.error]
    assert all(isinstance(each.outcome, NoReply) and each.node == 9 for each in found if each.error)
    pauses = [later - before for before, later in pairwise(failed[1:])]
    assert [round(pause, 1) for pause in pauses] == [0.4, 0.8]
    good = sum(each.node == 3 for each in found)
    assert good == 80  # never disturbed
    back = [each.time for each in found if each.node == 9 and not each.error]
    assert back[0] - failed[-1] < 1.7
    assert Counter(each.command for each in found if each.node == 9 and not each.error)["read"] > 10
    for key in ((9, "motor_position"), (9, "read")):
        assert poller.statistics[key].held > 10
        assert poller.statistics[key].skipped <= 2


def test_the_same_on_asyncio() -> None:
    async def ask() -> list[Polled]:
        _, port, _ = bus(3)
        poller = Poller(qlink, {(3, "motor_position"): 0.1})
        found = []
        async with aclosing(AsyncMaster(make(), port).iterate(poller.run())) as outcomes:
            async for each in outcomes:
                found.append(each)
                if len(found) == 5:
                    break
        return found

    times = [each.time for each in asyncio.run(ask())]
    assert times[-1] - times[0] == pytest.approx(0.4)


@pytest.mark.parametrize(
    ("periods", "error", "text"),
    [
        ({}, ValueError, "no request was given"),
        ({(3, "motor_position"): 0.0}, ValueError, "must be above 0"),
        ({(3, "motor_position"): float("inf")}, ValueError, "must be above 0"),
        ({(3, "nonsense"): 1.0}, ValueError, "unknown command 'nonsense'"),
        ({(None, "read"): 1.0}, ValueError, "names no node, but frames of read have an address"),
        ({"read": 1.0}, ValueError, r"'read' names no node.*give \(1, 'read'\)"),
        ({(3, "read"): 1.0}, TypeError, "size"),
    ],
)
def test_refused(periods: Periods, error: type[Exception], text: str) -> None:
    with pytest.raises(error, match=text):
        Poller(qlink, periods)
