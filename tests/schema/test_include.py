"""A schema that includes another is the same as one file."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from qlinkgen.errors import SchemaError
from qlinkgen.model.protocol import Protocol
from qlinkgen.schema import find, lint, load
from qlinkgen.schema.including import GROUPS
from tests.python.protocols import EVERY, SHIPPED, text_of


def divided(text: str, folder: Path) -> Path:
    """Write a schema as two files; returns the one that includes the other."""
    head, *blocks = re.split(r"^(?=\w+:)", text, flags=re.MULTILINE)
    inside = [block for block in blocks if block.partition(":")[0] in GROUPS]
    outside = [block for block in blocks if block not in inside]
    (folder / "parts").mkdir()
    (folder / "parts/other.yaml").write_text("".join(inside), "utf-8")
    file = folder / "whole.yaml"
    file.write_text(head + "".join([outside[0], "include: parts/other.yaml\n", *outside[1:]]), "utf-8")
    return file


def same_but_for_files(one: Protocol, other: Protocol) -> bool:
    return replace(one, schema_hash="", schema_file="", includes="") == replace(
        other, schema_hash="", schema_file="", includes=""
    )


@pytest.mark.parametrize("name", EVERY)
def test_a_file_can_be_divided(name: str, tmp_path: Path) -> None:
    text = find(name).read_text("utf-8") if name in SHIPPED else text_of(name)
    whole = tmp_path / "one.yaml"
    whole.write_text(text, "utf-8")
    file = divided(text, tmp_path)
    assert same_but_for_files(load(file), load(whole))
    assert load(file).includes == "parts/other.yaml"
    before = load(file).schema_hash
    with (tmp_path / "parts/other.yaml").open("a") as other:
        other.write("# more\n")
    assert load(file).schema_hash != before


@pytest.fixture
def pair(tmp_path: Path) -> tuple[Path, Path]:
    file = divided(text_of("modbus_rtu"), tmp_path)
    return file, tmp_path / "parts/other.yaml"


def test_keys_of_the_file_replace_those_of_the_other(pair: tuple[Path, Path]) -> None:
    file, _ = pair
    before = load(file)
    change = "commands:\n  read_input_registers: {repeat: unsafe, section: '9.9'}\n"
    file.write_text(file.read_text("utf-8") + change, "utf-8")
    commands = {command.name: command for command in load(file).commands}
    assert [*commands] == [command.name for command in before.commands]
    changed = commands["read_input_registers"]
    assert (changed.repeat.safe, changed.section) == (False, "9.9")
    assert changed.request.fields == before.message("read_input_registers").fields


def test_a_fault_in_the_other_file_names_it(pair: tuple[Path, Path]) -> None:
    file, other = pair
    text = other.read_text("utf-8")
    other.write_text(text.replace("value: {type: u16,", "value: {type: u15,", 1), "utf-8")
    line = 1 + text[: text.index("value: {type: u16,")].count("\n")
    faults = [fault for fault in lint(file) if fault.severity == "error"]
    assert [(fault.file, fault.line) for fault in faults] == [(str(other), line)]


def test_examples_are_frames_of_the_other_protocol(pair: tuple[Path, Path]) -> None:
    file, other = pair
    text = other.read_text("utf-8")
    example = "    examples: [{wire: 00 00, request: {}}]\n"
    text = text.replace("  read_holding_registers:\n", f"  read_holding_registers:\n{example}", 1)
    other.write_text(text, "utf-8")
    assert load(file).examples == ()


def test_a_syntax_error_in_the_other_file_is_one(pair: tuple[Path, Path]) -> None:
    file, other = pair
    other.write_text("commands: {\n", "utf-8")
    with pytest.raises(SchemaError) as caught:
        load(file)
    assert str(other) in {fault.file for fault in caught.value.faults}
