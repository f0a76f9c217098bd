"""The generator as a whole process: all protocols and targets, and growth with the size of the schema."""

from __future__ import annotations

import os
import random
import sys
import tempfile
from pathlib import Path

from benchmarks import ROOT
from benchmarks.processes import Run, interleave
from benchmarks.report import Goal, Section, number

SIZES = (125, 250, 500, 1000)
LIMIT_SECONDS = 2.0
LIMIT_GROWTH = 2.2  # twice the messages; linear growth is 2, less what starting up costs

INTRO = """\
`qlinkgen generate` from start to exit, all targets, best of the rounds. *x messages*: a synthetic schema
of x messages of one to six fields (integers, enums, scaled values, arrays). Growth is linear if twice the
messages take at most twice the time."""

HEAD = """\
qlinkgen: 1
protocol: {name: synthetic, title: Synthetic, revision: "1", source: made up, doc: As large as asked for.}
byteorder: big
enums:
  mode: {type: u8, doc: What to do., values: {idle: 0, run: 1, halt: 2}}
frame:
  parts:
    preamble: {role: constant, value: A5 A5}
    length: {role: length, type: u8, counts: [command, node, data, crc]}
    command: {role: message, type: u16}
    node: {role: address, type: u8}
    data: {role: payload, size: 0..26}
    crc: {role: checksum, type: u16, algorithm: crc-16/ibm-3740, over: [length, command, node, data]}
  stuffing: {after: 0xA5, insert: 0x00, exempt: [preamble]}
bus:
  {kind: master_slave, nodes: 1..16, broadcast: 0, baud: 115200, bits_per_byte: 10, response_within: 3 bytes}
defaults: {addressing: node}
commands:
"""

FIELDS = (
    "{type: u8, doc: A small number}",
    "{type: i32, unit: counts, doc: A place}",
    "{type: u16, range: 1..1000, default: 1, doc: A bounded number}",
    "{type: mode, default: idle, doc: A named number}",
    "{type: u8, scale: 1/10, unit: s, doc: A time}",
    "{type: 'u8[4]', doc: Four bytes}",
)


def synthetic(messages: int, seed: int = 5) -> str:
    """A schema of `messages` messages, two per command; the same text for the same number."""
    chance = random.Random(seed)
    return HEAD + "".join(_command(i, chance) for i in range(messages // 2))


def _command(i: int, chance: random.Random) -> str:
    request, response = (_fields(chance) for _ in range(2))
    return (
        f"  command_{i}:\n    id: {i + 1}\n    doc: Command number {i}.\n"
        f"    request:\n{request}    response:\n{response}    repeat: safe\n"
    )


def _fields(chance: random.Random) -> str:
    kinds = chance.choices(FIELDS, k=chance.randint(1, 6))
    return "".join(f"      field_{i}: {kind}\n" for i, kind in enumerate(kinds))


def _generate(target: Path, *schemas: str) -> list[str]:
    return [sys.executable, "-m", "qlinkgen", "generate", *schemas, "-o", str(target)]


def section(rounds: int) -> Section:
    """The shipped protocols, then the synthetic ones, in turns; a single round leaves out the large ones."""
    sizes = SIZES if rounds > 1 else SIZES[:3]
    result = Section("Generator", INTRO, ["", "wall", "CPU", "CPU per message"])
    with tempfile.TemporaryDirectory() as folder:
        commands = {"qlink, trio, mc1231a": _generate(Path(folder, "all"))}
        for size in sizes:
            schema = Path(folder, f"synthetic_{size}.yaml")
            schema.write_text(synthetic(size))
            commands[_name(size)] = _generate(Path(folder, f"out_{size}"), str(schema))
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}  # works without an installed qlinkgen
        runs = interleave(commands, rounds, environment, warm=False)
    shipped, *_ = commands
    result.rows = [_row(shipped, runs[shipped], 0), *(_row(_name(s), runs[_name(s)], s) for s in sizes)]
    result.goals = [
        Goal("generate all protocols, all targets", runs[shipped].wall.best, LIMIT_SECONDS, "s"),
        Goal(f"CPU time of {sizes[-1]} messages over {sizes[-2]}", _growth(runs, sizes), LIMIT_GROWTH, "x"),
    ]
    return result


def _name(size: int) -> str:
    return f"{size} messages"


def _growth(runs: dict[str, Run], sizes: tuple[int, ...]) -> float:
    """Time ratio of the two largest schemas, one with twice the messages of the other."""
    half, whole = (runs[_name(size)].cpu.best for size in sizes[-2:])
    return whole / half


def _row(name: str, run: Run, size: int) -> list[str]:
    per_message = f"{run.cpu.best / size * 1e3:.2f} ms" if size else ""
    return [name, f"{number(run.wall.best)} s", f"{number(run.cpu.best)} s", per_message]
