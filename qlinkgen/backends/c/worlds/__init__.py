"""Libraries: the header of a protocol with the manifest and an example of a world that builds firmware."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import jinja2

from qlinkgen._resources import cmake_dir
from qlinkgen.backends.base import Outputs, banner
from qlinkgen.backends.c import header_of
from qlinkgen.backends.templates import environment
from qlinkgen.model.naming import file_stem
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.texts import one_line
from qlinkgen.plan import Options

__all__ = ["WORLDS", "generate"]

#: By world, the folder of the header and the files: path to template. A path may contain the library's name.
_FILES: Mapping[str, tuple[str, Mapping[str, str]]] = {
    "arduino": (
        "src",
        {
            "library.properties": "arduino.properties",
            "examples/{example}/{example}.ino": "arduino.ino",
        },
    ),
    "platformio": (
        "include",
        {"library.json": "platformio.json", "examples/{example}/main.cpp": "arduino.ino"},
    ),
    "zephyr": (
        "include",
        {
            "zephyr/module.yml": "zephyr_module.yml",
            "zephyr/CMakeLists.txt": "zephyr.cmake",
            "zephyr/Kconfig": "zephyr.kconfig",
            "samples/{example}/CMakeLists.txt": "zephyr_sample.cmake",
            "samples/{example}/prj.conf": "zephyr_sample.conf",
            "samples/{example}/src/main.c": "zephyr_sample.c",
        },
    ),
    "esp-idf": (
        "include",
        {
            "CMakeLists.txt": "idf.cmake",
            "idf_component.yml": "idf_component.yml",
            "examples/{example}/CMakeLists.txt": "idf_example.cmake",
            "examples/{example}/main/CMakeLists.txt": "idf_main.cmake",
            "examples/{example}/main/main.c": "idf_main.c",
        },
    ),
    "cmake": (
        "include",
        {
            "CMakeLists.txt": "cmake.cmake",
            "cmake/{name}Config.cmake": "cmake_config.cmake",
            "examples/{example}/CMakeLists.txt": "cmake_example.cmake",
            "examples/{example}/main.c": "cmake_main.c",
        },
    ),
}
WORLDS = tuple(_FILES)


@dataclass(frozen=True, slots=True)
class LibraryView:
    """A library.

    Attributes:
        name: of the library and of its header.
        version: three numbers.
        example: the program in the head comment of the header; ``role`` is what it is, slave or another.
        sends: whether it calls ``board_send``; ``idles`` whether it has to be told of silences.
        runs: whether there is such a program; a library without has no example.
    """

    name: str
    upper: str
    title: str
    version: str
    banner: tuple[str, ...]
    role: str
    example: list[str]
    sends: bool
    idles: bool
    runs: bool
    baud: int


def generate(protocol: Protocol, options: Options, world: str) -> Outputs:
    """The library of a protocol for a world, in a folder of its name."""
    view, text = _view(protocol, options)
    place, files = _FILES[world]
    found = {f"{place}/{view.name}.h": text}
    for path, template in files.items():
        if "{example}" in path and not view.runs:
            continue
        made = _templates().get_template(f"templates/{template}.j2").render(lib=view)
        found[path.format(name=view.name, example=view.role)] = made
    if world == "cmake":
        found["cmake/Qlinkgen.cmake"] = (cmake_dir() / "Qlinkgen.cmake").read_text("utf-8")
    return {f"{view.name}/{path}": made for path, made in found.items()}


def _view(protocol: Protocol, options: Options) -> tuple[LibraryView, str]:
    header = header_of(protocol, options)
    example, name = header.example(), file_stem(protocol.name)
    slave = any("_slave_dispatch(" in line for line in example)
    view = LibraryView(
        name=name,
        upper=name.upper(),
        title=one_line(protocol.title),
        version=_version(protocol.revision),
        banner=banner(protocol),
        role="slave" if slave else "listener",
        example=example,
        sends=slave,
        idles="void board_idle(void)" in example,
        runs="void board_start(void)" in example,
        baud=protocol.bus.baud or 115200,
    )
    return view, header.text()


def _version(revision: str) -> str:
    """The numbers of a revision as a version of three, 0.0.0 if it is not made of numbers."""
    numbers = [str(int(each)) for each in re.findall(r"[0-9]+", revision)]
    plain = re.fullmatch(r"v?[0-9]+(\.[0-9]+){0,2}", revision) is not None
    return ".".join([*numbers, "0", "0"][:3]) if plain else "0.0.0"


@cache
def _templates() -> jinja2.Environment:
    made = environment(__name__)
    made.filters["quoted"] = json.dumps  # a string of JSON is one of YAML
    return made
