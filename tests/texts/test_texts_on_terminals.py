"""Control characters of files are not printed to a terminal; ordinary texts are printed unchanged."""

from __future__ import annotations

import dataclasses
import re
import sys
from collections.abc import Callable
from pathlib import Path
from types import MappingProxyType
from typing import Any

import pytest

from qlinkgen.cli import cli
from qlinkgen.cli.boundary import run
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.texts import CONTROL
from tests.texts.samples import ORDINARY, TEXTS
from tests.texts.slots import SCHEMAS, protocol_of, put, slots, text_of

EVIL = "\x1b]0;owned\x07\x1b[31m\u202e\x9b2J\x00\x7f"
FRAMES = {"delimited": "a5a5010100", "marked": "89a5", "packet": "10000a", "several": "10010304"}
Run = Callable[..., str]


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """Return a function that runs the command line and returns its output."""
    monkeypatch.delenv("FORCE_COLOR", raising=False)
    monkeypatch.setenv("NO_COLOR", "1")

    def call(*arguments: str | Path) -> str:
        monkeypatch.setattr(sys, "argv", ["qlinkgen", *map(str, arguments)])
        run(cli)
        captured = capsys.readouterr()
        assert "Traceback" not in captured.err
        return captured.out + captured.err

    return call


def with_evil(node: Any) -> Any:
    """A model whose texts all have control characters, which cannot be created by a schema."""
    if isinstance(node, str):
        return node.replace("MARK", f"MARK{EVIL}")
    if isinstance(node, tuple):
        return tuple(map(with_evil, node))
    if isinstance(node, MappingProxyType | dict):
        return {key: with_evil(each) for key, each in node.items()}
    if dataclasses.is_dataclass(node) and not isinstance(node, type):
        fields = [each.name for each in dataclasses.fields(node) if each.init]
        return dataclasses.replace(node, **{name: with_evil(getattr(node, name)) for name in fields})
    return node


def evil(name: str) -> Protocol:
    found = with_evil(protocol_of(name, "MARK", default="MARK", file="MARK.yaml"))
    assert isinstance(found, Protocol)
    return found


@pytest.mark.parametrize("name", SCHEMAS)
def test_show_and_explain(name: str, said: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    protocol = evil(name)
    for module in ("show", "explain", "encode"):
        monkeypatch.setattr(f"qlinkgen.cli.{module}.load_protocol", lambda *_, **__: protocol)
    texts = [said("show", name), *(said("show", name, message.name) for message in protocol.messages)]
    texts.append(said("explain", name, FRAMES[name]))
    assert sum("MARK" in text for text in texts) > 1
    for text in texts:
        assert not CONTROL.search(text)


def test_a_unit_in_the_error_of_an_encoder(said: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("qlinkgen.cli.encode.load_protocol", lambda *_, **__: evil("delimited"))
    text = said("encode", "delimited", "measure", "--node", "1", "speed=1001")
    assert "0..1000 MARK" in text
    assert not CONTROL.search(text)


@pytest.mark.parametrize("name", SCHEMAS)
def test_lint_and_whatever_reads_a_schema(name: str, said: Run, tmp_path: Path) -> None:
    path = tmp_path / "a\x1b[31mb\u202ec.yaml"
    path.write_text(text_of(put(name, slots(name), EVIL)), "utf-8")
    for command in (["lint"], ["show"], ["explain"], ["generate"]):
        text = said(*command, path, *([FRAMES[name]] if command == ["explain"] else []))
        assert "control-character" in text
        assert not CONTROL.search(text)


@pytest.mark.parametrize(
    "extra", [("lint", "{}"), ("show", "{}"), ("decode", "qlink", "{}"), ("lint", "--{}"), ("{}",)]
)
def test_arguments(extra: tuple[str, ...], said: Run) -> None:
    text = said(*(word.format(f"x{EVIL.replace(chr(0), '')}.yaml") for word in extra))
    assert text
    assert not CONTROL.search(text)


def test_drift_of_a_file(said: Run, tmp_path: Path) -> None:
    said("generate", "trio", "--target", "c", "-o", tmp_path)
    path = tmp_path / "c" / "trio.h"
    path.write_text(path.read_text("utf-8") + f"/* {EVIL} */\n", "utf-8")
    text = said("generate", "trio", "--target", "c", "-o", tmp_path, "--check")
    assert "x1b" in text
    assert not CONTROL.search(text)


def test_text_on_the_wire_is_escaped(said: Run) -> None:
    text = said("decode", "trio", "89" + "1b" + "5b" + "7f" + "07" + "88")
    assert r"\u001b[\u007f\u0007" in text
    assert not CONTROL.search(text)


@pytest.mark.parametrize("text", TEXTS)
def test_colours_do_not_change_a_text(text: str, said: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR")
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "2000")
    monkeypatch.setattr("qlinkgen.cli.show.load_protocol", lambda *_, **__: protocol_of("delimited", text))
    shown = re.sub(r"\x1b\[[0-9;]*m", "", said("show", "delimited"))
    words = re.sub(r"\s", "", text)
    assert re.sub(r"\s", "", shown).count(words) >= 10
    assert not CONTROL.search(shown)


def test_samples_are_ordinary() -> None:
    assert not [text for text in ORDINARY if CONTROL.search(text)]
