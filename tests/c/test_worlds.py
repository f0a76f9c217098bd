"""Libraries for Arduino, PlatformIO, Zephyr, ESP-IDF and CMake: manifests, examples, installation."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from qlinkgen.backends.base import Options
from qlinkgen.backends.c.worlds import WORLDS, generate
from qlinkgen.codecs import qlink
from qlinkgen.schema import find, load
from tests.c.conftest import protocol_of
from tests.c.test_compile import run

STUBS = Path(__file__).with_name("worlds")
#: A slave, one that silences tell the end of a frame, and a listener.
NAMES = ("qlink", "modbus_rtu", "trio")
VERSION = re.compile(r"[0-9]+\.[0-9]+\.[0-9]+")


def laid_out(world: str, folder: Path, names: tuple[str, ...] = NAMES) -> None:
    for name in names:
        for path, text in generate(protocol_of(name), Options(), world).items():
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            (folder / path).write_text(text, "utf-8")


@pytest.mark.parametrize("world", WORLDS)
def test_examples_compile(world: str, tmp_path: Path, require_tool: Callable[..., str]) -> None:
    """Against declarations of what they use, for the worlds that are not installed."""
    laid_out(world, tmp_path)
    for name in NAMES:
        programs = [each for each in (tmp_path / name).rglob("*.*") if each.suffix in {".c", ".cpp", ".ino"}]
        assert len(programs) == 1
        plus = programs[0].suffix != ".c"
        compiler = require_tool("g++" if plus else "gcc", package="g++" if plus else "gcc")
        language = ("-x", "c++", "-std=c++11") if plus else ("-std=c99",)
        places = [f"-I{tmp_path / name / each}" for each in ("src", "include")]
        run(
            compiler,
            *language,
            "-Wall",
            "-Wextra",
            "-Werror",
            "-fsyntax-only",
            f"-I{STUBS}",
            *places,
            programs[0],
        )


def test_manifests(tmp_path: Path) -> None:
    """Each has what its world demands, and names files that exist."""
    for world in WORLDS:
        laid_out(world, tmp_path / world, ("qlink",))
    lines = (tmp_path / "arduino/qlink/library.properties").read_text().splitlines()
    properties = dict(line.split("=", 1) for line in lines)
    assert properties.keys() >= {"name", "version", "author", "maintainer", "sentence", "paragraph", "url"}
    assert VERSION.fullmatch(properties["version"])
    assert properties["category"] == "Communication"
    assert (tmp_path / "arduino/qlink/src" / properties["includes"]).is_file()

    library = json.loads((tmp_path / "platformio/qlink/library.json").read_text())
    assert re.fullmatch(r"[a-z0-9_]+", library["name"])
    assert VERSION.fullmatch(library["version"])
    assert (tmp_path / "platformio/qlink/include" / library["headers"]).is_file()
    for example in library["examples"]:
        assert all(
            (tmp_path / "platformio/qlink" / example["base"] / each).is_file() for each in example["files"]
        )

    zephyr = tmp_path / "zephyr/qlink"
    module = yaml.safe_load((zephyr / "zephyr/module.yml").read_text())
    assert (zephyr / module["build"]["cmake"] / "CMakeLists.txt").is_file()
    assert (zephyr / module["build"]["kconfig"]).is_file()
    assert all((zephyr / each).is_dir() for each in module["samples"])
    (option,) = re.findall(r"^config (\w+)$", (zephyr / "zephyr/Kconfig").read_text(), re.MULTILINE)
    assert f"CONFIG_{option}=y\n" in (zephyr / "samples/slave/prj.conf").read_text()
    assert f"if(CONFIG_{option})" in (zephyr / "zephyr/CMakeLists.txt").read_text()

    component = yaml.safe_load((tmp_path / "esp-idf/qlink/idf_component.yml").read_text())
    assert VERSION.fullmatch(component["version"])
    assert component["dependencies"] == {"idf": ">=5.0"}


def test_a_header_without_a_program_has_no_example() -> None:
    made = {world: generate(load(find("visca")), Options(), world) for world in WORLDS}
    assert not [
        path for paths in made.values() for path in paths if "examples/" in path or "samples/" in path
    ]
    assert "examples" not in json.loads(made["platformio"]["visca/library.json"])
    assert "samples" not in yaml.safe_load(made["zephyr"]["visca/zephyr/module.yml"])


@pytest.mark.parametrize(
    ("revision", "version"),
    [("1.0", "1.0.0"), ("v2", "2.0.0"), ("01.2.3", "1.2.3"), ("2024-05 draft", "0.0.0")],
)
def test_a_title_and_a_revision_cannot_break_a_manifest(revision: str, version: str) -> None:
    protocol = replace(protocol_of("qlink"), revision=revision, title='A "quoted"\nurl=: # title\\')
    made = {world: generate(protocol, Options(), world) for world in WORLDS}
    component = yaml.safe_load(made["esp-idf"]["qlink/idf_component.yml"])
    assert component["version"] == version
    assert json.loads(made["platformio"]["qlink/library.json"])["description"].startswith(
        'Frames of A "quoted" url='
    )
    lines = made["arduino"]["qlink/library.properties"].splitlines()
    assert [line.split("=")[0] for line in lines].count("url") == 1


FOUND = """
cmake_minimum_required(VERSION 3.16)
project(own LANGUAGES C)
find_package(qlink 1.0 REQUIRED)
qlinkgen_generate(TARGET own_trio SCHEMA trio)
add_executable(own main.c)
target_link_libraries(own PRIVATE qlink::qlink own_trio)
"""
OWN = """
#include "qlink.h"
#include "trio.h"
int main(void) { return QLINK_SCHEMA_HASH == TRIO_SCHEMA_HASH; }
"""


def test_cmake_installs_a_package(tmp_path: Path, require_tool: Callable[..., str]) -> None:
    """It is found by find_package, its example answers, and it brings qlinkgen_generate()."""
    cmake = require_tool("cmake", package="cmake")
    require_tool("make", package="make")
    laid_out("cmake", tmp_path, ("qlink",))
    place = tmp_path / "installed"
    run(cmake, "-S", tmp_path / "qlink", "-B", tmp_path / "made", f"-DCMAKE_INSTALL_PREFIX={place}")
    run(cmake, "--install", tmp_path / "made")

    own = tmp_path / "own"
    own.mkdir()
    (own / "CMakeLists.txt").write_text(FOUND)
    (own / "main.c").write_text(OWN)
    command = f"-DQLINKGEN_EXECUTABLE={sys.executable};-m;qlinkgen"
    for source, program in ((tmp_path / "qlink/examples/slave", "slave"), (own, "own")):
        run(cmake, "-S", source, "-B", tmp_path / program / "b", f"-DCMAKE_PREFIX_PATH={place}", command)
        run(cmake, "--build", tmp_path / program / "b")
    run(tmp_path / "own/b/own")

    request = qlink.MotionRequest(node=1, counter=5).to_frame()
    answered = subprocess.run(
        [tmp_path / "slave/b/slave"], input=request, capture_output=True, timeout=60, check=True
    )
    assert answered.stdout == qlink.MotionResponse(node=1, counter=5).to_frame()
