"""The numbers of the hand-written behaviour come from the schema, and what it needs is checked at once.

Each test runs the behaviour with modules generated from another schema, in a process of its own.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from qlinkgen.backends.base import Options
from qlinkgen.cli.targets import TARGETS
from qlinkgen.schema import find, loads
from tests.cli.test_boundary import ENVIRONMENT

#: Makes the generated modules of a folder those of the protocol, before its behaviour is imported.
LOADER = """
import importlib, importlib.util, sys
from pathlib import Path
import qlinkgen.codecs
from qlinkgen.errors import UnsuitableSchema
_, folder, protocol = sys.argv
for name in (protocol, protocol + "_bus"):
    where = Path(folder, name + ".py")
    if where.exists():
        spec = importlib.util.spec_from_file_location("qlinkgen.codecs." + name, where)
        module = importlib.util.module_from_spec(spec)
        sys.modules[spec.name] = module
        setattr(qlinkgen.codecs, name, module)
        spec.loader.exec_module(module)
"""

WIDE_COUNTERS = """
from qlinkgen.protocols.qlink.bus_state import BusState
from qlinkgen.protocols.qlink.motion import MotionState
from qlinkgen.protocols.qlink import Bus, VirtualNode
from qlinkgen.codecs import qlink
from qlinkgen.link import SlaveEngine
from qlinkgen.sim import VirtualPort, Wire
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
wire = Wire(baud=115200)
wire.attach(SlaveEngine(qlink, node))
text = b":00000001FF" + b"\\r\\n"
report = Bus(VirtualPort(wire)).load(1, 150 * b":020000021000EC\\r\\n" + text, piece=10)
print(report.pieces, node.program is not None)
"""

FEWER_LINES = """
from qlinkgen.protocols.qlink import VirtualNode
from qlinkgen.codecs import qlink
node = VirtualNode(1, position_type=5)
print(int(node.position_type), node.position_valid)
for inputs in (0xFFFF, 0x10000):
    try:
        node.inputs = inputs
        print(hex(node.inputs))
    except ValueError as error:
        print(error)
print(VirtualNode(1, position_type=2).position_valid)
"""

IMPORT = """
try:
    importlib.import_module("qlinkgen.protocols." + protocol)
except UnsuitableSchema as error:
    print(error)
"""


def run_with(folder: Path, protocol: str, code: str, *changes: tuple[str, str]) -> str:
    """Return what a program prints with modules from the schema of a protocol, changed."""
    text = find(protocol).read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    model, faults = loads(text, f"{protocol}.yaml")
    assert model is not None, faults
    for target in ("python", "bus"):
        for path, output in TARGETS[target].load()(model, Options()).items():
            (folder / Path(path).name).write_text(output, encoding="utf-8")
    command = [sys.executable, "-c", LOADER + code, str(folder), protocol]
    done = subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, check=False)
    assert not done.stderr
    return done.stdout


def test_counters_of_two_bytes_wrap_where_they_end(tmp_path: Path) -> None:
    changes = (("counter: {type: u8", "counter: {type: u16"), ("size: 0..26", "size: 0..27"))
    printed = run_with(tmp_path, "qlink", WIDE_COUNTERS, *changes)
    assert printed == "255 256 65535 0\n256\n0\n65278 1\n257 True\n"


def test_inputs_outputs_and_position_types_are_those_of_the_schema(tmp_path: Path) -> None:
    printed = run_with(
        tmp_path, "qlink", FEWER_LINES, ("u24", "u16"), ("metronix: {value: 2", "metronix: {value: 5")
    )
    refused = "inputs=65536 must be an integer from 0 to 65535"
    assert printed.splitlines() == ["5 True", "0xffff", refused, "False"]


@pytest.mark.parametrize(
    ("protocol", "old", "new", "said"),
    [
        ("qlink", "segments: {", "words: {", "has no segments"),
        (
            "qlink",
            "fifo_space: {type: u8",
            "fifo_space: {type: i8",
            "hold the whole numbers from 0 to a limit",
        ),
        (
            "qlink",
            'segments: {type: "u16[0..12]"',
            "segments: {type: u16",
            "segments must hold several items",
        ),
        ("qlink", "  baud: 115200\n", "", "the bus does not state baud"),
        ("qlink", "running: {bit: 0", "moving: {bit: 0", "motor_status has no running"),
        ("qlink", "position_type", "way", "the schema has no enum or flags position_type"),
        ("trio", "characters:", "letters:", "character_transfer has no characters"),
        ("trio", "  keypad_offset:", "  offset_of_keypad:", "has no keypad_offset"),
        ("trio", "on_off:", "both:", "keypad_mode has no on_off"),
        ("mc1231a", "set_1", "set_first", "has no set_1.request"),
        ("mc1231a", "axis", "shaft", "commands have no attribute axis"),
        ("mc1231a", "motion_error: 4", "error: 4", "axis_status has no motion_error"),
        ("mc1231a", "axis_status", "status_of_axis", "has no enum or flags axis_status"),
        ("mc1231a", "  mtr_off:", "  mtr_disable:", "command mtr_disable, which"),
        ("mc1231a", "  get_vrsn:", "  get_version:", "command get_version, which"),
    ],
)
def test_a_schema_without_what_is_needed_is_refused_in_one_sentence(
    tmp_path: Path, protocol: str, old: str, new: str, said: str
) -> None:
    printed = run_with(tmp_path, protocol, IMPORT, (old, new))
    assert said in printed
    for line in printed.splitlines():
        assert line.startswith(f"schemas/{protocol}.yaml: ")
        assert line.endswith("; change both together")
        assert f", which qlinkgen/protocols/{protocol} " in line
