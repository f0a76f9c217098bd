"""`qlinkgen budget`: sizes by hand, and the same times on a simulated line."""

from __future__ import annotations

import json
from contextlib import closing
from itertools import islice
from pathlib import Path

import pytest

from qlinkgen.codecs import qlink
from qlinkgen.link.poll import Key, Poller
from qlinkgen.transport.blocking import BlockingMaster
from tests.cli.conftest import Run
from tests.link.line import bus, make

BYTE = 10 / 115200


def test_times_by_hand(qlinkgen: Run) -> None:
    result = qlinkgen("budget", "qlink", "1-4:motor_position=0.02", "--json")
    found = json.loads(result.out)
    (turn,) = found["turns"]
    assert (result.code, turn["nodes"], turn["period"]) == (0, 4, 0.02)
    assert turn["least"]["bytes"] == 7 + 11
    assert turn["least"]["transaction"] == pytest.approx(18 * BYTE)
    most = turn["most"]
    assert most["transaction"] == pytest.approx(most["bytes"] * BYTE + 3 * BYTE)
    assert found["most"]["cycle"] == pytest.approx(4 * most["transaction"])
    assert found["most"]["line"] == pytest.approx(4 * most["bytes"] * BYTE / 0.02)
    assert turn["silent"] == pytest.approx(3 * (most["transaction"] + 3 * BYTE))


def test_a_simulated_line_is_between_the_bounds(qlinkgen: Run) -> None:
    """A cycle as fast as the line allows takes the time computed for it."""
    found = json.loads(qlinkgen("budget", "qlink", "3,5:motor_position=0.02", "--json").out)
    periods: dict[Key, float] = {(node, "motor_position"): 1e-6 for node in (3, 5)}
    _, port, _ = bus(3, 5)
    with closing(BlockingMaster(make(slack=0.0), port).iterate(Poller(qlink, periods).run())) as outcomes:
        times = [each.time for each in islice(outcomes, 101)]
    cycle = 2 * (times[-1] - times[0]) / 100
    assert found["least"]["cycle"] <= cycle <= found["most"]["cycle"]


def test_what_does_not_fit(qlinkgen: Run) -> None:
    result = qlinkgen("budget", "qlink", "1-4:motion=0.02", "1-4:read=0.5")
    assert result.code == 1
    assert "do not fit into their periods with the longest messages and latest answers" in result.out
    result = qlinkgen("budget", "qlink", "1-16:motion=0.02", "--baud", "9600")
    assert "do not fit into their periods even with the shortest messages" in result.out


def test_a_silence_between_frames_and_no_address(qlinkgen: Run, thermo: Path) -> None:
    plain, late = (
        json.loads(qlinkgen("budget", "modbus_rtu", "1:read_coils=2", "--baud", "9600", *more, "--json").out)
        for more in ((), ("--slack", "0.02"))
    )
    added = late["turns"][0]["most"]["transaction"] - plain["turns"][0]["most"]["transaction"]
    assert added >= 0.02 - 1e-9
    assert qlinkgen("budget", "vesc", "get_values=0.5", "--baud", "115200").code == 0
    assert qlinkgen("budget", thermo, "3:set_target=1", "--baud", "9600").code == 0


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("qlink", "1:motoin=1"), "qlink has no command 'motoin'; did you mean motion?"),
        (("qlink", "motion=1"), "motion is sent to a node; write for example 3:motion=1"),
        (("qlink", "17:motion=1"), "motion: nodes 17: 17 is out of range; nodes are 1..16"),
        (("qlink", "3:motion"), "is not NODES:COMMAND=SECONDS"),
        (("qlink", "3:motion=0"), "is not NODES:COMMAND=SECONDS"),
        (("trio", "1:x=1"), "trio has no master that asks"),
        (("vesc", "3:get_values=1", "--baud", "9600"), "get_values has no node to be sent to; omit 3:"),
        (("tests/schemas/answers.yaml", "3:transfer=1"), "depends on its answers"),
    ],
)
def test_refused(qlinkgen: Run, words: tuple[str, ...], text: str) -> None:
    result = qlinkgen("budget", *words)
    assert (result.code, result.out) == (2, "")
    assert text in result.err
