"""Names equal to those that a target derives from another one, such as `a_count`, `a_1` and `a_t` beside `a`.

The words are derived by the targets from neutral names. Lint may refuse a schema for a clash; accepted
schemas compile, and all targets agree on them.
"""

from __future__ import annotations

import random
import re
import subprocess
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

import pytest

from qlinkgen.schema import loads
from tests.names import words
from tests.names.documents import Document, Json, frame
from tests.names.test_words import NEUTRAL, STRICT, agree, written

_NEUTRAL = re.compile(r"([a-z])\1(?![a-z])")
USUAL = "a a_ a_1 a_2 a_3 a1 a_u8 a_u16 a_bus a_enum a_flags a_message a_command a_raw a_x".split()  # noqa: SIM905


@cache
def derived() -> list[str]:
    """What targets make of names, with `a` in place of each."""
    found = words.of_generated(NEUTRAL, ["python", "bus", "c", "construct"])
    made = {_NEUTRAL.sub("a", each.removeprefix("plain_")) for each in found if _NEUTRAL.search(each)}
    return sorted({*USUAL, *(each for each in made if re.fullmatch(r"a[a-z0-9_]{0,30}", each))})


def drawn(name: str, rng: random.Random) -> Document:
    """A schema in which every name is one of them."""
    types, messages = rng.sample(derived(), 8), rng.sample(derived(), 7)
    commands = {each: (fields(types, rng), fields(types, rng)) for each in messages[:4]}
    return Document(
        name,
        frame=frame((*rng.sample(derived(), 2), "zc", rng.choice(derived()), "zd", "ze")),
        enums={each: rng.sample(derived(), 2) for each in types[:3]},
        flags={each: rng.sample(derived(), 2) for each in types[3:5]},
        types=types[5:],
        commands={**commands, "zz": ({f"zz{index}": each for index, each in enumerate(types)}, {})},
        messages={each: fields(types, rng) for each in messages[4:]},
    )


def fields(types: Sequence[str], rng: random.Random) -> dict[str, Json]:
    """Up to four fields, those of variable size with a count."""
    made: dict[str, Json] = {}
    for name in rng.sample(derived(), rng.randint(0, 4)):
        kind, count = rng.choice(["u8", "bytes[0..4]", "u16[0..3]", "text[3]", *types]), rng.choice(derived())
        if ".." in kind and {name, count} & {*made} == set() and name != count:
            made[count] = {"type": "u8", "counts": name}
            made[name] = kind
        elif ".." not in kind and name not in made:
            made[name] = kind
    return made


@pytest.mark.parametrize("seed", [1, None])
def test_schemas_accepted_by_lint_compile_and_agree(
    seed: int | None, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    seed = random.SystemRandom().randrange(1 << 32) if seed is None else seed
    print(f"seed {seed}")
    rng, taken = random.Random(seed), []
    for index in range(60):
        document = drawn(f"p{index}", rng)
        protocol, faults = loads(document.text(), f"{document.name}.yaml")
        assert {fault.rule for fault in faults} <= {"name-clash", "part-order"}, faults
        if protocol is not None:
            agree(protocol)
            taken += written(document, "c", tmp_path)
    assert len(taken) > 20
    (tmp_path / "all.c").write_text("".join(f'#include "{name}"\n' for name in taken), "utf-8")
    command = [require_tool("gcc", package="gcc"), "-std=c99", *STRICT, "all.c"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr[:4000]


@pytest.mark.parametrize("group", ["commands", "messages"])
def test_a_command_and_a_message_have_different_names(group: str) -> None:
    """Both would become the same member of the table of handlers."""
    document = Document(commands={"zz": ({}, {})}, messages={"zz" if group == "messages" else "ww": {}})
    _, faults = loads(document.text(), "x.yaml")
    assert [fault.rule for fault in faults] == (["name-clash"] if group == "messages" else [])
