"""What README and docs show is true: commands print what stands there, files compile, excerpts are excerpts.

* ``<!-- file: NAME -->`` in front of a block: the block is that file.
* ```` ```console ````: lines behind ``$`` are run by bash in one folder, and what follows is their output; a
  line ``...`` stands for any lines.
* ```` ```pycon ````: run as a doctest.
* ``<!-- excerpt: PATH -->`` in front of a block: it stands in the file of that path, ``...`` where lines are
  left out.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.cli.conftest import Run

REPOSITORY = Path(__file__).resolve().parents[2]
DOCUMENTS = ["README.md", "docs/tutorial.md", "docs/cli.md"]
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


@pytest.fixture
def shell(tmp_path: Path) -> Callable[[str], str]:
    """A function that runs a command in an empty folder; the output, both kinds together."""
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
    }

    def run(command: str) -> str:
        done = subprocess.run(
            ["bash", "-c", command],
            cwd=folder,
            env=environment,
            stdout=-1,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        return done.stdout

    return run


def sessions(text: str) -> Iterator[tuple[str, str]]:
    """Command and expected output."""
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        command, _, expected = part.partition("\n")
        while command.endswith("\\"):
            line, _, expected = expected.partition("\n")
            command = f"{command}\n{line}"
        yield command, expected


def matches(expected: str, found: str) -> bool:
    pattern = "".join(
        "(?:.*\n)*" if line == "..." else re.escape(line) + "\n" for line in expected.splitlines()
    )
    return re.fullmatch(pattern, found) is not None


@pytest.mark.parametrize("document", DOCUMENTS)
def test_commands_and_files(
    document: str, shell: Callable[[str], str], tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    if any("gcc" in block.text for block in blocks(document) if block.kind == "console"):
        require_tool("gcc", package="gcc")
    for block in blocks(document):
        if block.mark == "file":
            (tmp_path / "work" / block.name).write_text(block.text)
        elif block.kind == "console":
            for command, expected in sessions(block.text):
                found = shell(command)
                assert matches(expected, found), f"$ {command}\n{found}"


@pytest.mark.parametrize("document", DOCUMENTS)
def test_python_sessions(document: str, shell: Callable[[str], str], tmp_path: Path) -> None:
    text = "".join(block.text for block in blocks(document) if block.kind == "pycon")
    if text:
        (tmp_path / "work" / "session.txt").write_text(text)
        shell("qlinkgen generate --target python -o .")
        assert shell("PYTHONPATH=python python3 -m doctest -o NORMALIZE_WHITESPACE session.txt") == ""


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
    "document", sorted({*DOCUMENTS, "CONTRIBUTING.md", "docs/README.md", "docs/receiver.md"})
)
def test_links(document: str) -> None:
    path = REPOSITORY / document
    for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", path.read_text("utf-8")):
        assert (path.parent / target).exists(), target


def test_the_c_of_the_readme(require_tool: Callable[..., str], qlinkgen: Run, tmp_path: Path) -> None:
    gcc = require_tool("gcc", package="gcc")
    (text,) = [block.text for block in blocks("README.md") if block.kind == "c" and not block.mark]
    (tmp_path / "main.c").write_text(text)
    assert qlinkgen("generate", "qlink", "--target", "c", "-o", tmp_path).code == 0
    flags = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror", f"-I{tmp_path / 'c'}"]
    subprocess.run([gcc, *flags, "-c", str(tmp_path / "main.c"), "-o", str(tmp_path / "main.o")], check=True)
