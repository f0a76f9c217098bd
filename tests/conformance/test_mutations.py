"""A header with one error fails in exactly the tests of that error."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.conformance import kits
from tests.conformance.conftest import Write


class Mistake(NamedTuple):
    """Text of a header, its wrong replacement, and the messages and verbs that must fail."""

    name: str
    right: str
    wrong: str
    messages: set[str]
    verbs: set[str]


SETUP = {"node_setup.request"}
MISTAKES = {
    "an offset": Mistake(
        "qlink",
        "message->t1_delay = payload[1];",
        "message->t1_delay = payload[2];",
        SETUP,
        {"decode", "receive", "ask"},
    ),
    "a range": Mistake(
        "qlink",
        "(message->node_number > 16U)",
        "(message->node_number > 17U)",
        SETUP,
        {"decode", "receive", "ask", "refuse"},
    ),
    "an address": Mistake(
        "trio",
        "((address >= 1U) && (address <= 15U)) ? trio_wrap_(",
        "((address >= 1U) && (address <= 16U)) ? trio_wrap_(",
        {"character_transfer", "direct_variable_transfer", "keypad_offset", "keypad_mode"},
        {"refuse"},
    ),
    "the wrong handler": Mistake(
        "qlink",
        "qlink_slave_set_outputs_(slave, frame, wire, capacity);",
        "qlink_slave_clear_outputs_(slave, frame, wire, capacity);",
        {"set_outputs.request"},
        {"ask"},
    ),
    "a function not called": Mistake(
        "qlink", "master->motion != NULL", "master->motion == NULL", {"motion.response"}, {"tell"}
    ),
    "the end of another": Mistake(
        "trio",
        "((end_byte ^ byte) & 0x78U) != 0U",
        "((end_byte ^ byte) & 0x70U) != 0U",
        {"character_transfer", "direct_variable_transfer", "keypad_offset", "keypad_mode"},
        {"receive"},
    ),
    "a shift": Mistake(
        "trio",
        "at[1] = (uint8_t)((value >> 7) & 0x7FU);",
        "at[1] = (uint8_t)((value >> 8) & 0x7FU);",
        {"direct_variable_transfer"},
        {"encode"},
    ),
}


def run_with(mistake: Mistake, kit: Write, folder: Path, compiler: str) -> kits.Report:
    header = kit(mistake.name).with_name(f"{mistake.name}.h").read_text()
    assert mistake.right in header, "the header reads otherwise now: plant the mistake anew"
    (folder / f"{mistake.name}.h").write_text(header.replace(mistake.right, mistake.wrong))
    file = shutil.copy(kit(mistake.name), folder)
    return kits.ran(kits.compiled(folder / "kit", compiler, "-std=c99", "-O0", kits.STDIO, file))


@pytest.mark.parametrize("what", MISTAKES)
def test_a_mistake_is_found(what: str, kit: Write, tmp_path: Path, require_tool: Callable[..., str]) -> None:
    mistake = MISTAKES[what]
    report = run_with(mistake, kit, tmp_path, require_tool("clang", package="clang"))
    assert report.status == 1
    assert len(report.names) == report.planned
    failed = report.failed
    assert {each.split(" ")[0] for each in failed} == mistake.messages
    assert {each.rsplit(" ", 1)[1] for each in failed} == mistake.verbs


def test_another_polynomial_is_found_first(
    kit: Write, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    lines = kit("trio").with_name("trio.h").read_text().splitlines()
    chosen = next(line.split()[2] for line in lines if line.startswith("#define TRIO_CRC TRIO_CRC_"))
    (right,) = (line for line in lines if line.startswith(f"#define {chosen} "))
    assert "(0x1021U" in right
    mistake = Mistake("trio", right, right.replace("(0x1021U", "(0x1023U"), set(), set())
    report = run_with(mistake, kit, tmp_path, require_tool("clang", package="clang"))
    assert report.status == 1
    assert report.failed[0].startswith("check value ")
    assert report.diagnoses[0].splitlines()[1].startswith("  expected: 0x")
    # Messages without a check value are unaffected.
    assert {each.split(" ")[0] for each in report.failed} == {"check", "direct_variable_transfer"}


def test_a_diagnosis_has_the_expected_and_the_actual_result(
    kit: Write, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    report = run_with(MISTAKES["an offset"], kit, tmp_path, require_tool("clang", package="clang"))
    told = {each.splitlines()[0]: each.splitlines()[1:] for each in report.diagnoses}
    assert told["node_setup.request random1 decode"] == [
        '  expected: "0281eff7"',
        '  got: "02efeff7"',
        "  expected_node: 15",
        "  got_node: 15",
        "  returned: 0",
        "  ...",
    ]


def test_a_kit_that_stops_early_does_not_pass() -> None:
    text = "TAP version 14\n1..3\nok 1 - a b encode\nok 2 - a b decode\n"
    with pytest.raises(AssertionError):
        kits.report(0, text).check()
    with pytest.raises(AssertionError):
        kits.report(0, text.replace("ok 2", "ok 3"))
    with pytest.raises(AssertionError):
        kits.report(0, text.replace("ok 2", "not ok 2"))
