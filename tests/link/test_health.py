"""Missing nodes: when they go offline, their trials, and the cost for other nodes."""

from __future__ import annotations

from typing import Any

import pytest

from qlinkgen.codecs import qlink
from qlinkgen.errors import LinkError, NoReply
from qlinkgen.link import HealthPolicy, MasterEngine
from qlinkgen.link.events import HealthChanged, Refused
from qlinkgen.sim import VirtualPort, Wire
from qlinkgen.transport.blocking import BlockingMaster
from tests.link.line import BYTE, SLACK, drive, make, taken

ASK = qlink.MotorPositionRequest(node=3)
GOT = qlink.MotorPositionResponse(node=3).to_frame()
POLICY = HealthPolicy(offline_after=2, first_pause=0.1, longest_pause=2.0, share=0.02)
DEADLINE = 27 * BYTE + SLACK


def silence(engine: MasterEngine, now: float, **options: Any) -> LinkError:
    error = drive(engine, ASK, now=now, **options).error
    assert error is not None
    return error


def states(engine: MasterEngine) -> list[str]:
    return [event.state for event in taken(engine) if isinstance(event, HealthChanged)]


def offline() -> MasterEngine:
    """An engine with node 3 offline, and its next trial well before 10 s."""
    engine = make(health=POLICY)
    silence(engine, 0.0, attempts=1)
    silence(engine, 1.0, attempts=1)
    assert engine.health[3].state == "offline"
    taken(engine)
    return engine


def test_from_online_to_offline_and_back() -> None:
    engine = make(health=POLICY)
    assert drive(engine, ASK, [(0.0017, GOT)]).reply is not None
    assert engine.health[3].state == "online"
    assert states(engine) == []
    silence(engine, 1.0)
    assert (engine.health[3].state, engine.health[3].failures) == ("suspect", 1)
    assert len(drive(engine, ASK, now=2.0).sent) == 3  # a suspect gets all attempts
    assert engine.health[3].state == "offline"
    assert states(engine) == ["suspect", "offline"]
    due = engine.health[3].next_trial
    run = drive(engine, ASK, [(due + 0.0017, GOT)], now=due)
    assert run.reply is not None
    assert (engine.health[3].state, engine.health[3].failures) == ("online", 0)
    assert states(engine) == ["online"]


def test_a_suspect_that_answers_is_online() -> None:
    engine = make(health=POLICY)
    silence(engine, 0.0)
    drive(engine, ASK, [(1.0017, GOT)], now=1.0)
    assert states(engine) == ["suspect", "online"]
    silence(engine, 2.0)
    assert engine.health[3].state == "suspect"  # counted from the beginning again


def test_an_offline_node_is_left_alone_until_its_trial() -> None:
    engine = offline()
    due = engine.health[3].next_trial
    before = engine.total.requests
    for now in (1.1, due - 0.001):
        with pytest.raises(NoReply, match=r"not sent, since 2 transactions failed; next trial in") as seen:
            engine.start(ASK, now)
        assert seen.value.attempts == 0
        assert seen.value.node == 3
        assert not engine.busy
    assert engine.total.requests == before
    assert engine.counters[3].refused == 2
    assert taken(engine) == [Refused(1.1, 3, ASK), Refused(due - 0.001, 3, ASK)]
    assert len(drive(engine, ASK, now=due, attempts=5).sent) == 1  # a trial is one attempt


def test_what_nobody_answers_is_sent_all_the_same() -> None:
    engine = offline()
    stop = qlink.NodeStopRequest(node=3)  # it has no response to wait for, and the node may receive it
    assert drive(engine, stop, now=1.1).frames == [stop.to_frame()]


def test_the_others_do_not_notice() -> None:
    engine = offline()
    other = qlink.MotorPositionRequest(node=4)
    answer = qlink.MotorPositionResponse(node=4)
    assert drive(engine, other, [(1.1017, answer.to_frame())], now=1.1).response == answer


def test_pauses_grow_up_to_the_longest() -> None:
    engine = offline()
    pauses = []
    for _ in range(8):
        due = engine.health[3].next_trial
        end = drive(engine, ASK, now=due).end
        pauses.append(engine.health[3].next_trial - end)
    least = (DEADLINE + 3 * BYTE + SLACK) / 0.02  # the following silence is part of its cost
    assert pauses == pytest.approx([max(least, pause) for pause in (0.2, 0.4, 0.8, 1.6, 2, 2, 2, 2)])


def test_a_trial_never_takes_more_than_its_share() -> None:
    policy = HealthPolicy(first_pause=0.0, longest_pause=0.0, share=0.02)
    assert policy.pause(0, 0.010) == pytest.approx(0.5)
    assert HealthPolicy().pause(0, 0.0) == 0.1
    assert HealthPolicy().pause(3, 0.0) == pytest.approx(0.8)
    assert HealthPolicy().pause(10**6, 0.0) == 5.0


def test_a_question_on_trial_is_not_held_against_the_node() -> None:
    engine = make(health=POLICY)
    for now in (0.0, 1.0, 2.0):
        silence(engine, now, trial=True)
    assert engine.health == {}
    silence(engine, 3.0)
    silence(engine, 4.0, trial=True)
    assert engine.health[3].state == "suspect"


def test_it_is_asked_although_the_node_is_offline() -> None:
    engine = offline()
    due = engine.health[3].next_trial
    assert len(drive(engine, ASK, now=1.1, trial=True, attempts=2).sent) == 2
    assert engine.health[3].next_trial == due
    drive(engine, ASK, [(1.2017, GOT)], now=1.2, trial=True)
    assert states(engine) == ["online"]


@pytest.mark.parametrize("request_", [qlink.NodeInfoRequest(node=0), qlink.NodeSyncRequest(node=0)])
def test_a_broadcast_has_no_health(request_: Any) -> None:
    engine = make(health=HealthPolicy(offline_after=1))
    for now in range(3):
        drive(engine, request_, now=float(now))
    drive(
        engine, qlink.NodeInfoRequest(node=0), [(9.004, qlink.NodeInfoResponse(node=4).to_frame())], now=9.0
    )
    assert engine.health == {}
    assert states(engine) == []


def test_a_line_that_is_never_quiet_says_nothing_of_a_node() -> None:
    engine = make(health=HealthPolicy(offline_after=1))
    drive(engine, qlink.NodeInfoRequest(node=0), attempts=1)  # failed: the line is not trusted
    noise = [(0.005 + 0.001 * number, b"?") for number in range(100)]
    run = drive(engine, ASK, noise, now=0.0055)
    assert "line never became idle" in str(run.error)
    assert engine.health == {}
    assert engine.counters[3].failures == 1


def test_without_a_policy_nothing_is_noted() -> None:
    engine = make()
    for now in range(5):
        assert len(drive(engine, ASK, now=float(now)).sent) == 3
    assert engine.health == {}
    assert states(engine) == []


@pytest.mark.parametrize(
    ("bad", "says"),
    [
        ({"offline_after": 0}, "offline_after must be 1 or more, not 0"),
        ({"first_pause": -1.0}, "first_pause -1.0"),
        ({"first_pause": 9.0}, "first_pause 9.0 .* longest_pause 5.0"),
        ({"longest_pause": float("nan")}, "longest_pause nan"),
        ({"share": 0.0}, "share must be above 0 and at most 1, not 0.0"),
        ({"share": 1.5}, "share must be above 0 and at most 1, not 1.5"),
    ],
)
def test_bad_policies(bad: dict[str, Any], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        HealthPolicy(**bad)


class Crowd:
    """All nodes of a bus in one engine, which is faster than one for each."""

    def __init__(self, numbers: set[int]) -> None:
        self._numbers = numbers
        self._decoder = qlink.StreamDecoder("request")
        self._answer, self._due = b"", 0.0

    def receive(self, data: bytes, now: float) -> None:
        for event in self._decoder.feed(data):
            if isinstance(event, qlink.MotorPositionRequest) and event.node in self._numbers:
                self._answer = qlink.MotorPositionResponse(node=event.node, position=1).to_frame()
                self._due = now + 3 * BYTE

    def bytes_to_send(self, now: float) -> bytes:
        answer, self._answer = self._answer, b""
        return answer

    def next_timer(self) -> float | None:
        return self._due if self._answer else None


def time_lost(slack: float, seconds: float, *dead: int) -> tuple[float, float]:
    """Part of the bus's time that dead nodes cost in an endless cycle over 16 nodes: in all, and without
    the first second, in which they are found out."""
    wire = Wire(baud=115200)
    wire.attach(Crowd({number for number in range(1, 17) if number not in dead}))
    port = VirtualPort(wire)
    master = BlockingMaster(make(slack=slack, health=HealthPolicy()), port)
    answered, busy, found_out = 0, 0.0, (0.0, 0)
    while port.now() < seconds:
        for number in range(1, 17):
            begun = port.now()
            try:
                master.transact(qlink.MotorPositionRequest(node=number))
            except LinkError:
                continue
            answered += 1
            if busy == 0.0:  # one transaction that nothing delays
                busy = port.now() - begun
        if port.now() >= 1.0 and found_out[0] == 0.0:
            found_out = port.now(), answered
    since, before = found_out
    return 1 - answered * busy / port.now(), 1 - (answered - before) * busy / (port.now() - since)


@pytest.mark.parametrize("slack", [0.004, 0.020])
def test_a_dead_node_of_16_costs_less_than_3_percent(slack: float) -> None:
    assert time_lost(slack, 1.2) == pytest.approx((0.0, 0.0), abs=1e-6)
    whole, later = time_lost(slack, 15.0, 9)
    print(f"slack {slack * 1e3:.0f} ms: {whole:.2%}, once it is known {later:.2%}")
    assert 0.0 < whole < 0.03  # its discovery included
    assert 0.0 < later < 0.02
