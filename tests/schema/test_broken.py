"""A deliberately broken file for every rule, with its exact messages.

After a change of wording, `UPDATE_EXPECTED=1 pytest tests/schema/test_broken.py` updates the expected texts;
review their diff from the user's point of view.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from qlinkgen.schema import lint
from qlinkgen.schema.rules import RULES

FOLDER = Path(__file__).with_name("broken")
FILES = sorted(FOLDER.glob("*.yaml"))
LINE = re.compile(
    r"[\w.-]+\.yaml:\d+:\d+: (error|warning)\[(?P<rule>[a-z-]+)\]: (?P<what>[^;]+)(; (?P<hint>.+))?"
)
#: Not possible with a file of the folder; see test_robust.
WITHOUT_FILE = {"file-unreadable"}


def rule_of(path: Path) -> str:
    return path.name.split(".")[0]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_message(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(FOLDER)
    said = "".join(f"{fault}\n" for fault in lint(path.name))
    expected = path.with_suffix(".txt")
    if os.environ.get("UPDATE_EXPECTED"):
        expected.write_text(said, encoding="utf-8")
    assert said == expected.read_text(encoding="utf-8")
    assert rule_of(path) in said


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_message_has_the_error_and_the_fix(path: Path) -> None:
    for line in path.with_suffix(".txt").read_text(encoding="utf-8").splitlines():
        match = LINE.fullmatch(line)
        assert match, line
        assert match["rule"] in RULES
        assert match["hint"], f"no hint: {line}"


def test_every_rule_has_a_file() -> None:
    assert {rule_of(path) for path in FILES} == set(RULES) - WITHOUT_FILE


def test_every_expected_text_has_a_schema() -> None:
    assert {path.stem for path in FOLDER.glob("*.txt")} == {path.stem for path in FILES}
