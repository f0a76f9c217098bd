"""Each kind of fault has its effect, and the counts agree with a listener on the line."""

from __future__ import annotations

import random
from collections import Counter
from itertools import pairwise

import pytest

from qlinkgen.sim import LINE, OUTSIDE, FaultPlan, VirtualPort, Wire
from qlinkgen.sim.fault_kinds import KINDS
from qlinkgen.sim.fault_record import Disturbed
from tests.sim.lines import ANSWER, REQUEST, Answerer, Run, Talker, ask, listen, sources

BAUD = 115200
BYTE = 10 / BAUD


def bits_changed(one: bytes, other: bytes) -> int:
    assert len(one) == len(other)
    return (int.from_bytes(one, "big") ^ int.from_bytes(other, "big")).bit_count()


@pytest.mark.parametrize("baud", [None, BAUD])
def test_without_a_chance_nothing_happens(baud: int | None) -> None:
    run = Run(FaultPlan(seed=1), 100, baud=baud)
    assert run.outside == ANSWER * 100
    assert run.on_line(OUTSIDE) == [REQUEST] * 100
    assert run.plan.counts.total == 0
    assert not run.on_line(LINE)


@pytest.mark.parametrize("baud", [None, BAUD])
def test_drop(baud: int | None) -> None:
    run = Run(FaultPlan(drop=0.2, seed=1), baud=baud)
    counts = run.plan.counts
    assert run.on_line(OUTSIDE) == [REQUEST] * (1000 - counts.to_slaves["drop"])
    assert run.station.requests == 1000 - counts.to_slaves["drop"]
    answers = run.station.requests - counts.to_master["drop"]
    assert run.on_line("node") == [ANSWER] * answers
    assert run.outside == ANSWER * answers
    assert 150 < counts.to_slaves["drop"] < 250
    assert 110 < counts.to_master["drop"] < 210
    assert counts["drop"] == counts.total


def test_flip() -> None:
    run = Run(FaultPlan(flip=0.3, seed=1))
    counts = run.plan.counts
    asked = [bits_changed(data, REQUEST) for data in run.on_line(OUTSIDE)]
    answered = [bits_changed(data, ANSWER) for data in run.on_line("node")]
    assert len(asked) == 1000
    assert 1000 - asked.count(0) == counts.to_slaves["flip"]
    assert len(answered) - answered.count(0) == counts.to_master["flip"]
    assert set(asked) == set(answered) == {0, 1, 2, 3}
    assert run.station.everything == b"".join(run.on_line(OUTSIDE))
    assert run.outside == b"".join(run.on_line("node"))


def test_flip_as_many_as_asked_for() -> None:
    run = Run(FaultPlan(flip=(1.0, 7, 9), to="master", seed=1), 300)
    assert {bits_changed(data, ANSWER) for data in run.on_line("node")} == {7, 8, 9}


def test_truncate() -> None:
    run = Run(FaultPlan(truncate=0.4, seed=1))
    short = [data for data in run.on_line(OUTSIDE) if data != REQUEST]
    heads_lost = [data for data in short if REQUEST.endswith(data)]
    tails_lost = [data for data in short if REQUEST.startswith(data)]
    assert len(heads_lost) + len(tails_lost) == len(short) == run.plan.counts.to_slaves["truncate"]
    assert len(tails_lost) > len(heads_lost) > 50
    assert {len(data) for data in short} == set(range(1, len(REQUEST)))
    answers = [data for data in run.on_line("node") if data != ANSWER]
    assert len(answers) == run.plan.counts.to_master["truncate"]


def test_what_is_left_of_it_keeps_its_time() -> None:
    run = Run(FaultPlan(truncate=1.0, to="slaves", seed=1), 200, baud=BAUD)
    for second, (at, _, data) in enumerate(row for row in run.tap if row[1] == OUTSIDE):
        end = len(REQUEST) if REQUEST.endswith(data) else len(data)
        assert at - second * 0.02 == pytest.approx(end * BYTE, abs=1e-9)


def test_a_sender_is_as_long_busy_with_what_is_lost() -> None:
    for kind in ("drop", "truncate"):
        plan = FaultPlan.parse(f"{kind}=0.5,to=slaves,seed=1")
        wire = Wire(baud=BAUD, faults=plan)
        tap = listen(wire)
        for _ in range(40):
            wire.transmit(b"abcdefgh", 0.0)
        wire.advance(1.0)
        whole = [at / (8 * BYTE) for at, _, data in tap if data == b"abcdefgh"]
        assert 10 < len(whole) < 30
        assert whole == [pytest.approx(round(turn)) for turn in whole]
        assert round(whole[-1]) > len(whole)


class Scripted(FaultPlan):
    """Applies a scripted disturbance to each transmission."""

    def __init__(self, *script: Disturbed | None) -> None:
        super().__init__()
        self.script = list(script)

    def disturb(self, data: bytes, now: float, source: str, *, to_master: bool) -> Disturbed | None:
        return self.script.pop(0) if self.script else None


def ends(*script: Disturbed | None) -> list[tuple[bytes, float]]:
    """The traffic when "first" and "second" are sent simultaneously: ends in byte times."""
    wire = Wire(baud=BAUD, faults=Scripted(*script))
    tap = listen(wire)
    wire.transmit(b"first", 0.0)
    wire.transmit(b"second", 0.0)
    wire.advance(1.0)
    assert wire.collisions == 0
    return [(data, round(at / BYTE, 6)) for at, _, data in tap]


def test_what_comes_before_waits_for_what_is_being_sent() -> None:
    script = Disturbed(b"second", before=[b"one", b"three"])
    assert ends(None, script) == [(b"first", 5), (b"one", 8), (b"three", 13), (b"second", 19)]


def test_what_waits_holds_back_what_follows() -> None:
    script = Disturbed(b"first", wait=10 * BYTE, lead=1, tail=2)
    assert ends(script) == [(b"first", 16), (b"second", 24)]
    assert ends(Disturbed(b"", lead=5)) == [(b"second", 11)]


def test_what_follows_has_its_gap() -> None:
    script = Disturbed(b"second", tail=1, after=[(2 * BYTE, b"after")], again=20 * BYTE)
    assert ends(None, script) == [(b"first", 5), (b"second", 11), (b"after", 19), (b"second", 38)]


def test_a_repeat_waits_for_its_turn() -> None:
    script = Disturbed(b"first", again=2 * BYTE)
    assert ends(script) == [(b"first", 5), (b"second", 11), (b"first", 16)]


def test_a_single_byte_is_not_truncated() -> None:
    plan = FaultPlan(truncate=1.0)
    wire = Wire(baud=None, faults=plan)
    tap = listen(wire)
    wire.transmit(b"x", 0.0)
    wire.advance(1.0)
    assert sources(tap, OUTSIDE) == [b"x"]
    assert plan.counts.total == 0


@pytest.mark.parametrize("baud", [None, BAUD])
def test_delay(baud: int | None) -> None:
    run = Run(FaultPlan(delay=(0.3, 0.001, 0.002), seed=1), baud=baud)
    byte = BYTE if baud else 0.0
    fair = (len(REQUEST) + len(ANSWER)) * byte
    waits = [heard[0][0] - 0.02 * n - fair for n, heard in enumerate(run.answers)]
    assert run.outside == ANSWER * 1000
    delayed = [wait for wait in waits if wait > 1e-9]
    once = [wait for wait in delayed if wait < 0.002001]
    both = [wait for wait in delayed if wait > 0.002001]
    assert min(once) > 0.000999
    assert max(both) < 0.004001
    assert len(once) + 2 * len(both) == run.plan.counts["delay"]


def test_late_is_for_answers_alone() -> None:
    run = Run(FaultPlan(late=(0.25, 0.05, 0.2), seed=1), within=0.5)
    assert run.on_line(OUTSIDE) == [REQUEST] * 1000
    assert run.outside == ANSWER * 1000
    waits = [heard[0][0] - 0.5 * n for n, heard in enumerate(run.answers)]
    late = [wait for wait in waits if wait > 1e-9]
    assert len(late) == run.plan.counts.to_master["late"] == run.plan.counts.total
    assert 0.0499 < min(late) < 0.06
    assert 0.19 < max(late) < 0.2001


def test_an_answer_does_not_overtake_a_late_one() -> None:
    wire = Wire(baud=BAUD, faults=FaultPlan(late=(1.0, 0.1, 0.1)))
    numbered = [bytes([n] * 4) for n in range(3)]
    wire.attach(Talker((0.0, numbered[0]), (0.02, numbered[1]), (0.25, numbered[2])))
    tap = listen(wire)
    wire.advance(1.0)
    assert [data for _, _, data in tap] == numbered
    assert [at for at, _, _ in tap] == [pytest.approx(t + 4 * BYTE) for t in (0.1, 0.12, 0.35)]


def test_what_a_station_sends_keeps_its_order() -> None:
    for seed in range(50):
        plan = FaultPlan(late=(0.5, 0, 0.1), delay=(0.5, 0, 0.1), seed=seed)
        wire = Wire(baud=BAUD, faults=plan, collisions=False)
        numbered = [bytes([n] * 4) for n in range(20)]
        wire.attach(Talker(*((n / 100, data) for n, data in enumerate(numbered))))
        tap = listen(wire)
        for n, data in enumerate(numbered):
            wire.transmit(data, n / 100)
        wire.advance(10.0)
        assert sources(tap, OUTSIDE) == sources(tap, "station 1") == numbered
        for source in (OUTSIDE, "station 1"):
            ends = [at for at, who, _ in tap if who == source]
            assert all(later - sooner >= 4 * BYTE * 0.999 for sooner, later in pairwise(ends))


def test_duplicate() -> None:
    run = Run(FaultPlan(duplicate=0.2, seed=1))
    counts = run.plan.counts
    assert run.on_line(OUTSIDE) == [REQUEST] * (1000 + counts.to_slaves["duplicate"])
    assert run.station.requests == 1000 + counts.to_slaves["duplicate"]
    assert run.outside == ANSWER * (run.station.requests + counts.to_master["duplicate"])
    assert counts.total == counts["duplicate"]
    assert counts.to_slaves["duplicate"] > 150
    assert counts.to_master["duplicate"] > 150


def test_a_duplicate_comes_after_its_gap() -> None:
    wire = Wire(baud=BAUD, faults=FaultPlan(duplicate=(1.0, 0.003, 0.003)))
    tap = listen(wire)
    wire.transmit(b"abcd", 0.0)
    wire.advance(1.0)
    assert [at for at, _, _ in tap] == [pytest.approx(4 * BYTE), pytest.approx(8 * BYTE + 0.003)]


def test_a_duplicate_that_meets_an_answer_is_garbled() -> None:
    run = Run(FaultPlan(duplicate=(0.2, 0, 0), to="slaves", seed=1), baud=BAUD)
    # The station answers at once, while its request is sent again.
    assert run.wire.collisions == run.plan.counts["duplicate"] > 0
    assert run.station.requests == 1000
    garbled = [data for data in run.on_line("node") if data != ANSWER]
    assert len(garbled) == run.plan.counts["duplicate"]
    assert all(data[len(REQUEST) :] == ANSWER[len(REQUEST) :] for data in garbled)


def test_stray_frames_are_earlier_answers() -> None:
    plan = FaultPlan(stray=0.2, seed=1)
    run = Run(plan, setup=lambda wire: wire.attach(Answerer(9, answer=b"answer of 9"), "other"))
    strays = run.on_line(LINE)
    assert strays == [ANSWER] * plan.counts["stray"]
    assert run.outside == ANSWER * (1000 + plan.counts["stray"])
    assert 300 < plan.counts["stray"] < 500
    assert run.station.everything.count(ANSWER) == len(strays)  # all stations receive them


def test_there_is_no_stray_before_the_first_answer() -> None:
    plan = FaultPlan(stray=1.0)
    wire = Wire(baud=None, faults=plan)
    tap = listen(wire)
    for second in range(20):
        wire.transmit(REQUEST, float(second))
    wire.advance(30.0)
    assert sources(tap, LINE) == []
    assert plan.counts.total == 0


def test_a_stray_may_come_between_request_and_answer() -> None:
    run = Run(FaultPlan(stray=0.3, strays=[b"stray 1", b"stray 2"], to="master", seed=1))
    order = Counter(b"".join(data for _, data in heard) for heard in run.answers)
    assert order[b"stray 1" + ANSWER]
    assert order[b"stray 2" + ANSWER]
    assert order[ANSWER + b"stray 1"]


def test_strays_are_made_by_a_function() -> None:
    plan = FaultPlan(stray=0.5, strays=lambda chance: b"made %d" % chance.randrange(10), seed=1)
    run = Run(plan, 200)
    assert set(run.on_line(LINE)) == {b"made %d" % n for n in range(10)}
    assert len(run.on_line(LINE)) == plan.counts["stray"]


def test_a_stray_leaves_room_for_what_it_was_drawn_for() -> None:
    run = Run(FaultPlan(stray=1.0, strays=[b"stray frame"], to="master", seed=1), 200, baud=BAUD)
    assert run.wire.collisions == 0
    assert run.outside.count(ANSWER) == run.outside.count(b"stray frame") == 200


@pytest.mark.parametrize("baud", [None, BAUD])
def test_noise(baud: int | None) -> None:
    run = Run(FaultPlan(noise=0.3, seed=1), baud=baud)
    noise = run.on_line(LINE)
    assert len(noise) == run.plan.counts["noise"] == run.plan.counts.total
    assert {len(data) for data in noise} == set(range(1, 21))
    assert len(run.on_line(OUTSIDE)) == 1000
    assert len(run.outside) == sum(map(len, noise)) + sum(map(len, run.on_line("node")))


def test_noise_before_behind_and_alone() -> None:
    run = Run(FaultPlan(noise=1.0, to="master", seed=1), 600, within=0.05)
    places: Counter[str] = Counter()
    for n, heard in enumerate(run.answers):
        times = [at - 0.05 * n for at, _ in heard]
        everything = b"".join(data for _, data in heard)
        if len(heard) == 2:
            assert everything.startswith(ANSWER)
            assert 0 < times[1] < 0.01
            places["alone"] += 1
        else:
            places["behind" if everything.startswith(ANSWER) else "before"] += 1
            assert everything.startswith(ANSWER) or everything.endswith(ANSWER)
    assert sum(places.values()) == 600
    assert min(places[place] for place in ("before", "behind", "alone")) > 150


def test_silent() -> None:
    plan = FaultPlan(silent=(0.02, 0.1, 0.3), seed=1, keep_log=True)
    run = Run(plan)
    silences = plan.counts.to_master["silent"]
    assert plan.counts.total == silences > 10
    assert run.station.requests == 1000  # silent, not deaf
    unanswered = [n for n, heard in enumerate(run.answers) if not heard]
    assert len(unanswered) == plan.counts.silenced
    assert run.outside == ANSWER * (1000 - len(unanswered))
    assert plan.log is not None
    for begin, following in pairwise([round(fault.at / 0.02) for fault in plan.log]):
        asked = [n in unanswered for n in range(begin, following)]
        quiet = sum(asked)
        assert asked == [True] * quiet + [False] * (len(asked) - quiet)
        assert 0.1 - 0.021 < quiet * 0.02 < 0.3 + 0.021


def test_one_silent_station_does_not_silence_another() -> None:
    wire = Wire(baud=None, faults=FaultPlan(silent=(0.5, 100.0, 100.0), seed=1))
    for number in (1, 2):
        wire.attach(Answerer(number, answer=bytes([number])))
    port = VirtualPort(wire)
    found = set()
    for _ in range(20):
        heard = tuple(bool(ask(port, bytes([n]) + REQUEST[1:], within=0.1)) for n in (1, 2))
        found.add(heard)
    assert (False, True) in found or (True, False) in found
    assert (False, False) in found


@pytest.mark.parametrize(("to", "asked", "answered"), [("slaves", True, False), ("master", False, True)])
def test_one_direction_alone(to: str, asked: bool, answered: bool) -> None:
    counts = Run(FaultPlan.parse(f"all=0.9,silent=0,drop=0,to={to},seed=1"), 300).plan.counts
    assert bool(sum(counts.to_slaves.values())) is asked
    assert bool(sum(counts.to_master.values())) is answered


def test_all_of_them_together_add_up() -> None:
    plan = FaultPlan.parse("all=0.9,seed=5")
    run = Run(plan, 3000)
    counts = plan.counts
    assert counts.to_slaves["late"] == counts.to_slaves["silent"] == 0
    assert all(counts[kind] > 0 for kind in KINDS)
    assert len(run.on_line(LINE)) == counts["stray"] + counts["noise"]
    lost, again = counts.to_slaves["drop"], counts.to_slaves["duplicate"]
    assert len(run.on_line(OUTSIDE)) == 3000 - lost + again
    lost, again = counts.to_master["drop"] + counts.silenced, counts.to_master["duplicate"]
    assert len(run.on_line("node")) == run.station.requests - lost + again
    heard = sum(len(data) for _, source, data in run.tap if source != OUTSIDE)
    assert len(run.outside) == heard


def test_chances_are_those_given() -> None:
    # One draw decides for most transmissions; further draws must keep the probability of each kind.
    chances = {"drop": 0.0, "flip": 0.1, "truncate": 0.25, "delay": 0.03, "duplicate": 0.4, "noise": 0.01}
    plan = FaultPlan(**chances, seed=11)  # type: ignore[arg-type]
    pairs: Counter[tuple[str, ...]] = Counter()
    for n in range(40_000):
        before = dict(plan.counts.to_slaves)
        plan.disturb(bytes(20), float(n), OUTSIDE, to_master=False)
        pairs[tuple(kind for kind in KINDS if plan.counts.to_slaves[kind] > before[kind])] += 1
    for kind, chance in chances.items():
        assert plan.counts[kind] == pytest.approx(40_000 * chance, rel=0.12), kind
    together = sum(count for kinds, count in pairs.items() if {"flip", "truncate"} <= set(kinds))
    assert together == pytest.approx(40_000 * 0.1 * 0.25, rel=0.12)
    untouched = 0.9 * 0.75 * 0.97 * 0.6 * 0.99
    assert pairs[()] == pytest.approx(40_000 * untouched, rel=0.05)


def test_a_chance_of_one_always_happens() -> None:
    run = Run(FaultPlan(flip=1.0, duplicate=1.0), 100)
    assert run.plan.counts.to_slaves["flip"] == run.plan.counts.to_slaves["duplicate"] == 100


def test_the_log_tells_what_happened() -> None:
    plan = FaultPlan.parse("all=0.5,seed=2")
    assert plan.log is None
    logged = FaultPlan(flip=0.2, drop=0.1, seed=2, keep_log=True)
    run = Run(logged, 500)
    assert logged.log is not None
    assert len(logged.log) == logged.counts.total
    for kind in ("flip", "drop"):
        for direction, counts in (
            ("to_slaves", logged.counts.to_slaves),
            ("to_master", logged.counts.to_master),
        ):
            found = [fault for fault in logged.log if (fault.kind, fault.direction) == (kind, direction)]
            assert len(found) == counts[kind]
    flipped = [fault.data for fault in logged.log if fault.kind == "flip" and fault.direction == "to_slaves"]
    assert flipped == [data for data in run.on_line(OUTSIDE) if data != REQUEST]
    times = [fault.at for fault in logged.log]
    assert times == sorted(times)


def test_faults_leave_the_echo_alone() -> None:
    wire = Wire(baud=BAUD, echo=True, faults=FaultPlan(drop=0.3, flip=0.3, truncate=0.3, seed=1))
    for second in range(300):
        wire.transmit(REQUEST, float(second))
        wire.advance(second + 0.5)
        assert wire.take(second + 0.5) == REQUEST


def test_counts_in_plain_types() -> None:
    counts = Run(FaultPlan(drop=0.5, seed=1), 20).plan.counts
    plain = counts.as_dict()
    assert set(plain) == {"to_slaves", "to_master", "silenced"}
    assert plain["to_slaves"]["drop"] == counts.to_slaves["drop"]
    assert set(plain["to_master"]) == set(KINDS)
    assert repr(counts) == f"FaultCounts(drop={counts['drop']})"


def test_traffic_elsewhere_does_not_change_a_plan() -> None:
    first = Run(FaultPlan.parse("all=0.3,seed=9"), 200).log()
    random.seed(1)
    random.random()
    assert Run(FaultPlan.parse("all=0.3,seed=9"), 200).log() == first
