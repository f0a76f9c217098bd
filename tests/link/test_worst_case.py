"""Each call ends within its worst case, for any traffic on the line."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import cycle
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from qlinkgen.codecs import qlink
from qlinkgen.errors import BadReply, LinkError
from qlinkgen.link import HealthPolicy, MasterEngine, Timing
from qlinkgen.protocols.qlink.matching import ACCEPTS
from tests.link.line import EPSILON, drive, make, pieces
from tests.python.protocols import build, module, protocol

REQUESTS = [
    qlink.MotorPositionRequest(node=3),
    qlink.MotionRequest(node=3, counter=0xA5, segments=[0xA5A5] * 12),
    qlink.LoopBackRequest(node=3, data=b"\xa5" * 25),
    qlink.NodeProgramLoadRequest(node=5),
    qlink.MotorRequestRequest(node=5, motor_data=b"\xa5" * 26),
    qlink.NodeResetRequest(node=3),
    qlink.NodeInfoRequest(node=0),
    qlink.NodeSyncRequest(node=0),
    qlink.NodeStopRequest(node=0),
    qlink.NodeStartRequest(node=5),
]
ANSWERS = [
    qlink.MotorPositionResponse(node=3),
    qlink.MotionResponse(node=3, counter=1),
    qlink.LoopBackResponse(node=3, data=b"\xa5" * 25),
    qlink.NodeResetResponse(node=3),
    qlink.MotorPositionResponse(node=16),
]
FRAMES = [message.to_frame() for message in (*REQUESTS, *ANSWERS)]

garbage = st.one_of(
    st.binary(min_size=1, max_size=20),
    st.sampled_from(FRAMES),
    st.sampled_from([b"\x00", b"\x00\x00", b"\xa5", b"\xa5\xa5", b"\xa5\xa5\x1e"]),
    st.builds(lambda frame, end: frame[:end], st.sampled_from(FRAMES), st.integers(1, 60)),
)
gaps = st.one_of(st.floats(0.0002, 0.05), st.sampled_from([0.0001, 0.002, 0.0021, 0.00226, 0.02]))
#: Received bytes, repeated endlessly, with the pause before each.
streams = st.lists(st.tuples(gaps, garbage), max_size=8)
#: Requests, with the pause before, the attempts, and the number of steps before an abort.
calls = st.lists(
    st.tuples(
        st.integers(0, len(REQUESTS) - 1),
        st.sampled_from([0.0, 0.0, 0.001, 0.3]),
        st.sampled_from([None, None, 1, 2, 5]),
        st.sampled_from([None, None, None, 1, 2, 3, 5]),
    ),
    min_size=1,
    max_size=6,
)


def endless(stream: list[tuple[float, bytes]]) -> Iterator[tuple[float, bytes]]:
    now = 0.0
    for gap, data in cycle(stream):
        now += gap
        yield now, data
    while True:
        yield float("inf"), b""


class Session:
    """Transactions on one line, one after the other, while a stream comes in."""

    def __init__(self, engine: MasterEngine, stream: list[tuple[float, bytes]]) -> None:
        self.engine = engine
        self.now = 0.0
        self.arrivals = endless(stream)
        self.next = next(self.arrivals)

    def pause(self, seconds: float) -> None:
        """Bytes received between transactions are read before the next request, as drivers do."""
        self.now += seconds
        while self.next[0] <= self.now:
            self.engine.receive(self.next[1], self.now)
            self.next = next(self.arrivals)

    def ask(self, request: Any, attempts: int | None, steps: int | None) -> int:
        """Perform a transaction, or abort it after some steps; return the number of steps."""
        engine, begun = self.engine, self.now
        command = next(each for each in engine.codec.COMMANDS.values() if each.request is type(request))
        worst = engine.timing.worst_case(command, attempts)
        try:
            engine.start(request, self.now, attempts=attempts)
        except LinkError:  # it is offline
            return 0
        count = 0
        while count != steps:
            engine.bytes_to_send(self.now)
            timer = engine.next_timer()
            assert self.now - begun <= worst + EPSILON
            if timer is None:
                break
            self.step(timer)
            count += 1
            assert count < 50_000, "the engine does not come to an end"
        engine.abort(self.now)
        assert not engine.busy
        return count

    def step(self, timer: float) -> None:
        if self.next[0] <= timer:
            self.now = max(self.now, self.next[0])
            self.engine.receive(self.next[1], self.now)
            self.next = next(self.arrivals)
        else:
            self.now = max(self.now, timer)
        if self.now >= timer:
            self.engine.handle_timer(self.now)


@settings(max_examples=250)
@given(
    stream=streams,
    calls=calls,
    echo=st.sampled_from(["none", "expect", "auto"]),
    paced=st.booleans(),
    slack=st.sampled_from([0.0, 0.002, 0.02]),
    baud=st.sampled_from([9600, 115200]),
    health=st.booleans(),
)
@example(  # the search for an echo fails, and the line is noisy for the longest permitted time
    stream=[(0.00226, b"x")] * 4,
    calls=[(0, 0.0, None, 1), (0, 0.0, None, None)],
    echo="auto",
    paced=True,
    slack=0.02,
    baud=115200,
    health=False,
)
@example(  # a long request with a long allowance is abandoned, and a short one follows
    stream=[],
    calls=[(3, 0.0, None, 1), (0, 0.0, 1, None), (7, 0.0, None, None), (0, 0.0, 1, None)],
    echo="none",
    paced=True,
    slack=0.0,
    baud=115200,
    health=False,
)
def test_any_stream(
    *,
    stream: list[tuple[float, bytes]],
    calls: list[tuple[int, float, int | None, int | None]],
    echo: Any,
    paced: bool,
    slack: float,
    baud: int,
    health: bool,
) -> None:
    engine = make(echo=echo, paced=paced, slack=slack, baud=baud, health=HealthPolicy() if health else None)
    session = Session(engine, stream)
    for which, pause, attempts, steps in calls:
        session.pause(pause)
        session.ask(REQUESTS[which], attempts, steps)


@pytest.mark.parametrize("name", ["modbus_rtu", "dynamixel", "kitchen_sink"])
@settings(max_examples=25)
@given(
    stream=st.lists(st.tuples(st.floats(0.001, 0.1), st.binary(min_size=1, max_size=30)), max_size=6),
    choice=st.lists(st.tuples(st.integers(0, 100), st.booleans()), min_size=1, max_size=4),
    echo=st.sampled_from(["none", "expect", "auto"]),
)
def test_any_protocol(
    name: str, stream: list[tuple[float, bytes]], choice: list[tuple[int, bool]], echo: Any
) -> None:
    codec = module(name)
    requests = [build(name, protocol(name).by_name[f"{command}.request"]) for command in codec.COMMANDS]
    session = Session(
        MasterEngine(codec, Timing.of(codec, host_slack=0.002), echo=echo, health=HealthPolicy()), stream
    )
    for which, give_up in choice:
        session.ask(requests[which % len(requests)], None, 1 if give_up else None)


@pytest.mark.parametrize("echo", ["none", "expect", "auto"])
@pytest.mark.parametrize("gap", [0.00005, 0.0005, 0.002, 0.0022, 0.0024, 0.005])
def test_a_babbling_line_ends_with_an_error(gap: float, echo: Any) -> None:
    engine = make(echo=echo)
    worst = engine.timing.worst_case(qlink.COMMANDS["motor_position"])
    noise = [(gap * number, b"\x37") for number in range(1, int(1 / gap))]
    runs = [(begun, drive(engine, REQUESTS[0], noise, begun)) for begun in (0.0, 0.3)]
    for begun, run in runs:
        assert isinstance(run.error, LinkError)
        assert run.end - begun <= worst + EPSILON
    if gap < engine.timing.quiet:
        run = runs[1][1]
        assert isinstance(run.error, BadReply)  # the line was never quiet
        assert "line never became idle" in str(run.error)
        assert run.frames == []


def test_deadline_holds_while_a_frame_comes_byte_by_byte() -> None:
    engine = make()
    frame = qlink.MotorPositionResponse(node=3).to_frame()
    run = drive(engine, REQUESTS[0], pieces(frame, 0.001, every=0.005), attempts=1)
    assert run.error is not None
    assert run.end == pytest.approx(27 * 10 / 115200 + 0.002)


def test_checks_of_a_protocol_are_those_of_the_shipped_one() -> None:
    assert set(ACCEPTS) <= set(qlink.COMMANDS)
