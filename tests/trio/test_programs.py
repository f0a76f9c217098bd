"""Several blocking programs on one virtual clock."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from qlinkgen.protocols.trio import NothingCame
from qlinkgen.sim import SimulationError
from qlinkgen.sim.virtual_ring import VirtualRing


@pytest.fixture(autouse=True)
def no_thread_is_left() -> Iterator[None]:
    before = threading.active_count()
    yield
    assert threading.active_count() == before


def test_programs_talk_to_one_another() -> None:
    ring = VirtualRing("coordinator,coordinator,coordinator", baud=1000)
    nodes = [ring.coordinator(place) for place in range(3)]

    def asks() -> list[int]:
        answers = []
        for letter in "abc":
            nodes[0].print_(10, letter, end="")
            answers.append(nodes[0].get(4))
        return answers

    def answers() -> float:
        for _ in range(3):
            letter = nodes[1].get(4)
            nodes[1].sleep(0.5)
            nodes[1].print_(11, chr(letter - 32), end="")
        return nodes[1].now()

    got, ended = ring.run(asks, answers)
    assert got == list(b"ABC")
    # Each turn: 3 bytes there, half a second, 3 bytes back by way of one node, at 10 ms a byte.
    assert ended == pytest.approx(3 * (0.03 + 0.5) + 2 * 0.04)


def test_it_is_the_same_every_time() -> None:
    def run() -> list[tuple[str, float]]:
        ring = VirtualRing("coordinator,coordinator", baud=9600)
        log: list[tuple[str, float]] = []

        def player(place: int) -> None:
            mc = ring.coordinator(place)
            for turn in range(20):
                mc.print_(10, f"{place}{turn}", end="")
                while mc.key(4):
                    log.append((chr(mc.get(4)), mc.now()))
                mc.sleep(0.003 * (place + 1))

        ring.run(lambda: player(0), lambda: player(1))
        return log

    first = run()
    assert len(first) > 40
    assert first == run()


def test_a_loop_that_only_asks_for_keys_lets_time_pass() -> None:
    ring = VirtualRing("coordinator,coordinator", baud=9600)

    def waits() -> int:
        mc, turns = ring.coordinator(1), 0
        while not mc.key(4):
            turns += 1
        return turns

    def sends() -> None:
        mc = ring.coordinator(0)
        mc.sleep(0.1)
        mc.print_(10, "x", end="")

    turns, _ = ring.run(waits, sends)
    assert turns is not None
    assert 50 < turns < 500


def test_waiting_for_what_never_happens_is_an_error() -> None:
    ring = VirtualRing("coordinator,coordinator")
    with pytest.raises(SimulationError, match="deadlock: all programs wait, and no events are left"):
        ring.run(lambda: ring.coordinator(0).get(4), lambda: ring.coordinator(1).get(4))
    with pytest.raises(SimulationError, match="all programs wait"):
        ring.coordinator(0).get(4)


def test_what_a_program_does_last_is_seen_by_those_that_wait() -> None:
    ring = VirtualRing("coordinator,coordinator")
    flag: list[bool] = []
    mc = ring.coordinator(0)
    ring.run(lambda: mc.wait_until(lambda: flag), lambda: flag.append(True))
    ring.run(lambda: mc.wait_until(lambda: mc.vr[1] == 2), lambda: ring.coordinator(1).send(10, 1, 1, 2))


def test_waiting_with_a_timeout_is_none() -> None:
    ring = VirtualRing("coordinator,coordinator")

    def gives_up(place: int, seconds: float) -> float:
        mc = ring.coordinator(place)
        with pytest.raises(NothingCame):
            mc.get(4, seconds)
        return mc.now()

    assert ring.run(lambda: gives_up(0, 3.0), lambda: gives_up(1, 2.0)) == [3.0, 2.0]


def test_a_program_that_fails_stops_the_others() -> None:
    ring = VirtualRing("coordinator,coordinator")
    log: list[str] = []

    def fails() -> None:
        ring.coordinator(0).sleep(1.0)
        raise RuntimeError("the first program has failed")

    def waits() -> None:
        try:
            ring.coordinator(1).sleep(100.0)
        finally:
            log.append("cleaned up")

    with pytest.raises(RuntimeError, match="the first program has failed"):
        ring.run(fails, waits)
    assert log == ["cleaned up"]
    assert ring.run(lambda: ring.now) == [1.0], "the ring can be used again"


def test_programs_are_started_all_at_once() -> None:
    ring = VirtualRing("coordinator")
    with pytest.raises(SimulationError, match="already running"):
        ring.run(lambda: ring.run(lambda: None))


def test_a_virtual_ring_for_asyncio() -> None:
    import asyncio

    async def main() -> tuple[list[int], float]:
        ring = VirtualRing("coordinator,keypad,coordinator", baud=1000)
        first, keypad, last = ring.async_coordinator(0), ring.async_keypad(1), ring.async_coordinator(2)

        async def presses() -> None:
            await keypad.wait_until(lambda: keypad.node.offset)
            await keypad.sleep(0.25)
            keypad.press("7")

        task = asyncio.create_task(presses())
        await first.send(10, 2, 10)
        got = [await last.get(4)]
        await task
        with pytest.raises(SimulationError, match="no events are left"):
            await last.get(4)
        return got, last.now()

    got, now = asyncio.run(main())
    assert got == [ord("7")]
    assert now == pytest.approx(0.03 + 0.25 + 0.03)
