"""Reading a schema and using its protocol executes no text of the schema, as an audit hook shows."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.texts.samples import HARMLESS, HOSTILE
from tests.texts.slots import SCHEMAS, put, slots, text_of

AUDITED = Path(__file__).with_name("audited.py")
#: Modules of the standard library that qlinkgen does not need; they print, or open a browser.
NAMES = ("antigravity", "this", "__hello__", "turtledemo")
FRAMES = {
    "delimited": "a5a50e0103010000000700000000000000000000400c",
    "marked": "9205007a6290",
    "packet": "10000a",
    "several": "10010304",
}
MESSAGES = {
    "delimited": ("measure", "--node", "3", "speed=7"),
    "marked": ("set", "--address", "2", "value=5"),
    "packet": ("set_speed", "speed=9"),
    "several": ("look", "--node", "3"),
}


def audited(word: str, commands: list[list[str]], folder: Path) -> dict[str, Any]:
    """The forbidden events of the commands, and their exit codes."""
    (folder / "commands.json").write_text(json.dumps(commands), "utf-8")
    done = subprocess.run(
        [sys.executable, AUDITED, ",".join(NAMES), word, "commands.json"],
        cwd=folder,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    found: dict[str, Any] = json.loads(done.stderr.rpartition("\n")[2])
    return found


def commands_of(name: str, path: str) -> list[list[str]]:
    return [
        ["lint", path],
        ["show", path],
        ["show", path, MESSAGES[name][0]],
        ["encode", path, *MESSAGES[name]],
        ["decode", path, FRAMES[name]],
        ["explain", path, FRAMES[name]],
    ]


@pytest.mark.parametrize("name", SCHEMAS)
def test_hostile_texts_run_nothing(name: str, tmp_path: Path) -> None:
    texts = [*HOSTILE, *(f"{text}\nimport {name}" for text, name in zip(HOSTILE, NAMES * 9, strict=False))]
    (tmp_path / "hostile.yaml").write_text(text_of(put(name, slots(name), texts)), "utf-8")
    found = audited("canary", commands_of(name, "hostile.yaml"), tmp_path)
    assert found == {"codes": [0, 0, 0, 0, 0, 0], "seen": []}
    assert {path.name for path in tmp_path.iterdir()} == {"commands.json", "hostile.yaml"}


def test_names_of_a_schema_are_not_imported(tmp_path: Path) -> None:
    text = text_of(put("delimited", slots("delimited"), HARMLESS))
    for old, new in (("name: delimited", "name: turtledemo"), ("measure:", "antigravity:")):
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "turtledemo.yaml").write_text(text, "utf-8")
    (tmp_path / "turtledemo.py").write_text("open('canary', 'w').close()\n", "utf-8")
    commands = [
        [word.replace("measure", "antigravity") for word in each]
        for each in commands_of("delimited", "turtledemo.yaml")
    ]
    found = audited("canary", commands, tmp_path)
    assert found == {"codes": [0, 0, 0, 0, 0, 0], "seen": []}
    assert not (tmp_path / "canary").exists()


def test_the_hook_detects_execution(tmp_path: Path) -> None:
    found = audited(
        "PREAMBLE",
        [["generate", "qlink", "--target", "c", "-o", "made"], ["decode", "qlink", "a5"]],
        tmp_path,
    )
    events = {each.partition(" ")[0] for each in found["seen"]}
    assert {"open", "os.mkdir", "compile"} <= events
