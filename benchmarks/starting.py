"""Starting `qlinkgen encode` and `qlinkgen decode` beside `cantools decode`."""

from __future__ import annotations

import importlib.util
import json
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

from benchmarks import ROOT
from benchmarks.processes import Run, interleave
from benchmarks.report import Goal, Section, number
from qlinkgen.backends.vectors import generate
from qlinkgen.plan import Options
from qlinkgen.schema import find, library, load, shipped

LIMIT = 1.5
PEER = "cantools decode"
MODES = ("encode", "decode")

INTRO = """\
CPU time of a whole process that encodes or decodes one message, over that of `cantools decode` with one frame
and a DBC of one message, all in turns, the best of the rounds. Models of schemas are kept, as they are after
the first command with a schema."""

_DBC = """\
VERSION ""
BU_: Node
BO_ 496 Example: 8 Node
 SG_ speed : 0|16@1+ (0.1,0) [0|6553.5] "m/s" Node
 SG_ place : 16|32@1- (1,0) [0|0] "" Node
"""
_FRAME = " vcan0  1F0   [8]  01 02 03 04 05 06 07 08\n"


def section(rounds: int) -> Section:
    """Processes of all protocols in turns with those of cantools."""
    result = Section("Starting encode and decode", INTRO, ["", *MODES])
    if importlib.util.find_spec("cantools") is None:
        result.missing = ["cantools (not installed)"]
        return result
    names = [*shipped(), *library()]
    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder, "example.dbc")
        table.write_text(_DBC)
        commands = {PEER: _python("cantools", "decode", str(table))}
        commands |= {f"{mode} {name}": each for name in names for mode, each in _commands(name).items()}
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "QLINKGEN_CACHE": folder}
        runs = interleave(commands, rounds, environment, given=_FRAME)
    ratio = {name: run.cpu.best / runs[PEER].cpu.best for name, run in runs.items()}
    result.rows = [_peer(runs[PEER])]
    result.rows += [[name, *(f"{number(ratio[f'{mode} {name}'])} x" for mode in MODES)] for name in names]
    for mode in MODES:
        slowest = max(names, key=lambda name, mode=mode: ratio[f"{mode} {name}"])  # type: ignore[misc]
        what = f"starting {mode}, slowest ({slowest})"
        result.goals.append(Goal(what, ratio[f"{mode} {slowest}"], LIMIT, f"x {PEER}"))
    return result


def _peer(run: Run) -> list[str]:
    return [PEER, "", f"({run.cpu.best * 1e3:.0f} ms)"]


def _python(module: str, *arguments: str) -> list[str]:
    return [sys.executable, "-m", module, *arguments]


def _commands(name: str) -> dict[str, list[str]]:
    """Encode and decode the first vector of a protocol that needs no request."""
    protocol = load(find(name))
    (text,) = generate(protocol, Options()).values()
    vectors: list[dict[str, Any]] = json.loads(text)["vectors"]
    vector = next(each for each in vectors if "request" not in each)
    message = protocol.message(vector["message"])
    left_out = ("kinds", "raw", "payload", "wire")
    given = json.dumps({key: value for key, value in vector.items() if key not in left_out})
    told = ["--direction", message.direction] if message.direction != "message" else []
    told += ["--message", message.name] if protocol.is_turned(message) else []
    return {
        "encode": _python("qlinkgen", "encode", name, "--json", given),
        "decode": _python("qlinkgen", "decode", name, *told, vector["wire"]),
    }
