"""The page about the library lists what there is, and the versions that the tests install."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from qlinkgen.schema import find, load
from tests.library.protocols import NAMES, PEERS

ROOT = Path(__file__).parents[2]


def test_page_lists_every_protocol() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["optional-dependencies"]
    makefile = (ROOT / "Makefile").read_text("utf-8")
    without = re.findall(r"^\w+ := (\S+==\S+)$", makefile, re.MULTILINE)  # installed without its requirements
    versions = dict(each.split("==") for each in (*extras["library-tests"], *without))
    page = (ROOT / "docs/library.md").read_text("utf-8")
    rows = re.findall(r"^\| `(\w+)` \| (.*) \| \[(.*)\]\((.*)\) (.*) \|$", page, re.MULTILINE)
    expected = []
    for name in NAMES:
        protocol, package = load(find(name)), PEERS[name][1]
        place = f"https://pypi.org/project/{package}/"
        expected.append((name, f"{protocol.title} {protocol.revision}", package, place, versions[package]))
    assert rows == expected


def test_protocols_are_named_like_their_files() -> None:
    assert [load(find(name)).name for name in NAMES] == list(NAMES)
