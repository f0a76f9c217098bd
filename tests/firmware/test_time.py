"""Timed behaviour of a firmware, by its own clock: an event occurs between two reads of its state."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import pytest

from qlinkgen.codecs import qlink
from tests.firmware.diagnostics import State
from tests.firmware.firmware import FIFO, HANGS, TARGETS
from tests.firmware.fixtures import FirmwareLines
from tests.firmware.line import FirmwareLine
from tests.firmware.node import FirmwareNode

#: Words a second, without a whole number of milliseconds per word, so that rounding errors would add up.
RATE = 333
WORDS = 252
#: Reads of the state after which no event will follow.
MOST = 200_000


class Between(NamedTuple):
    """An event after the first of these milliseconds, and not after the last."""

    after: int
    before: int

    def takes(self, earlier: Between, milliseconds: int) -> bool:
        """Whether `milliseconds` can be the time between an earlier event and this one."""
        return self.after - earlier.before <= milliseconds <= self.before - earlier.after


@pytest.fixture(params=TARGETS)
def line(request: pytest.FixtureRequest, firmware_line: FirmwareLines) -> FirmwareLine:
    return firmware_line(request.param)


def looks(line: FirmwareLine) -> Iterator[State]:
    for _ in range(MOST):
        yield line.diagnostics.state()
    raise AssertionError(f"no event in {MOST} reads of the state")


def ask(line: FirmwareLine, request: qlink.Message) -> qlink.Message:
    line.write(request.to_frame())
    answer = line.next_answer(HANGS)
    assert answer is not None
    return qlink.decode_response(answer)


def when(line: FirmwareLine, action: Callable[[], object]) -> Between:
    """Do the action; return its time."""
    first = line.diagnostics.state()
    action()
    return Between(first.milliseconds, line.diagnostics.state().milliseconds)


def until_output_1(line: FirmwareLine, level: int, last: int) -> Between:
    """Read the state until output 1 has a level unlike at the millisecond `last`; return the time."""
    for state in looks(line):
        if state.outputs == level:
            return Between(last, state.milliseconds)
        last = state.milliseconds
    raise AssertionError


def switch_input_1(line: FirmwareLine, level: int) -> Between:
    """Put a level on input 1; return its time."""
    return when(line, lambda: line.diagnostics.force_inputs(level, power_up=False))


def test_the_motor_takes_words_at_its_rate(line: FirmwareLine) -> None:
    FirmwareNode(line, capacity=FIFO, rate=RATE)
    for counter in range(WORDS // 12):
        ask(line, qlink.MotionRequest(node=1, counter=counter, segments=[1] * 12))
    start = when(line, lambda: line.write(qlink.NodeStartRequest(node=0).to_frame()))
    for state in looks(line):
        done = WORDS - state.waiting
        assert done == state.position
        if not state.waiting:
            break
        # Millisecond and word are those begun, not those completed.
        assert (state.milliseconds - start.before - 1) * RATE / 1000 - 1 <= done
        assert done <= (state.milliseconds - start.after + 1) * RATE / 1000
    assert state.milliseconds - start.after >= (WORDS * 1000) // RATE
    assert not state.running


def test_output_1_follows_input_1_by_t1_and_t2(line: FirmwareLine) -> None:
    FirmwareNode(line, t1_delay=0.2, t2_delay=0.1)
    for level, delay in ((1, 200), (0, 100)):
        edge = switch_input_1(line, level)
        change = until_output_1(line, level, edge.after)
        assert change.takes(edge, delay)


def test_a_pulse_shorter_than_t1_never_reaches_output_1(line: FirmwareLine) -> None:
    FirmwareNode(line, t1_delay=0.2, t2_delay=0.1)
    risen, fallen = switch_input_1(line, 1), switch_input_1(line, 0)
    while fallen.before - risen.after >= 200:  # the test was delayed during the pulse
        FirmwareNode(line, t1_delay=0.2, t2_delay=0.1)
        risen, fallen = switch_input_1(line, 1), switch_input_1(line, 0)
    for state in looks(line):
        assert state.outputs == 0
        if state.milliseconds > fallen.before + 300:
            return


def test_a_motor_request_takes_its_time(line: FirmwareLine) -> None:
    node = FirmwareNode(line, motor_seconds=0.12)
    asked = when(line, lambda: ask(line, qlink.MotorRequestRequest(node=1, motor_data=b"move")))
    last = asked.after
    for state in looks(line):
        answer = ask(line, qlink.MotorResponsePollRequest(node=1))
        assert isinstance(answer, qlink.MotorResponsePollResponse)
        if answer.last_completion:
            assert bytes(answer.motor_data) == b"move"
            break
        last = state.milliseconds
    assert Between(last, line.diagnostics.state().milliseconds).takes(asked, 120)
    assert node.statistics.motor_requests == 1
