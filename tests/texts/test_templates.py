"""Templates are compiled once, not in each run."""

from __future__ import annotations

import importlib.resources
import sys
from collections.abc import Callable
from pathlib import Path

import jinja2
import pytest

from qlinkgen.backends import templates

Rendered = Callable[[], str]


@pytest.fixture
def compilations(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the templates compiled from now on."""
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    names: list[str] = []
    usual = jinja2.Environment.compile

    def compile_(self: jinja2.Environment, source: str, name: str, filename: str | None = None) -> object:
        names.append(name)
        return usual(self, source, name, filename)

    monkeypatch.setattr(jinja2.Environment, "compile", compile_)
    return names


@pytest.fixture
def rendered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Rendered:
    """Render a template in a package of its own, as a new run would."""
    folder = tmp_path / "backend"
    (folder / "templates").mkdir(parents=True)
    (folder / "templates" / "one.py.j2").write_text("{% for n in range(3) %}\n{{ n }}\n{% endfor %}\n")
    monkeypatch.setattr(importlib.resources, "files", lambda _package: folder)
    return lambda: templates.environment("backend").get_template("templates/one.py.j2").render()


def kept(tmp_path: Path) -> list[Path]:
    return list(tmp_path.rglob("*.pyc"))


def test_a_template_is_compiled_once(rendered: Rendered, compilations: list[str], tmp_path: Path) -> None:
    assert [rendered() for _ in range(3)] == ["0\n1\n2\n"] * 3
    assert compilations == ["templates/one.py.j2"]
    (file,) = kept(tmp_path)
    assert file.parent == tmp_path / "backend" / "templates" / "__pycache__"


def test_a_changed_template_is_compiled_again(
    rendered: Rendered, compilations: list[str], tmp_path: Path
) -> None:
    rendered()
    (tmp_path / "backend" / "templates" / "one.py.j2").write_text("new")
    assert (rendered(), rendered()) == ("new", "new")
    assert len(compilations) == 2


def test_other_settings_or_versions_are_compiled_again(
    rendered: Rendered, compilations: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rendered()
    monkeypatch.setattr(templates, "_jinja", lambda: "99")
    rendered()
    monkeypatch.setitem(templates._SETTINGS, "trim_blocks", False)
    assert rendered() == "\n0\n\n1\n\n2\n\n"
    assert len(compilations) == len(kept(tmp_path)) == 3


@pytest.mark.parametrize("damage", [b"", b"nonsense", None])
def test_a_damaged_file_is_replaced(
    rendered: Rendered, compilations: list[str], tmp_path: Path, damage: bytes | None
) -> None:
    rendered()
    (file,) = kept(tmp_path)
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2] if damage is None else damage)
    assert (rendered(), rendered()) == ("0\n1\n2\n",) * 2
    assert len(compilations) == 2
    assert file.read_bytes() == whole


def test_a_folder_that_cannot_be_written_is_left_alone(
    rendered: Rendered, compilations: list[str], tmp_path: Path
) -> None:
    (tmp_path / "backend" / "templates" / "__pycache__").write_text("in the way")
    assert (rendered(), rendered()) == ("0\n1\n2\n",) * 2
    assert len(compilations) == 2
    assert kept(tmp_path) == []


def test_nothing_is_written_where_python_writes_nothing(
    rendered: Rendered, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    rendered()
    assert kept(tmp_path) == []
