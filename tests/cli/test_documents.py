"""Tests the examples in README and docs: commands print the output shown, files compile, excerpts match.

* ``<!-- file: NAME -->`` before a block: the block is that file.
* ```` ```console ````: lines after ``$`` are run by bash in one folder, and the following lines are their
  output; a line ``...`` matches any lines, and ``…`` in a line any characters.
* ``<!-- background: NAME -->`` before a console block: its command runs until the document ends, and the
  lines below are its first output.
* ```` ```pycon ````: run as a doctest.
* ``<!-- excerpt: PATH -->`` before a block: an excerpt of the file of that path, ``...`` for omitted lines.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.cli.conftest import Run

REPOSITORY = Path(__file__).resolve().parents[2]
DOCUMENTS = [
    "README.md",
    "docs/tutorial.md",
    "docs/cli.md",
    "docs/captures.md",
    "docs/library.md",
    "docs/import.md",
    "docs/plan.md",
    "docs/quick-start.md",
    "docs/write-a-slave.md",
    "docs/write-a-master.md",
    "docs/stream-motion.md",
    "docs/load-firmware.md",
    "docs/own-io.md",
    "docs/platforms.md",
    "docs/dialogues.md",
    "docs/instruments.md",
    "docs/timing.md",
    "docs/mc1231a.md",
    "docs/trio.md",
    "docs/firmware.md",
    "examples/firmware/README.md",
]
MARK = r"(?:^<!-- (?P<mark>\w+): (?P<name>\S+) -->\n)?"
BLOCK = re.compile(MARK + r"^```(?P<kind>\w*)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Block:
    kind: str
    text: str
    mark: str
    name: str


def blocks(document: str) -> list[Block]:
    text = (REPOSITORY / document).read_text("utf-8")
    return [Block(m["kind"], m["text"], m["mark"] or "", m["name"] or "") for m in BLOCK.finditer(text)]


class Shell:
    """Runs commands in one folder; returns standard output and error together."""

    def __init__(self, folder: Path, environment: dict[str, str]) -> None:
        self._options: dict[str, Any] = {
            "cwd": folder,
            "env": environment,
            "stdout": subprocess.PIPE,
            "stderr": subprocess.STDOUT,
            "text": True,
        }
        self._background: list[subprocess.Popen[str]] = []

    def __call__(self, command: str) -> str:
        command_line = ["bash", "-c", command]
        return str(subprocess.run(command_line, check=False, timeout=300, **self._options).stdout)

    def start(self, command: str, lines: int) -> str:
        """Start a command in the background; return its first output."""
        process = subprocess.Popen(["bash", "-c", f"exec {command}"], **self._options)
        self._background.append(process)
        assert process.stdout is not None
        return "".join(process.stdout.readline() for _ in range(lines))

    def end(self) -> None:
        """Stop the background commands."""
        for process in self._background:
            process.terminate()
            process.communicate()


@pytest.fixture
def shell(tmp_path: Path) -> Iterator[Shell]:
    """A shell in an empty folder, with the installed programs on its path."""
    programs = tmp_path / "bin"
    programs.mkdir()
    for name, module in (("qlinkgen", "-m qlinkgen"), ("python3", "")):
        (programs / name).write_text(f'#!/bin/sh\nexec "{sys.executable}" {module} "$@"\n')
        (programs / name).chmod(0o755)
    folder = tmp_path / "work"
    folder.mkdir()
    environment = {
        **os.environ,
        "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(REPOSITORY),
        "QLINKGEN": str(REPOSITORY),
        "PYTEST_ADDOPTS": "",
    }

    shell = Shell(folder, environment)
    yield shell
    shell.end()


def sessions(text: str) -> Iterator[tuple[str, str]]:
    """Command and expected output."""
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        command, _, expected = part.partition("\n")
        while command.endswith("\\"):
            line, _, expected = expected.partition("\n")
            command = f"{command}\n{line}"
        yield command, expected


def matches(expected: str, found: str) -> bool:
    """Whether the output matches; text after ``…`` may be wider than in the document, such as a time."""
    pattern = "".join(
        "(?:.*\n)*" if line == "..." else re.sub(r"(\\ )+…|…", ".*", re.escape(line)) + "\n"
        for line in expected.splitlines()
    )
    return re.fullmatch(pattern, found) is not None


@pytest.mark.parametrize("document", DOCUMENTS)
def test_commands_and_files(
    document: str, shell: Shell, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    commands = " ".join(block.text for block in blocks(document) if block.kind == "console")
    for tool in ("gcc", "cmake"):
        if f"{tool} " in commands:
            require_tool(tool, package=tool)
    for block in blocks(document):
        if block.mark == "file":
            (tmp_path / "work" / block.name).write_text(block.text)
        elif block.kind == "console":
            for command, expected in sessions(block.text):
                if block.mark == "background":
                    found = shell.start(command, expected.count("\n"))
                else:
                    found = shell(command)
                assert matches(expected, found), f"$ {command}\n{found}"


@pytest.mark.parametrize("document", DOCUMENTS)
def test_python_sessions(document: str, shell: Shell, tmp_path: Path) -> None:
    text = "".join(block.text for block in blocks(document) if block.kind == "pycon")
    if text:
        (tmp_path / "work" / "session.txt").write_text(text)
        assert shell("python3 -m doctest -o NORMALIZE_WHITESPACE session.txt") == ""


@pytest.mark.parametrize("document", DOCUMENTS)
def test_excerpts(document: str, qlinkgen: Run, tmp_path: Path) -> None:
    found = [block for block in blocks(document) if block.mark == "excerpt"]
    if found:
        assert qlinkgen("generate", "-o", tmp_path / "generated").code == 0
    for block in found:
        folder = tmp_path if block.name.startswith("generated/") else REPOSITORY
        rest = (folder / block.name).read_text("utf-8")
        for piece in block.text.split("...\n"):
            assert piece in rest, f"{block.name} does not have:\n{piece}"
            rest = rest.partition(piece)[2]


@pytest.mark.parametrize(
    "document",
    sorted(
        {
            *DOCUMENTS,
            "CONTRIBUTING.md",
            "docs/README.md",
            "docs/explain/separators.md",
            "docs/pump-bus.md",
            "docs/receiver.md",
        }
    ),
)
def test_links(document: str) -> None:
    path = REPOSITORY / document
    for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", path.read_text("utf-8")):
        assert (path.parent / target).exists(), target


def test_docstrings_cite_rows_of_the_page_of_q_link() -> None:
    page = (REPOSITORY / "docs/qlink.md").read_text("utf-8")
    rows = set(re.findall(r"^\| ([0-9]+) \|", page, re.MULTILINE))
    sources = [path.read_text("utf-8") for path in (REPOSITORY / "qlinkgen/protocols/qlink").glob("*.py")]
    cited = {number for text in sources for number in re.findall(r"docs/qlink\.md, ([0-9]+)", text)}
    assert cited
    assert cited <= rows
    assert "settled question" not in "".join(sources).lower()


def test_the_tutorial_has_every_frame_of_its_document() -> None:
    document = (REPOSITORY / "docs/pump-bus.md").read_text("utf-8")
    frames = re.findall(r"unit +(55 AA(?: [0-9A-F]{2})+)$", document, re.MULTILINE)
    (schema,) = [block.text for block in blocks("docs/tutorial.md") if block.name == "pump.yaml"]
    assert len(frames) == 4
    assert frames == re.findall(r"wire: ([0-9A-F ]+),", schema)


def test_every_file_of_the_tutorial_is_named_before_it() -> None:
    """The marks are comments, which a reader does not see."""
    text = (REPOSITORY / "docs/tutorial.md").read_text("utf-8")
    for block in blocks("docs/tutorial.md"):
        if block.mark == "file":
            assert f"Save this as `{block.name}`:\n\n<!-- file: {block.name} -->" in text


def test_the_c_of_the_readme(require_tool: Callable[..., str], qlinkgen: Run, tmp_path: Path) -> None:
    gcc = require_tool("gcc", package="gcc")
    (text,) = [block.text for block in blocks("README.md") if block.kind == "c" and not block.mark]
    (tmp_path / "main.c").write_text(text)
    assert qlinkgen("generate", "qlink", "--target", "c", "-o", tmp_path).code == 0
    flags = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror", f"-I{tmp_path / 'c'}"]
    subprocess.run([gcc, *flags, "-c", str(tmp_path / "main.c"), "-o", str(tmp_path / "main.o")], check=True)
