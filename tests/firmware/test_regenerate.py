"""The CMake function qlinkgen_generate: headers follow schema and options, without unnecessary work."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from tests.firmware.firmware import ROOT, SOURCES
from tests.firmware.test_build import GENERATED, QLINKGEN, programs, run, sure, without_python

__all__ = ["without_python"]  # a fixture

Tool = Callable[..., str]
SCHEMA = ROOT / "schemas" / "qlink.yaml"
PROJECT = """
cmake_minimum_required(VERSION 3.16)
project(node {language})
list(APPEND CMAKE_MODULE_PATH "{modules}")
include(Qlinkgen)
qlinkgen_generate({arguments})
if(CMAKE_C_COMPILER)
  add_executable(node main.c)
  target_link_libraries(node PRIVATE bus)
endif()
"""
#: Prints the baud rate of the header, and whether it has the last command.
MAIN = """
#include <stdio.h>
#include "qlink.h"
int main(void)
{
#ifdef QLINK_LOOP_BACK_REQUEST_ID
    const int loop_back = 1;
#else
    const int loop_back = 0;
#endif
    printf("%lu %d\\n", (unsigned long)QLINK_BAUD, loop_back);
    return 0;
}
"""


@dataclass
class Project:
    """A project of a user, with its own schema."""

    folder: Path
    executable: tuple[str, ...]
    arguments: str = "TARGET bus SCHEMA bus.yaml"
    options: list[str] = field(default_factory=list)
    language: str = "C"

    @property
    def build_folder(self) -> Path:
        return self.folder / "build"

    @property
    def schema(self) -> Path:
        return self.folder / "bus.yaml"

    @property
    def stamp(self) -> Path:
        return self.build_folder / "bus.stamp"

    def write(self) -> None:
        (self.folder / "main.c").write_text(MAIN)
        (self.folder / "CMakeLists.txt").write_text(
            PROJECT.format(
                modules=(SOURCES / "cmake").as_posix(), arguments=self.arguments, language=self.language
            )
        )

    def command(self) -> tuple[str | Path, ...]:
        self.write()
        program = f"-DQLINKGEN_EXECUTABLE={';'.join(self.executable)}"
        return ("cmake", "-S", self.folder, "-B", self.build_folder, program, *self.options)

    def configure(self) -> None:
        sure(*self.command(), PYTHONPATH=str(ROOT))

    def complaint(self, **changes: str) -> str:
        """The message of CMake, which must fail, in one line."""
        done = run(*self.command(), PYTHONPATH=str(ROOT), **changes)
        assert done.returncode != 0, done.stdout
        return " ".join(done.stdout.split())

    def build(self) -> str:
        return sure("cmake", "--build", self.build_folder, PYTHONPATH=str(ROOT))

    def says(self) -> list[str]:
        return sure(self.build_folder / "node").split()


@pytest.fixture
def project(tmp_path: Path, require_tool: Tool) -> Project:
    """A project that is not configured yet."""
    require_tool("cmake", package="cmake")
    require_tool("cc", package="gcc")
    made = Project(tmp_path / "project", QLINKGEN)
    made.folder.mkdir()
    made.schema.write_text(SCHEMA.read_text("utf-8"), "utf-8")
    return made


def test_follows_the_schema_and_only_the_schema(project: Project) -> None:
    project.configure()
    project.build()
    assert project.says()[0] == "115200"
    before = project.stamp.stat().st_mtime_ns
    assert "Building" not in project.build()
    assert project.stamp.stat().st_mtime_ns == before

    text = project.schema.read_text("utf-8")
    project.schema.write_text(text.replace("baud: 115200", "baud: 57600"), "utf-8")
    assert "Building" in project.build()
    assert project.says()[0] == "57600"
    changed = project.stamp.stat().st_mtime_ns
    assert changed != before

    project.schema.touch()  # newer, but unchanged: the outputs stay, and are not compiled again
    assert "Building" not in project.build()
    assert project.stamp.stat().st_mtime_ns != changed


def test_the_project_of_the_readme(project: Project) -> None:
    found = re.search(r"```cmake\n(.*?)```", (SOURCES / "README.md").read_text("utf-8"), re.DOTALL)
    assert found
    project.write()
    (project.folder / "CMakeLists.txt").write_text(found[1], "utf-8")
    (project.folder / "cmake").mkdir()
    shutil.copy(SOURCES / "cmake" / "Qlinkgen.cmake", project.folder / "cmake")
    program = f"-DQLINKGEN_EXECUTABLE={';'.join(project.executable)}"
    sure("cmake", "-S", project.folder, "-B", project.build_folder, program, PYTHONPATH=str(ROOT))
    project.build()
    assert sure(project.build_folder / "firmware").split() == ["115200", "1"]


def test_follows_its_options(project: Project) -> None:
    project.configure()
    project.build()
    assert project.says()[1] == "1"
    project.arguments += " ROLE slave ONLY motion node_info SET crc=crc-16/xmodem TARGETS c python"
    project.arguments += " OUTPUT_DIRECTORY elsewhere"
    project.write()
    assert "Building" in project.build()
    assert project.says()[1] == "0"
    header = (project.build_folder / "elsewhere" / "c" / "qlink.h").read_text("utf-8")
    assert "qlink_master_t" not in header
    assert "#define QLINK_CRC QLINK_CRC_16_XMODEM" in header
    assert "QLINK_NODE_INFO_REQUEST_ID" in header
    assert list((project.build_folder / "elsewhere").glob("python/**/qlink.py"))


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ("FILE bus.h TARGET bus SCHEMA bus.yaml", "unknown argument FILE;bus.h; arguments: TARGET,"),
        ("TARGET bus", "give TARGET, the name of the library to make, and SCHEMA"),
        ("SCHEMA bus.yaml", "give TARGET, the name of the library to make, and SCHEMA"),
        ("TARGET bus SCHEMA train.yaml", "train.yaml"),
        ("TARGET bus SCHEMA bus.yaml ONLY radio", "radio"),
        ("TARGET bus SCHEMA bus.yaml ROLE guard", "guard"),
    ],
)
def test_says_what_is_wrong(project: Project, arguments: str, expected: str) -> None:
    project.arguments = arguments
    project.language = "NONE"
    assert expected in project.complaint()


def test_says_where_a_schema_is_wrong(project: Project) -> None:
    text = project.schema.read_text("utf-8")
    project.schema.write_text(text.replace("nodes: 1..16", "nodes: 16..1"), "utf-8")
    project.language = "NONE"
    assert "bus.yaml:" in project.complaint()


def test_says_what_to_install(project: Project, without_python: str) -> None:
    project.executable = ()
    project.language = "NONE"
    complaint = project.complaint(PATH=without_python)
    assert "qlinkgen was not found" in complaint
    assert "pip install qlinkgen" in complaint
    assert "-DQLINKGEN_EXECUTABLE=/path/to/qlinkgen" in complaint


def test_the_example_makes_its_headers(tmp_path: Path, project: Project) -> None:
    build = tmp_path / "build"
    options = ("-DQLINKGEN_REGENERATE=ON", f"-DQLINKGEN_EXECUTABLE={';'.join(project.executable)}")
    # The copy has no folder of schemas: those shipped with qlinkgen are used.
    sure("cmake", "-S", SOURCES, "-B", build, *options, "-DSCHEMAS=/nowhere", PYTHONPATH=str(ROOT))
    sure("cmake", "--build", build, PYTHONPATH=str(ROOT))
    assert programs(build) == {"qlink_node", "trio_keypad"}
    made = build / "qlink_header" / "c" / "qlink.h"
    assert made.read_text("utf-8") == (GENERATED / "qlink.h").read_text("utf-8")
