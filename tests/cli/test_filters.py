"""Options that choose frames of a capture, and the conditions of `--where`."""

from __future__ import annotations

import contextlib
import json
import random
from decimal import Decimal
from pathlib import Path
from typing import Any

import pytest

from qlinkgen.cli.conditions import ConditionError, parse_condition
from qlinkgen.codecs import qlink
from qlinkgen.model.values import Json
from tests.captures.written import EVERY, START, Burst
from tests.cli.conftest import THERMO, Run

NAMES = {"a", "b", "list", "rows", "rows.n", "mode", "word", "node"}
TEXTS = {"fast", "slow", "mode"}
VALUES: dict[str, Json] = {
    "a": 5, "b": Decimal("1.5"), "list": [1, 2], "rows": [{"n": 7}, {"n": 9}], "mode": "fast", "word": "x y",
}  # fmt: skip


@pytest.mark.parametrize(
    ("text", "fits"),
    [
        ("a == 5", True), ("a = 5", True), ("a != 5", False), ("a > 4.9", True), ("a >= 0x5", True),
        ("a < -1", False), ("b <= 1.5", True), ("b == 1.50", True), ("a in (1, 5)", True),
        ("a not in (1, 5)", False), ("2 in list", True), ("3 in list", False), ("list > 1", True),
        ("rows.n == 9", True), ("rows.n == 8", False), ("mode == fast", True), ("mode != slow", True),
        ("mode == 'fast'", True), ("word == \"x y\"", True), ("fast in mode", True), ("a", True),
        ("not a", False), ("node", False), ("node != 3", False), ("not node == 3", True),
        ("a == 5 and b == 2 or mode == fast", True), ("a == 5 and (b == 2 or mode == slow)", False),
        ("not a == 5 or a == 5", True), ("a > fast", False), ("mode > 3", False), ("mode > 'a'", True),
        ("a == true", False), ("mode == mode", False), ("mode in (slow, fast)", True), ("1e3 > a", True),
    ],
)  # fmt: skip
def test_conditions(text: str, fits: bool) -> None:
    assert parse_condition(text, NAMES, TEXTS).fits(VALUES) is fits


@pytest.mark.parametrize(
    ("text", "said", "at"),
    [
        ("", "the end is not a name", 0),
        ("a ==", "the end is not a name", 4),
        ("a b", "'b' follows a condition", 2),
        ("(a", "the end where ')' is due", 2),
        ("a == )", "')' is not a name", 5),
        ("a & b", "'&' is not part of", 2),
        ("moed == 1", "did you mean mode?", 0),
        ("a == xyzzy", "write texts in quotes", 5),
        ("a in (1", "where ')' is due", 7),
        ("'open", "is not part of a condition", 0),
        ("and", "'and' is not a name", 0),
        ("5abc", "is not part", 0),
        ("(" * 60 + "a" + ")" * 60, "more than 50", 50),
        ("a not 5", "'5' where 'in' is due", 6),
        ("__import__('os')", "no message has a value '__import__'", 0),
    ],
)
def test_wrong_conditions(text: str, said: str, at: int) -> None:
    with pytest.raises(ConditionError) as caught:
        parse_condition(text, NAMES, TEXTS)
    assert said in caught.value.message
    assert caught.value.at == at


def test_any_text() -> None:
    """Texts of the words and signs of conditions are conditions or errors, and never anything else."""
    chance = random.Random(1)
    words = [
        "a",
        "mode",
        "fast",
        "5",
        "0x",
        "'t'",
        "(",
        ")",
        ",",
        "==",
        "<",
        "and",
        "or",
        "not",
        "in",
        ".",
        "é",
    ]
    for _ in range(3000):
        text = " ".join(chance.choices(words, k=chance.randrange(12)))
        with contextlib.suppress(ConditionError):
            parse_condition(text, NAMES, TEXTS).fits(VALUES)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Return a log of requests of three nodes, their answers, and a bad frame."""
    bursts = []
    for index in range(12):
        node = index % 3 + 1
        at = START + index * 10**9
        bursts.append(Burst(qlink.MotionRequest(node=node, counter=index).to_frame(), at, "sent"))
        answer = qlink.MotionResponse(
            node=node, counter=index, position=index * 100, motor_status=qlink.MotorStatus.RUNNING
        )
        bursts.append(Burst(answer.to_frame(), at + 3_000_000, "received"))
    bursts.append(Burst(bytes.fromhex("a5a504210315e9"), START + 20 * 10**9, "sent"))
    file = tmp_path / "line.log"
    file.write_bytes(EVERY["log brackets"][1](bursts))
    return file


def shown(qlinkgen: Run, log: Path, *arguments: str) -> list[dict[str, Any]]:
    done = qlinkgen("decode", "qlink", *arguments, log)
    assert done.code == 0, done.err
    assert "qlinkgen: frames 24, bad 1 (crc 1); 0 of" in done.err
    return [json.loads(line) for line in done.lines]


def test_what_is_chosen(qlinkgen: Run, log: Path) -> None:
    def count(*arguments: str) -> int:
        return len(shown(qlinkgen, log, *arguments))

    assert count() == 25
    assert count("--message", "motion") == 24
    assert count("--message", "motion.response") == 12
    assert count("--message", "motion.response", "--message", "motor_position") == 12
    assert count("--node", "2") == 8
    assert count("--node", "2", "--node", "3", "--message", "motion.request") == 8
    assert count("--errors-only") == 1
    assert count("--where", "position >= 500") == 7
    assert count("--where", "position >= 500 and node == 3") == 3
    assert count("--where", "running in motor_status") == 12
    assert count("--where", "message == 'motion.request' and counter in (0, 1)") == 2
    assert count("--where", "offset > 0") == 23
    assert count("--since", "2026-03-01T12:00:10") == 5
    assert count("--until", "2026-03-01T12:00:00.5") == 2
    assert count("--since", str(START // 10**9 + 3), "--until", "2026-03-01 12:00:05") == 5
    assert count("--since", "2026-03-02") == 0


def test_flags_by_name(qlinkgen: Run, log: Path) -> None:
    for found in shown(qlinkgen, log, "--flags", "names", "--message", "motion.response"):
        assert found["fields"]["motor_status"] == ["running"]
    wire = qlinkgen("encode", "qlink", "motion.response", "--node", "3", "motor_status=0x81").out.strip()
    found = json.loads(qlinkgen("decode", "qlink", "--direction", "response", "--flags", "names", wire).out)
    assert found["fields"]["motor_status"][0] == "running"
    again = qlinkgen("encode", "qlink", "--json", json.dumps(found))
    assert again.out.strip() == wire, again.err


def test_wrong_options(qlinkgen: Run, log: Path, tmp_path: Path) -> None:
    for arguments, said in (
        (("--where", "postion > 1"), "--where: no message has a value 'postion'; did you mean position?"),
        (("--message", "moton"), "no message 'moton'; did you mean motion?"),
        (("--since", "noon"), "--since noon: not a time; write seconds"),
    ):
        done = qlinkgen("decode", "qlink", *arguments, log)
        assert done.code == 2
        assert said in done.err
    assert "have no address; omit --node" in qlinkgen("decode", "mc1231a", "--node", "1", "4a").err


def test_bits_and_units_of_an_own_schema(qlinkgen: Run, tmp_path: Path) -> None:
    schema = tmp_path / "thermo.yaml"
    schema.write_text(THERMO)
    wire = [
        qlinkgen(
            "encode", schema, "set_target", "--node", str(node), f"target={node}.5", "mode=cool"
        ).out.strip()
        for node in (1, 2, 3)
    ]
    for condition, nodes in (
        ("target > 1.5", [2, 3]),
        ("mode == cool and unit < 2", [1]),
        ("mode == heat", []),
    ):
        done = qlinkgen("decode", schema, "--where", condition, *wire)
        assert [json.loads(line)["unit"] for line in done.lines] == nodes
