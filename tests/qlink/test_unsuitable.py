"""The numbers of the procedures and of the virtual node come from the schema.

Each test runs them with modules generated from another schema, in a process of its own.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from qlinkgen.schema import find
from tests.cli.test_boundary import COMMAND, ENVIRONMENT

#: Makes the generated modules of a folder those of the protocol, before its behaviour is imported.
LOADER = """
import importlib.util, sys
from pathlib import Path
def replace(name):
    where = Path(sys.argv[1], name + ".py")
    spec = importlib.util.spec_from_file_location("qlinkgen.codecs." + name, where)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    import qlinkgen.codecs
    setattr(qlinkgen.codecs, name, module)
    spec.loader.exec_module(module)
replace("qlink")
replace("qlink_bus")
"""

WIDE_COUNTERS = (
    LOADER
    + """
from qlinkgen.protocols.qlink.bus_state import BusState
from qlinkgen.protocols.qlink.motion import MotionState
from qlinkgen.protocols.qlink import VirtualNode
from qlinkgen.codecs import qlink
state = BusState()
print(state.next_sync(255), state.next_sync(None), state.next_sync(65535), state.next_sync(None))
motion = MotionState()
for counter in (255, 65535):
    motion.settled(qlink.MotionRequest(node=1, counter=counter))
    print(motion.counter)
node = VirtualNode(1)
for counter in (255, 256, 65535, 0):
    node.handle(qlink.NodeSyncRequest(node=0, counter=counter), 0.0)
    node.handle(qlink.MotionRequest(node=1, counter=counter), 0.0)
print(node.statistics.missed_syncs, node.statistics.jumps)
"""
)

IMPORT = (
    LOADER
    + """
from qlinkgen.errors import UnsuitableSchema
try:
    import qlinkgen.protocols.qlink
except UnsuitableSchema as error:
    print(error)
"""
)


def run_with(folder: Path, code: str, *changes: tuple[str, str]) -> str:
    """Return what a program prints with modules from the schema of Q.link, changed."""
    text = Path(find("qlink")).read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    schema = folder / "qlink.yaml"
    schema.write_text(text, encoding="utf-8")
    targets = ("--target", "python", "--target", "bus")
    run_here([*COMMAND, "generate", str(schema), *targets, "--output", str(folder / "out")])
    (module,) = (folder / "out").rglob("qlink.py")
    return run_here([sys.executable, "-c", code, str(module.parent)])


def run_here(command: list[str]) -> str:
    return subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, check=True).stdout


def test_counters_of_two_bytes_wrap_where_they_end(tmp_path: Path) -> None:
    printed = run_with(
        tmp_path, WIDE_COUNTERS, ("counter: {type: u8", "counter: {type: u16"), ("size: 0..26", "size: 0..27")
    )
    assert printed == "255 256 65535 0\n256\n0\n65278 1\n"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("segments: {", "words: {", "has no segments"),
        (
            "fifo_space: {type: u8",
            "fifo_space: {type: i8",
            "fifo_space must hold the whole numbers from 0 to a limit",
        ),
        ('segments: {type: "u16[0..12]"', "segments: {type: u16", "segments must hold several items"),
        ("  baud: 115200\n", "", "does not state baud of the bus"),
    ],
)
def test_a_schema_without_what_is_needed_is_refused_in_one_sentence(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    printed = run_with(tmp_path, IMPORT, (old, new))
    assert printed.startswith("schemas/qlink.yaml ")
    assert said in printed
    assert printed.endswith(", which qlinkgen/protocols/qlink needs; change both together\n")
