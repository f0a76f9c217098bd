"""Any file results in a protocol, or in faults with a position."""

from __future__ import annotations

import copy
import random
from collections.abc import Iterator
from decimal import Decimal
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from qlinkgen.errors import Fault
from qlinkgen.schema import find, library, lint, loads, shipped
from qlinkgen.schema.rules import RULES
from qlinkgen.schema.source import parse

SCHEMAS = [
    *(find(name) for name in (*shipped(), *library())),
    *sorted(Path(__file__).parents[1].glob("schemas/*.yaml")),
]
DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
TEXTS = {path.stem: path.read_text("utf-8") for path in SCHEMAS}
ODD: list[Any] = [
    None,
    True,
    0,
    -1,
    1,
    255,
    256,
    1 << 70,
    0.5,
    "",
    "none",
    "x",
    "u8",
    "u9",
    "u65",
    "i64",
    "bytes",
    "text[3]",
    "u16[0..5]",
    "u8[99999999999]",
    "bytes[5..3]",
    "1..0",
    "0..7",
    "8",
    "1/3",
    "1/0",
    "1/2^64",
    "A5 A5",
    "3 bytes",
    "é",
    "a b",
    "fixed0.0",
    "fixed32.32",
    "ufixed40.40",
    "crc-8/smbus",
    "sum16",
    [],
    [1],
    ["a", "b"],
    [[1]],
    {},
    {"a": 1},
    {"type": "u8"},
    {"type": "u8", "range": "1..300"},
    {"at": "0..3"},
    "<<",
    "*",
    "length",
    "data",
]


def check(text: str) -> list[Fault]:
    protocol, faults = loads(text, "some.yaml")
    lines = text.count("\n") + 2
    errors = [fault for fault in faults if fault.severity == "error"]
    assert (protocol is None) == bool(errors), "either a protocol or errors"
    for fault in faults:
        assert fault.rule in RULES
        assert 1 <= fault.line <= lines, fault
        assert fault.column >= 1
        assert fault.message
        assert "\n" not in str(fault)
    return faults


def nodes(data: Any) -> Iterator[tuple[Any, Any]]:
    """Every (container, key) of a tree."""
    pairs = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in pairs:
        yield data, key
        yield from nodes(value)


def mutate(data: Any, chance: random.Random) -> None:
    places = list(nodes(data))
    container, key = chance.choice(places)
    other, other_key = chance.choice(places)
    kind = chance.randrange(5)
    if kind == 0:
        del container[key]
    elif kind == 1:
        container[key] = copy.deepcopy(chance.choice(ODD))
    elif kind == 2:
        container[key] = copy.deepcopy(other[other_key])
    elif isinstance(container, dict):
        new = str(key) + "x" if kind == 3 else str(other_key)
        container[new] = container.pop(key) if kind == 3 else copy.deepcopy(chance.choice(ODD))


@pytest.mark.slow
@pytest.mark.parametrize("name", TEXTS)
def test_changed_nodes(name: str) -> None:
    chance = random.Random(f"nodes {name}")
    whole = yaml.safe_load(TEXTS[name])
    for _ in range(15 if name == "mc1231a" else 60):
        data = copy.deepcopy(whole)
        for _ in range(chance.choice([1, 1, 1, 2, 5, 20])):
            mutate(data, chance)
        check(yaml.dump(data, Dumper=DUMPER, sort_keys=False, allow_unicode=True))


@pytest.mark.parametrize("name", TEXTS)
def test_changed_text(name: str) -> None:
    chance = random.Random(f"text {name}")
    lines = TEXTS[name].splitlines(keepends=True)
    junk = [
        "&a ",
        "*a",
        "!!int ",
        "? ",
        "- ",
        "[",
        "]",
        "{",
        "}",
        ":",
        "\t",
        '"',
        "'",
        "|",
        "\0",
        "\x85",
        "\ufeff",
        "%",
    ]
    for _ in range(15 if name == "mc1231a" else 60):
        changed = list(lines)
        for _ in range(chance.choice([1, 1, 2, 5])):
            at = chance.randrange(len(changed))
            line = changed[at]
            column = chance.randrange(len(line) + 1)
            kind = chance.randrange(5)
            if kind == 0:
                del changed[at]
            elif kind == 1:
                changed[at] = line[:column] + chance.choice(junk) + line[column:]
            elif kind == 2:
                changed[at] = line[:column] + line[column + 1 :]
            elif kind == 3:
                changed.insert(at, chance.choice(changed))
            else:
                changed[at] = chance.choice([" ", "  "]) + line
            if not changed:
                changed = [""]
        check("".join(changed))


@given(st.text(max_size=200))
def test_any_text(text: str) -> None:
    check(text)


@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.text("ab1.[]", max_size=5),
        lambda inner: (
            st.lists(inner, max_size=3)
            | st.dictionaries(
                st.sampled_from(
                    ["frame", "parts", "bus", "commands", "request", "type", "role", "id", "a", "protocol"]
                ),
                inner,
                max_size=4,
            )
        ),
    )
)
def test_any_tree(data: object) -> None:
    check(yaml.dump(data, Dumper=DUMPER))


def test_deep_nesting_is_an_error_not_a_crash() -> None:
    for text in ("[" * 200_000 + "]" * 200_000, "- " * 200_000, "{a: " * 100_000 + "}" * 100_000):
        assert [fault.rule for fault in check(text)] == ["yaml-syntax"]


def test_aliases_cannot_multiply() -> None:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 8)}]" for n in range(1, 20)]
    assert any("aliases" in fault.message for fault in check("\n".join(lines)))


def test_alias_of_an_enclosing_node() -> None:
    faults = check("a: &a\n  b: *a\n")
    assert faults[0].rule == "yaml-syntax"
    assert "alias" in faults[0].message


def test_binary_file(tmp_path: Path) -> None:
    path = tmp_path / "x.yaml"
    path.write_bytes(b"\xff\xfe\x00")
    assert [fault.rule for fault in lint(path)] == ["file-unreadable"]
    assert [fault.rule for fault in lint(tmp_path)] == ["file-unreadable"]
    assert [fault.rule for fault in lint(tmp_path / "none.yaml")] == ["file-unreadable"]


def test_words_that_yaml_1_1_would_convert_stay_text() -> None:
    data = parse("{on: yes, off: no, a: 7.10, b: 0x1F, c: 1_000, d: 0o17, e: '5', f: 1e5}").data
    assert data == {
        "on": "yes", "off": "no", "a": Decimal("7.10"), "b": 31, "c": 1000, "d": "0o17", "e": "5", "f": "1e5",
    }  # fmt: skip
