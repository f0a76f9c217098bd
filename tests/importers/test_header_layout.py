"""Layouts of random structures, compared with those of a compiler byte by byte."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from random import Random

import pytest

from qlinkgen.errors import ImportFileError
from qlinkgen.importers.document import Notation, Value
from qlinkgen.importers.header import read_header
from qlinkgen.importers.notes import Notes

NUMBERS = ("uint8_t", "int8_t", "uint16_t", "int16_t", "uint32_t", "int32_t", "uint64_t", "int64_t", "bool")
SIZES = {"float": 4, "double": 8, "char": 1, "unsigned short": 2, "int": 4, "long long": 8}


def member(random: Random, name: str) -> str:
    match random.randrange(6):
        case 0:
            return f"{random.choice(NUMBERS)} {name}[{random.randint(1, 5)}];"
        case 1:
            return f"{random.choice([*SIZES])} {name};"
        case 2:
            return f"struct {{ {random.choice(NUMBERS)} {name}a; {random.choice(NUMBERS)} {name}b; }};"
        case 3:
            return bit_fields(random, name)
        case _:
            return f"{random.choice(NUMBERS)} {name};"


def bit_fields(random: Random, name: str) -> str:
    bits = random.choice([8, 8, 16, 32])
    kind, left, made = f"uint{bits}_t", bits, list[str]()
    while left > 0 and (left > 7 or random.random() < 0.9):
        width = random.randint(1, left)
        called = f"{name}{len(made)}" if random.random() < 0.8 else ""
        made.append(f"{kind} {called} : {width};")
        left -= width
    return " ".join(made)


def structure(random: Random, name: str) -> str:
    members = " ".join(member(random, f"{'abcdefgh'[at]}x") for at in range(random.randint(1, 6)))
    match random.randrange(4):
        case 0:
            return f"struct __attribute__((packed)) {name} {{ {members} }};"
        case 1:
            pack = random.choice([1, 2, 4])
            return f"#pragma pack(push, {pack})\nstruct {name} {{ {members} }};\n#pragma pack(pop)"
        case _:
            return f"struct {name} {{ {members} }};"


def bytes_of(type_: str) -> int:
    base, _, count = type_.partition("[")
    sizes = {"bool": 1, "bytes": 1, "text": 1}
    size = sizes.get(base) or int(base.lstrip("uif")) // 8
    return size * int(count.rstrip("]") or 1) if count else size


def masks(keys: Mapping[str, Value], at: int) -> Iterator[tuple[str, int]]:
    """Name and mask of each bit field, as a number of the whole structure in little endian."""
    bits = keys["bits"]
    assert isinstance(bits, dict)
    for name, found in bits.items():
        place = found["at"] if isinstance(found, dict) else found
        first, last = (map(int, place.text.split(".."))) if isinstance(place, Notation) else (place, place)
        assert isinstance(first, int)
        assert isinstance(last, int)
        yield name, ((1 << (last + 1)) - (1 << first)) << (8 * at)


@pytest.mark.parametrize("seed", range(3))
def test_layouts(tmp_path: Path, require_tool: Callable[..., str], seed: int) -> None:
    gcc = require_tool("gcc", package="gcc")
    random = Random(seed)
    header = "#include <stdint.h>\n#include <stdbool.h>\n" + "\n".join(
        structure(random, f"s{number}") for number in range(120)
    )
    (tmp_path / "x.h").write_text(header)
    notes = Notes("x.h")
    try:
        found = read_header(tmp_path / "x.h", notes).sections["messages"]
    except ImportFileError:
        pytest.fail("nothing was taken")
    assert len(found) > 60, [str(each) for each in notes.found]
    lines: list[str] = []
    expected: list[int] = []
    for message in found:
        at = 0
        for each in message.fields:  # type: ignore[union-attr]
            size = bytes_of(each.type)
            if "bits" in each.keys:
                for name, mask in masks(each.keys, at):
                    lines.append(f"  all_ones(struct {message.name}, {name});")
                    expected.append(mask)
            elif "reserved" not in each.keys:
                lines.append(f"  place(offsetof(struct {message.name}, {each.name}));")
                expected.append(at)
            at += size
        lines.append(f"  place(sizeof(struct {message.name}));")
        expected.append(at)
    program = PROGRAM.replace("LINES", "\n".join(lines))
    (tmp_path / "main.c").write_text(program)
    subprocess.run([gcc, "-w", "-o", tmp_path / "main", tmp_path / "main.c"], check=True)
    said = subprocess.run([tmp_path / "main"], check=True, capture_output=True, text=True).stdout.split()
    assert [int(each, 16) for each in said] == expected


PROGRAM = """\
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include "x.h"
static void place(size_t value) { printf("%zx\\n", value); }
static void bytes(const void *data, size_t size) {
  while (size--) printf("%02x", ((const unsigned char *)data)[size]);
  printf("\\n");
}
#define all_ones(type, name) \\
  do { type s; memset(&s, 0, sizeof s); s.name = ~0ull; bytes(&s, sizeof s); } while (0)
int main(void) {
LINES
  return 0;
}
"""
