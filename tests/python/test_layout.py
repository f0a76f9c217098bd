"""Generated Python passes ruff with its own settings, whatever the schema: nothing to fix or to format."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from qlinkgen import schema
from qlinkgen.backends import construct, python
from qlinkgen.backends.base import Outputs
from qlinkgen.backends.python import bus
from qlinkgen.backends.python.fitted import fitted
from qlinkgen.backends.python.layout import WIDTH
from qlinkgen.errors import SchemaError
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import Options
from tests.support.whole import schemas, words

ROOT = Path(__file__).parents[2]
SEEDS = range(1, 41)
#: Appended to names in parts, to vary where lines break.
_LONGER = "_of_the_second_cooling_circuit"


def ruff(*arguments: str, folder: Path) -> str:
    """What ruff with its own settings says about a folder; empty where it is content."""
    command = [sys.executable, "-m", "ruff", *arguments, "--isolated", "--no-cache", "--quiet", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.stdout + done.stderr


def written(protocol: Protocol) -> Outputs:
    """All Python that is generated for a protocol."""
    options = Options()
    outputs = {**construct.generate(protocol, options), **python.generate(protocol, options)}
    if protocol.bus is not None:
        outputs |= bus.generate(protocol, options)
    return outputs


def random_protocols(folder: Path) -> Iterator[Protocol]:
    for seed in SEEDS:
        path = folder / f"{seed}.yaml"
        path.write_text(schemas.generate(seed, hostile=seed % 2 == 0), "utf-8")
        try:
            yield schema.load(path)
        except SchemaError:
            continue


def place(folder: Path, outputs: Outputs) -> int:
    for name, text in outputs.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, "utf-8")
    return len(outputs)


@pytest.mark.parametrize("more", [0, 9, 13, 17, 22, len(_LONGER)])
def test_random_schemas_leave_nothing_to_do(
    more: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(words, "NAMES", tuple(name + _LONGER[:more] for name in words.NAMES))
    # Most support modules are the same for many schemas; ruff sees each text once.
    distinct = {
        text: f"s{index}/{name}"
        for index, protocol in enumerate(random_protocols(tmp_path))
        for name, text in written(protocol).items()
    }
    assert place(tmp_path, {path: text for text, path in distinct.items()}) > 60
    assert ruff("check", folder=tmp_path) == ""
    assert ruff("format", "--check", folder=tmp_path) == ""


def test_shipped_and_committed_files_leave_nothing_to_do() -> None:
    assert ruff("check", folder=ROOT / "generated") == ""
    assert ruff("format", "--check", folder=ROOT / "generated") == ""


def test_other_protocols_leave_nothing_to_do(tmp_path: Path) -> None:
    """Those of the tests and of the library, in one run."""
    paths = [*(ROOT / "tests/schemas").glob("*.yaml"), *(ROOT / "schemas/library").glob("*.yaml")]
    distinct = {
        text: f"{path.stem}/{name}" for path in paths for name, text in written(schema.load(path)).items()
    }
    assert place(tmp_path, {path: text for text, path in distinct.items()}) > 100
    for text, path in distinct.items():
        bases = [name for name in re.findall(r"^class (_\w+)", text, re.MULTILINE) if text.count(name) == 1]
        assert not bases, path
    assert ruff("check", folder=tmp_path) == ""
    assert ruff("format", "--check", folder=tmp_path) == ""


def test_support_modules_leave_nothing_to_do(tmp_path: Path) -> None:
    """All of them, also those that no schema here needs."""
    modules = {
        f"{name}/{path.name}": path.read_text("utf-8")
        for name in ("construct", "python")
        for path in (ROOT / "qlinkgen/backends" / name).glob("_[a-z]*.py")
    }
    assert place(tmp_path, modules) > 20
    assert ruff("check", folder=tmp_path) == ""
    assert ruff("format", "--check", folder=tmp_path) == ""


_EQUAL_CASES = """\
qlinkgen: 1
protocol: {name: tank, title: Tank, revision: "1", source: Example, doc: A tank}
byteorder: big
types: {point: {fields: {x: u8}}, line: {fields: {y: u16}}}
frame:
  parts:
    start: {role: constant, value: 7E}
    code: {role: message, type: u8}
    length: {role: length, type: u8, counts: [data]}
    data: {role: payload, size: 0..40}
bus: {kind: master_slave}
messages:
  log: {id: 5, fields: {k: u8, v: {switch: k, cases: {0: point, 2..3: point, 5: line}, default: line}}}
  note: {id: 6, fields: {k: u8, v: {switch: k, cases: {0: line, 2..3: point}, default: point}}}
  stop: {id: 7, fields: {k: u8, v: {switch: k, cases: {0: point, 2: line, 4..5: line}, default: {}}}}
"""


def test_cases_with_equal_records_are_one_branch(tmp_path: Path) -> None:
    path = tmp_path / "tank.yaml"
    path.write_text(_EQUAL_CASES, "utf-8")
    assert place(tmp_path / "out", written(schema.load(path)))
    assert ruff("check", folder=tmp_path) == ""
    assert ruff("format", "--check", folder=tmp_path) == ""


def test_ruff_detects_unformatted_code(tmp_path: Path) -> None:
    (tmp_path / "long.py").write_text("import os\n\n\nx = [\n  1]\n", "utf-8")
    assert "F401" in ruff("check", folder=tmp_path)
    assert "reformatted" in ruff("format", "--check", folder=tmp_path)


LONG = "a_rather_long_name"


@pytest.mark.parametrize(
    "statement",
    [
        f"{LONG} = {' + '.join([LONG] * 6)}",
        f"if {' or '.join([LONG] * 6)}:\n    pass",
        f"if not ({' and '.join(f'{LONG} == {index}' for index in range(6))}):\n    pass",
        f"if len({LONG}) != {' + '.join([LONG] * 6)}:\n    pass",
        f"{LONG} = {LONG}.method({', '.join([LONG] * 6)})",
        f"{LONG} = {{{', '.join(f'{index}: {LONG}' for index in range(6))}}}",
        f"{LONG} = {LONG}[1 + {LONG} : 20 + {LONG} + {LONG}]",
        f"{LONG} = {LONG}[1 + {LONG} + {LONG} : 20 + {LONG} + {LONG}]",
        f"{LONG} = {LONG}[1 + {LONG} + {LONG} + {LONG} : 20 + {LONG} + {LONG}]",
        f"{LONG} = {LONG}[{LONG} + {LONG} + {LONG} + {LONG} : 20 + {LONG}]",
        f"{LONG} = {LONG}[{LONG} + {LONG} + {LONG} + {LONG} : 20 * {LONG} + {LONG} * 30]",
        f"{LONG} = {LONG}[{LONG} + {LONG} + {LONG} : 20 * {LONG} + {LONG} * 30]",
        f"{LONG} = {LONG}[{LONG} + {LONG} + {LONG} + {LONG} :]",
        f"{LONG} = {LONG}[{LONG} + {LONG} + {LONG} : -{LONG}]",
        f"{LONG} = {LONG}[{LONG} + {LONG} + {LONG} : len({LONG}) + 1]",
        f"{LONG} = {LONG}[{LONG} + {LONG} + {LONG}x : -{LONG}]",
        f"{LONG} = [{LONG} << 1 | {LONG} for {LONG} in range(0, len({LONG}), 10) if {LONG}]",
        f"({LONG * 4},) = {LONG}({LONG})",
        f"{LONG}_1, {LONG}_2 = divmod({LONG} - ({LONG} + {LONG} + {LONG}), 2)",
        f"{LONG} = (({LONG} >> 11 & 0x1FFFFFFFFF) ^ 0x1000000000) - 0x1000000000 + {LONG}",
        f'def {LONG}(one: int, two: int, three: int, four: int = 0) -> tuple[int, str]:\n    """"""',
        f"return {LONG}[{LONG}]({', '.join([LONG] * 5)})",
        f"answer: {'A' * 40} | {'B' * 40} = self.ask_any(request, {'A' * 40}, {'B' * 40})",
        f"answer: {'A' * 30} | {'B' * 30} = await self.ask_any(request, A, B)",
    ],
)
def test_statements_are_split_as_ruff_splits_them(statement: str, tmp_path: Path) -> None:
    source = fitted(f"def long():\n    {statement.replace(chr(10), chr(10) + '    ')}\n")
    assert all(len(line) <= WIDTH for line in source.splitlines())
    (tmp_path / "long.py").write_text(source, "utf-8")
    assert ruff("format", "--check", folder=tmp_path) == ""


def test_text_is_left_alone() -> None:
    word = "f(1,2)=" + "x" * 100
    top = f'"""Title.\n\n{word}\n"""\n\nA = 1  # {word}\n# {word}\n\n\n'
    left = f'{top}def f():\n    """{word}\n\n    {word}\n    """\n'
    assert fitted(left) == left
    split = f'    return (\n        1,\n        "{word}",\n    )\n'
    assert fitted(f'{left}    return (1, "{word}")\n') == left + split
    assert fitted(f'"""{word}"""\nB = 1\n') == f'"""{word}"""\nB = 1\n'
