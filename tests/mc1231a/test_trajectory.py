"""Profiles: they arrive, exactly, and keep to their limits."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from qlinkgen.protocols.mc1231a.trajectory import (
    COUNTS,
    S_CURVE,
    VELOCITY,
    Trajectory,
    point_to_point,
    way_to_stop,
)

ONE = 1 << COUNTS


def run(trajectory: Trajectory, limit: int, acceleration: int, most: int = 100_000) -> list[int]:
    """Positions until it has come to its end."""
    places = [trajectory.position]
    while trajectory.moving:
        trajectory.sample(limit, acceleration)
        places.append(trajectory.position)
        assert len(places) < most, "it does not arrive"
    return places


def steps(values: list[int]) -> list[int]:
    return [after - before for before, after in itertools.pairwise(values)]


@given(
    destination=st.integers(-500, 500),
    limit=st.integers(ONE // 8, 40 * ONE),
    acceleration=st.integers(ONE // 64, 20 * ONE),
)
def test_a_trapezoid_arrives_and_keeps_to_its_limits(destination: int, limit: int, acceleration: int) -> None:
    trajectory = Trajectory()
    trajectory.move_to(destination << COUNTS, 1)
    places = run(trajectory, limit, acceleration)
    assert places[-1] == destination << COUNTS
    assert trajectory.velocity == 0
    speeds = [0, *steps(places)]
    assert max(map(abs, speeds)) <= max(limit, min(acceleration, abs(destination) << COUNTS))
    assert all(abs(change) <= 2 * acceleration for change in steps(speeds))  # 2 at the end
    assert sorted(places, reverse=destination < 0) == places  # it never turns back


@given(
    first=st.integers(-300, 300),
    second=st.integers(-300, 300),
    after=st.integers(0, 200),
    limit=st.integers(ONE // 16, 10 * ONE),
    acceleration=st.integers(ONE // 64, 2 * ONE),
    mode=st.sampled_from((0, S_CURVE)),
)
def test_a_destination_may_change_on_the_way(
    *, first: int, second: int, after: int, limit: int, acceleration: int, mode: int
) -> None:
    trajectory = Trajectory()
    trajectory.mode = mode
    trajectory.move_to(first << COUNTS, 7)
    for _ in range(after):
        if trajectory.moving:
            trajectory.sample(limit, acceleration)
    trajectory.move_to(second << COUNTS, 7)
    assert run(trajectory, limit, acceleration)[-1] == second << COUNTS


@given(ramp=st.integers(1, 200), destination=st.integers(1, 2000))
def test_an_s_curve_builds_up_its_acceleration(ramp: int, destination: int) -> None:
    acceleration = ONE // 50
    trajectory = Trajectory()
    trajectory.mode = S_CURVE
    trajectory.move_to(destination << COUNTS, ramp)
    places = run(trajectory, 3 * ONE, acceleration)
    assert places[-1] == destination << COUNTS
    changes = steps([0, *steps(places), 0])
    assert all(abs(change) <= 2 * acceleration + 1 for change in changes)
    # The jerk: each change of the trapezoid comes into the mean once, and leaves it once.
    assert all(abs(jerk) <= 4 * acceleration // ramp + 4 for jerk in steps([0, *changes, 0]))


def test_velocity_mode_runs_up_and_reverses() -> None:
    trajectory = Trajectory()
    trajectory.mode = VELOCITY
    trajectory.run_free()
    for _ in range(40):
        trajectory.sample(10 * ONE, ONE)
    assert trajectory.velocity == 10 * ONE
    for _ in range(40):
        trajectory.sample(10 * ONE, -ONE)
    assert trajectory.velocity == -10 * ONE
    trajectory.slow_down(ONE)
    run(trajectory, 10 * ONE, -ONE)
    assert not trajectory.moving


@pytest.mark.parametrize("mode", [0, S_CURVE])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_smooth_stop_decelerates(mode: int, sign: int) -> None:
    trajectory = Trajectory()
    trajectory.mode = mode
    trajectory.move_to(sign * 100_000 * ONE, 5)
    for _ in range(60):
        trajectory.sample(10 * ONE, ONE)
    speed = trajectory.velocity
    assert speed == sign * 10 * ONE
    trajectory.slow_down(ONE)
    speeds = steps(run(trajectory, 10 * ONE, ONE))
    assert all(abs(after) <= abs(before) for before, after in zip([speed, *speeds], speeds, strict=False))
    assert len(speeds) > 8


def test_without_acceleration_nothing_moves() -> None:
    trajectory = Trajectory()
    trajectory.move_to(5 * ONE, 1)
    for _ in range(10):
        trajectory.sample(ONE, 0)
    assert trajectory.position == 0
    assert trajectory.moving
    assert way_to_stop(5, 0) == 0


def test_a_velocity_that_is_lowered_on_the_way() -> None:
    velocity = 20 * ONE
    _, lower = point_to_point(10_000 * ONE, velocity, 3 * ONE, ONE)
    assert lower == 19 * ONE
