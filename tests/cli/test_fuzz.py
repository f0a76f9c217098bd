"""`qlinkgen fuzz`: what it finds in devices with known faults, on a line with a virtual clock."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from qlinkgen.backends.python import load
from qlinkgen.cli.fuzz_cases import DAMAGED, VALID, WRONG, Case, Cases
from qlinkgen.cli.fuzz_run import PROBES
from qlinkgen.link import SlaveEngine
from qlinkgen.link.codec import is_message
from qlinkgen.plan import plan_of
from qlinkgen.schema import load as load_schema
from qlinkgen.sim import Wire
from qlinkgen.sim.generic import GenericNode
from tests.cli.conftest import OnLine, Run
from tests.cli.wire import REPOSITORY, objects

#: Values with ranges, refusals, a check value, and an unsafe command.
SCHEMA = REPOSITORY / "tests" / "schemas" / "answers.yaml"
ASKED = ("--node", "3", "--command", "read", "--command", "write")


@pytest.fixture(scope="module")
def codec() -> Any:
    return load(load_schema(SCHEMA))


class Faulty(SlaveEngine):
    """A node with a fault between the line and its receiver."""

    def __init__(self, codec: Any, fault: Callable[[Faulty, bytes], bytes]) -> None:
        super().__init__(codec, GenericNode(codec, 3), turnaround=0.002, baud=19200)
        self.codec, self.fault, self.seen = codec, fault, 0

    def receive(self, data: bytes, now: float) -> None:
        self.seen += 1
        super().receive(self.fault(self, data), now)


def mend(node: Faulty, data: bytes) -> bytes:
    """Compute the check value anew: the one received does not matter."""
    node.seen += 1
    register = 0xFFFF
    for byte in data[1:-2]:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ 0xA001 * (register & 1)
    return data[:-2] + register.to_bytes(2, "big")


def fuzz(
    qlinkgen: Run, on_line: OnLine, codec: Any, fault: Callable[[Faulty, bytes], bytes], *words: str
) -> tuple[int, list[dict[str, Any]]]:
    wire = Wire(baud=19200, chunks="frame")
    wire.attach(Faulty(codec, fault))
    result = qlinkgen("fuzz", SCHEMA, on_line(wire), *ASKED, "--json", *words)
    assert result.err == ""
    return result.code, objects(result.out)


def test_a_device_in_order(qlinkgen: Run, on_line: OnLine, codec: Any) -> None:
    code, (summary,) = fuzz(qlinkgen, on_line, codec, lambda _, data: data)
    assert code == 0
    assert (summary["cases"], summary["findings"]) == (500, 0)
    results = summary["results"]
    assert set(results) == {"valid answered", "wrong silent", "damaged silent"}
    assert min(results.values()) > 100


def test_a_check_value_that_nobody_looks_at(qlinkgen: Run, on_line: OnLine, codec: Any) -> None:
    code, (*findings, summary) = fuzz(qlinkgen, on_line, codec, mend, "--count", "100")
    assert code == 1
    assert summary["findings"] == len(findings) > 5
    assert {each["finding"] for each in findings} == {"accepted"}
    assert any("crc" in each["what"] for each in findings if each["kind"] == "wrong")
    assert any("is flipped" in each["what"] for each in findings if each["kind"] == "damaged")
    again, (*once, _) = fuzz(qlinkgen, on_line, codec, mend, "--case", str(findings[0]["case"]))
    assert (again, once) == (1, findings[:1])


def test_a_device_that_hangs(qlinkgen: Run, on_line: OnLine, codec: Any) -> None:
    def hang(node: Faulty, data: bytes) -> bytes:
        node.hung = getattr(node, "hung", False) or len(data) > 9  # type: ignore[attr-defined]
        return b"" if node.hung else data  # type: ignore[attr-defined]

    code, (*findings, summary) = fuzz(qlinkgen, on_line, codec, hang)
    assert code == 1
    assert [each["finding"] for each in findings] == ["lost"]
    assert len(bytes.fromhex(findings[0]["frame"])) > 9
    assert summary["cases"] == findings[0]["case"] + 1


def test_a_device_that_is_slow_to_recover(qlinkgen: Run, on_line: OnLine, codec: Any) -> None:
    """It misses two requests after each frame that is none."""

    def sulk(node: Faulty, data: bytes) -> bytes:
        decoder = codec.StreamDecoder("request")
        left = getattr(node, "left", 0)
        node.left = left - 1 if left else 0 if any(map(is_message, decoder.feed(data))) else 2  # type: ignore[attr-defined]
        return b"" if left else data

    code, (summary,) = fuzz(qlinkgen, on_line, codec, sulk, "--count", "100")
    results = summary["results"]
    assert (code, summary["slow"]) == (0, results["wrong silent"] + results["damaged silent"])


def test_silence(qlinkgen: Run, on_line: OnLine, codec: Any) -> None:
    def deaf(node: Faulty, data: bytes) -> bytes:
        return b"" if data[2:3] == b"\x03" and data[4:5] > b"\xc8" else data  # a write of a large number

    _, (*findings, _) = fuzz(qlinkgen, on_line, codec, deaf, "--count", "100")
    assert {(each["finding"], each["kind"], each["command"]) for each in findings} == {
        ("silent", "valid", "write")
    }


def frames(codec: Any, *, everything: bool, seed: int = 1) -> list[Case]:
    protocol = load_schema(SCHEMA)
    commands = [each for each in protocol.commands if each.name in {"read", "write"}]
    cases = Cases(plan_of(protocol), codec, commands, 3, seed, everything=everything)
    return [cases.draw(number) for number in range(400)]


def test_the_frames_depend_on_the_seed_alone(codec: Any) -> None:
    found = frames(codec, everything=False)
    assert found == frames(codec, everything=False)
    assert found != frames(codec, everything=False, seed=2)
    assert {each.kind for each in found} == {VALID, WRONG, DAMAGED}


def test_only_the_given_commands_are_sent(codec: Any) -> None:
    """The number of the command is the third byte; only frames that are cut do not have it."""
    assert {each.wire[2] for each in frames(codec, everything=False) if len(each.wire) > 2} == {1, 3}
    assert len({each.wire[2] for each in frames(codec, everything=True) if len(each.wire) > 2}) > 3


@pytest.mark.parametrize(
    ("words", "code", "text"),
    [
        (("qlink", "x"), 2, "--node: no device is given; nodes are 1..16"),
        (("qlink", "x", "--node", "17"), 2, "--node: 17 is not a node; nodes are 1..16"),
        (("qlink", "x", "--node", "3", "--command", "motion_"), 2, "did you mean motion?"),
        (("qlink", "x", "--node", "3", "--command", "motor_request"), 2, "add --all to use it"),
        (("trio", "x"), 2, "fuzz requires a bus with a master"),
        (("vesc", "x", "--node", "3"), 2, "vesc has no address in its frame"),
        (("qlink", "/dev/not-there", "--node", "3"), 1, "does not exist"),
    ],
)
def test_refused(qlinkgen: Run, words: tuple[str, ...], code: int, text: str) -> None:
    result = qlinkgen("fuzz", *words)
    assert (result.code, result.out) == (code, "")
    assert text in result.err


def test_nobody_is_there(qlinkgen: Run, on_line: OnLine) -> None:
    wire, sent = Wire(baud=19200), []
    wire.taps.append(lambda _at, _source, data: sent.append(data))
    result = qlinkgen("fuzz", SCHEMA, on_line(wire), "--node", "3")
    assert (result.code, result.out) == (1, "")
    assert "the device does not answer " in result.err
    assert len(b"".join(sent)) <= PROBES * 8  # and not those that fill the longest frame twice
