"""`qlinkgen show`: prints all facts of a protocol, and does not wrap lines in a pipe."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from qlinkgen.cli.plan_text import show_message_plan
from qlinkgen.plan import plan_of
from qlinkgen.schema import load
from tests.cli.conftest import Run

ROOT = Path(__file__).resolve().parents[2]
SCHEMAS = sorted([*(ROOT / "schemas").glob("*.yaml"), *(ROOT / "tests" / "schemas").glob("*.yaml")])


@pytest.mark.parametrize("protocol", ["qlink", "trio", "mc1231a"])
def test_a_protocol(qlinkgen: Run, protocol: str) -> None:
    result = qlinkgen("show", protocol)
    assert result.code == 0
    assert result.err == ""
    assert protocol in result.lines[0]
    assert "\x1b" not in result.out


def test_the_commands_of_qlink(qlinkgen: Run) -> None:
    out = qlinkgen("show", "qlink").out
    (motion,) = [line.split() for line in out.splitlines() if line.startswith("0x20")]
    assert motion == [
        "0x20",
        "motion",
        "2..26",
        "9",
        "61",
        "+",
        "27",
        "one",
        "node",
        "3",
        "byte",
        "times",
        "by",
        "counter",
        "7.10",
    ]
    assert "crc-16/ibm-3740 over length, command, node, data" in out
    assert "a byte 00 is inserted after every A5" in out


def test_the_command_shows_both_messages(qlinkgen: Run) -> None:
    out = qlinkgen("show", "qlink", "motion").out
    assert "motion.request, id 0x20" in out
    assert "motion.response, id 0x20" in out
    assert "payload 9 bytes, frame 16, on the wire at most 27, node 1..16" in out
    (position,) = [line for line in out.splitlines() if "position  " in line and "i32" in line]
    assert position.split()[:4] == ["2", "position", "4", "i32"]
    assert "encoder counts" in position
    (counter,) = [line for line in out.splitlines() if line.endswith("= request.counter")]
    assert counter.split()[:2] == ["0", "counter"]
    assert "|  +-- running: The motor runs" in out


def test_a_message_alone(qlinkgen: Run) -> None:
    out = qlinkgen("show", "trio", "direct_variable_transfer").out
    assert "1/2^32" in out
    assert "-2147483648..2147483647.99999999976716935634613037109375" in out


def test_unconfirmed_is_marked_and_announced(qlinkgen: Run) -> None:
    result = qlinkgen("show", "mc1231a", "get_vel")
    assert "unconfirmed" in result.out
    assert "warning: get_vel.request is unconfirmed" in result.err
    (row,) = [line for line in qlinkgen("show", "mc1231a").lines if line.startswith("0x4B ")]
    assert row.endswith("unconfirmed")


def test_bits_counts_and_steps_of_an_own_schema(qlinkgen: Run, thermo: Path) -> None:
    out = qlinkgen("show", thermo, "get_log.response").out
    assert "items of samples" in out
    assert "i16 little[0..8, by count]" in out
    assert "  7  6  5  4  3  2  1  0" in out
    assert "+-- heating" in out
    out = qlinkgen("show", thermo, "set_target").out
    assert "-40..85" in out
    assert "1/100" in out
    assert "degC" in out


def test_defaults_that_there_are(qlinkgen: Run, thermo: Path) -> None:
    """A required value has no default, although vectors use one."""
    fields = {
        "free": ("u8", "0"),
        "given": ("{type: u8, default: 7}", "7"),
        "bounded": ("{type: u8, range: 5..9}", "required"),
        "scaled": ("{type: i16, scale: 1/10, range: 1..20}", "required"),
        "list": ('"u8[2..4]"', "required"),
        "some": ('"u8[0..4]"', "none"),
        "blob": ('"bytes[3]"', "required"),
        "filled": ('{type: "bytes[2]", default: "0102"}', "0102"),
        "word": ('"text[1..4]"', "required"),
        "fixed": ("{type: u8, const: 3}", ""),
        "spare": ("{type: u8, reserved: true}", ""),
        "low": ("{type: u8, bits: {inner: {at: 0..3, range: 2..5}}}", ""),
    }
    text, out, at = thermo.read_text(), [""], 0
    for name, (kind, default) in fields.items():
        thermo.write_text(text.replace("request: {first: u8}", f"request: {{{name}: {kind}}}"))
        out = qlinkgen("show", thermo, "get_log.request").lines
        (head,) = [line for line in out if line.startswith("offset")]
        row = next(line for line in out if line.split()[1:2] == [name])
        at = head.index("default") if "default" in head else len(row)
        assert row[at:].split("  ")[0].strip() == default, (name, out)
    row = next(line for line in out if line.split()[1:2] == ["inner"])
    assert row[at:].strip() == "required"


def test_unknown_names(qlinkgen: Run) -> None:
    result = qlinkgen("show", "qlink", "moton")
    assert result.code == 2
    assert "no message 'moton'; did you mean motion" in result.err
    assert "is not answered" in qlinkgen("show", "qlink", "node_sync.response").err
    result = qlinkgen("show", "qlnk")
    assert result.code == 2
    assert "did you mean 'qlink'?" in result.err


def test_no_allowance_is_no_time(qlinkgen: Run, thermo: Path) -> None:
    thermo.write_text(thermo.read_text().replace(", response_within: 5 ms", ""))
    result = qlinkgen("show", thermo, "set_target")
    assert result.code == 0, result.err
    assert "no time" not in result.out
    assert "answered" in result.out


@pytest.mark.parametrize("path", SCHEMAS, ids=lambda path: path.stem)
def test_the_plan_of_everything(qlinkgen: Run, path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It lists every part and every step, and is deterministic."""
    plan = plan_of(load(path))
    out = qlinkgen("show", path, "--plan").out
    assert out == qlinkgen("show", path, "--plan").out
    words = set(out.split())
    assert words >= {part.name for frame in plan.frames.values() for part in frame.envelope.parts}
    assert words >= {message.name for message in plan.messages}
    for message in plan.messages:
        show_message_plan(plan, message)
        shown = set(capsys.readouterr().out.split())
        assert shown >= {step.name for step in message.payload.steps}
        assert shown >= {each.name for each in message.payload.settable}


def test_the_plan_of_a_frame_and_of_its_strategy(qlinkgen: Run) -> None:
    out = qlinkgen("show", "qlink", "--plan").out
    assert "Receiver: hunt; A5 A5 does not occur inside a frame" in out
    assert "End: the payload has length - 4 bytes" in out
    assert "Receiver: marks; " in qlinkgen("show", "trio", "--plan").out
    assert "Receiver: in step; " in qlinkgen("show", "mc1231a", "--plan").out


def test_the_plan_of_a_message(qlinkgen: Run) -> None:
    out = qlinkgen("show", ROOT / "tests/schemas/kitchen_sink.yaml", "--plan", "open_end.request").out
    assert "1. samples: (payload size - 4) / 3, 0..20" in out
    assert "2. the payload has 4 + 3*samples bytes" in out
    steps = [line.split() for line in out.splitlines()]
    assert ["1", "3*samples", "samples", "items", "i24", "little[0..20]"] in steps
    assert ["1", "+", "3*samples", "3", "1", "mark", "constant", "u8", "85"] in steps


def test_the_command_line_does_not_ask_for_the_kind_of_a_field() -> None:
    kinds = {"Scalar", "Bits", "Blob", "Array", "DelimitedFrame", "MarkedFrame", "PacketFrame"}
    for path in (ROOT / "qlinkgen" / "cli").glob("*.py"):
        names = {
            node.id for node in ast.walk(ast.parse(path.read_text("utf-8"))) if isinstance(node, ast.Name)
        }
        assert not names & kinds, path


def test_frames_of_the_document(qlinkgen: Run) -> None:
    out = qlinkgen("show", "modbus_rtu", "read_holding_registers.request").out
    assert "Frames of the document\n11 03 00 6B 00 03 76 87\n" in out
    assert "Frames of the document" not in qlinkgen("show", "qlink", "motion").out
