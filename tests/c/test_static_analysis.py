"""cppcheck with MISRA and clang-tidy find only deviations justified in deviations.yaml."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from tests.c.conftest import PROTOCOLS
from tests.c.test_compile import header
from tests.c.test_master import write

DEVIATIONS = Path(__file__).with_name("deviations.yaml")

#: One form of the CRC for each header, together all forms, because each run takes seconds.
FORMS = {
    "qlink": "LOOP",
    "trio": "TABLE",
    "kitchen_sink": "LOOP",
    "modbus_rtu": "TABLE",
    "dynamixel": "NIBBLE",
}
CPPCHECK = (
    *("--addon=misra", "--enable=warning,style,performance,portability", "--std=c99", "--platform=avr8"),
    *("--suppress=missingIncludeSystem", "-q", "--template={file}:{line}: [{id}]"),
)
GROUPS = "bugprone-*,cert-*,clang-analyzer-*,misc-*,performance-*,portability-*,readability-*"
#: The filter enables findings in headers, the option analysis of paths through them.
CLANG_TIDY = (
    *("-header-filter=.*", f"-checks=-*,{GROUPS}", "--quiet"),
    *("--extra-arg=-Xclang", "--extra-arg=-analyzer-opt-analyze-headers"),
)
FINDING = re.compile(r"^(?P<place>[^:\n]+:\d+):.*\[(?P<rules>[\w.,-]+)\]$", re.MULTILINE)

Analyse = Callable[[str, Path], dict[str, str]]


def defines(name: str) -> list[str]:
    """All options enabled."""
    upper = name.upper()
    form = [f"-D{upper}_CRC_FORM={upper}_CRC_FORM_{FORMS[name]}"] if name in FORMS else []
    return [f"-D{upper}_ENABLE_FLOAT=1", f"-D{upper}_ENABLE_NAMES=1", *form]


def findings(*command: str | Path) -> dict[str, str]:
    """Violated rules, each with the first location; raises if the tool fails."""
    done = subprocess.run(
        [str(word) for word in command], capture_output=True, text=True, timeout=300, check=False
    )
    output = done.stdout + done.stderr
    assert done.returncode == 0, output[-2000:]
    found: dict[str, str] = {}
    for match in FINDING.finditer(output):
        for rule in match["rules"].split(","):
            found.setdefault(rule, match["place"])
    return found


def includer(name: str, folder: Path) -> Path:
    file = folder / f"use_{name}.c"
    file.write_text(f'#include "{name}.h"\n')
    return file


def cppcheck(program: str) -> Analyse:
    def analyse(name: str, folder: Path) -> dict[str, str]:
        return findings(program, *CPPCHECK, *defines(name), includer(name, folder))

    return analyse


def clang_tidy(program: str) -> Analyse:
    def analyse(name: str, folder: Path) -> dict[str, str]:
        return findings(program, *CLANG_TIDY, includer(name, folder), "--", "-std=c99", *defines(name))

    return analyse


@pytest.fixture(params=["cppcheck", "clang-tidy"])
def tool(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def analyse(tool: str, require_tool: Callable[..., str]) -> Analyse:
    program = require_tool(tool, package=tool)
    return cppcheck(program) if tool == "cppcheck" else clang_tidy(program)


def deviations(tool: str) -> list[str]:
    entries = yaml.safe_load(DEVIATIONS.read_text("utf-8"))
    for entry in entries:
        assert set(entry) == {"tool", "rule", "reason"}
        assert entry["reason"].strip()
    rules = [entry["rule"] for entry in entries if entry["tool"] == tool]
    assert len(rules) == len(set(rules))
    return rules


def test_findings_are_those_with_a_reason(tool: str, analyse: Analyse, tmp_path: Path) -> None:
    found: dict[str, str] = {}
    for name in PROTOCOLS:
        header(name, tmp_path)
        found |= analyse(name, tmp_path)
    for name in ("qlink", "modbus_rtu"):
        write(name, tmp_path)
        found |= analyse(f"{name}_master", tmp_path)
    listed = deviations(tool)
    assert {rule: place for rule, place in found.items() if rule not in listed} == {}
    assert [rule for rule in listed if rule not in found] == [], "listed, and found nowhere"


PLANTED = {
    "cppcheck": ("return a == 7 || a == 9 && a != 8;", "misra-c2012-12.1"),
    "clang-tidy": (
        "const int *none = NULL;\n    return (a == 7) ? *none : 0;",
        "clang-analyzer-core.NullDereference",
    ),
}


def test_a_planted_violation_is_found(tool: str, analyse: Analyse, tmp_path: Path) -> None:
    """The tools report an error in an unused function of the header, and the list does not hide it."""
    body, rule = PLANTED[tool]
    text = header("trio", tmp_path)
    planted = f"static inline int trio_planted_(int a)\n{{\n    {body}\n}}\n"
    before, after = text.rsplit("#ifdef __cplusplus\n", 1)
    (tmp_path / "trio.h").write_text(f"{before}{planted}#ifdef __cplusplus\n{after}", "utf-8")
    assert rule in analyse("trio", tmp_path)
    assert rule not in deviations(tool)
