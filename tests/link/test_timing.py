"""Every term of a deadline, against numbers computed by hand."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from qlinkgen.codecs import mc1231a, qlink, trio
from qlinkgen.link import Timing
from tests.link.line import timing
from tests.python.protocols import module

MS = 1e-3
POSITION = qlink.COMMANDS["motor_position"]
LOAD = qlink.COMMANDS["node_program_load"]
SYNC = qlink.COMMANDS["node_sync"]
REQUEST = qlink.COMMANDS["motor_request"]  # must not be repeated

#: A4's frame: preamble 2, then 30 bytes that may all be A5 except the length: 2 + 1 + 2 * 29 = 61.
LONGEST = 61


@pytest.mark.parametrize(
    ("baud", "byte_time"),
    [(115200, 0.0868055556 * MS), (9600, 1.0416666667 * MS), (1_000_000, 0.01 * MS)],
)
def test_terms(baud: int, byte_time: float) -> None:
    terms = timing(baud=baud, slack=4 * MS)
    assert terms.byte_time == pytest.approx(byte_time)
    assert terms.on_wire(0) == 0
    assert terms.on_wire(7) == pytest.approx(7 * byte_time)
    assert terms.allowance(POSITION) == pytest.approx(3 * byte_time)
    assert terms.allowance(LOAD) == pytest.approx(10 * MS)
    assert terms.gap(SYNC) == pytest.approx(3 * byte_time)
    assert terms.longest_frame == LONGEST
    assert terms.longest_allowance == pytest.approx(10 * MS)
    assert terms.quiet == pytest.approx(3 * byte_time + 4 * MS)
    assert terms.quiet_limit == pytest.approx((2 * 3 + 61) * byte_time + 8 * MS)


def test_three_byte_times_are_260_microseconds() -> None:
    assert timing().allowance(POSITION) == pytest.approx(260.4e-6, abs=0.1e-6)


@pytest.mark.parametrize(
    ("baud", "command", "size", "expected"),
    [
        # motor_position: 7 bytes go out, up to 17 come back, 3 byte times, 4 ms slack
        (115200, POSITION, 7, 27 * 0.0868055556 + 4),
        (9600, POSITION, 7, 27 * 1.0416666667 + 4),
        (115200, POSITION, None, (9 + 17 + 3) * 0.0868055556 + 4),
        # node_program_load: up to 11 bytes come back; 10 ms
        (115200, LOAD, 40, 51 * 0.0868055556 + 10 + 4),
        (9600, LOAD, 40, 51 * 1.0416666667 + 10 + 4),
        (115200, LOAD, None, 72 * 0.0868055556 + 10 + 4),
        # nothing answers
        (115200, SYNC, 8, 0.0),
        (115200, SYNC, None, 0.0),
    ],
)
def test_deadline(baud: int, command: Any, size: int | None, expected: float) -> None:
    terms = timing(baud=baud, slack=4 * MS)
    assert terms.deadline(command, size) == pytest.approx(expected * MS)


def test_worst_case_by_hand() -> None:
    # Before it an abandoned request: 2 * 61 bytes, 10 ms, 4 ms.
    # Each attempt: quiet limit 67 bytes + 8 ms, deadline 29 bytes + 4 ms.
    byte = 10 / 115200
    terms = timing(slack=4 * MS)
    given_up = 122 * byte + 14 * MS
    attempt = 96 * byte + 12 * MS
    assert terms.worst_case(POSITION) == pytest.approx(given_up + 3 * attempt)
    assert terms.worst_case(POSITION, 1) == pytest.approx(given_up + attempt)
    # A broadcast is sent once.
    assert terms.worst_case(SYNC) == pytest.approx(given_up + 67 * byte + 8 * MS)
    assert terms.worst_case(SYNC, 7) == terms.worst_case(SYNC)
    assert terms.worst_case(REQUEST, 7) == terms.worst_case(REQUEST, 1)
    # With much slack the search for an echo takes longer: quiet limit, two bytes, quiet.
    slow = timing(slack=40 * MS)
    search = (67 + 2 + 3) * byte + 120 * MS
    assert slow.worst_case(SYNC) == pytest.approx(search + 67 * byte + 80 * MS)


def test_attempts_are_tries() -> None:
    terms = timing(attempts=3)
    assert [terms.attempts_of(POSITION, wanted) for wanted in (None, 1, 2, 9)] == [3, 1, 2, 9]
    assert [terms.attempts_of(REQUEST, wanted) for wanted in (None, 1, 9)] == [1, 1, 1]
    assert terms.attempts_of(qlink.COMMANDS["node_start"]) == 1  # may be repeated, but nothing would end it


@pytest.mark.parametrize(
    ("bad", "says"),
    [
        ({"baud": 0}, "baud must be 1 or more, not 0"),
        ({"baud": -9600}, "baud must be 1 or more, not -9600"),
        ({"baud": float("nan")}, "baud must be 1 or more, not nan"),
        ({"host_slack": -0.001}, "host_slack must be 0 s or more, not -0.001"),
        ({"host_slack": float("inf")}, "host_slack must be 0 s or more, not inf"),
        ({"host_slack": float("nan")}, "host_slack must be 0 s or more, not nan"),
        ({"attempts": 0}, "attempts must be 1 or more, .* not 0"),
        ({"attempts": -1}, "attempts must be 1 or more, .* not -1"),
        ({"attempts": 2.5}, "attempts must be 1 or more, .* not 2.5"),
        ({"attempts": "3"}, "attempts must be 1 or more, .* not '3'"),
        ({"attempts": None}, "attempts must be 1 or more, .* not None"),
    ],
)
def test_bad_terms(bad: dict[str, Any], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        replace(timing(), **bad)


@pytest.mark.parametrize("attempts", [0, -3, 1.5, "2"])
def test_bad_attempts_of_a_call(attempts: Any) -> None:
    with pytest.raises(ValueError, match=r"attempts must be 1 or more"):
        timing().worst_case(POSITION, attempts)


def test_schemas_that_name_no_speed_or_no_command() -> None:
    with pytest.raises(ValueError, match="the schema states no speed"):
        Timing.of(mc1231a, host_slack=0.0)
    with pytest.raises(ValueError, match="no commands"):
        Timing.of(trio, host_slack=0.0, baud=9600)


def test_other_protocols() -> None:
    modbus = Timing.of(module("modbus_rtu"), host_slack=0.0)
    assert modbus.byte_time == pytest.approx(11 / 19200)
    assert modbus.longest_allowance == pytest.approx(0.1)
    dynamixel = Timing.of(module("dynamixel"), host_slack=0.0, baud=1_000_000)
    assert dynamixel.byte_time == pytest.approx(1e-5)
