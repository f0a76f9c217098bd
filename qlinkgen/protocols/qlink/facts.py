"""What the procedures and the virtual node need from the schema, all read from the generated module."""

from __future__ import annotations

from typing import Final

from qlinkgen.codecs import qlink
from qlinkgen.protocols.needs import Needs

_NEEDS: Final = Needs("schemas/qlink.yaml", "qlinkgen/protocols/qlink")
_NEEDS.fields(
    qlink.MESSAGES,
    {
        "node_setup.request": "node node_number t1_delay t2_delay position_type",
        "node_setup.response": "node",
        "node_info.response": (
            "version_major version_minor product_id t1_delay t2_delay position_type serial_number"
        ),
        "node_start.request": "node",
        "node_stop.request": "node",
        "node_sync.request": "counter",
        "node_program_load.request": "counter program_data",
        "node_program_load.response": "counter",
        "node_reset.request": "node",
        "motor_response_poll.response": "last_completion motor_data",
        "motor_request.request": "motor_data",
        "motion.request": "counter outputs segments",
        "motion.response": "counter inputs position motor_status fifo_space",
        "motor_position.response": "position",
        "clear_fifo.request": "node",
        "preset_motor_position.request": "position",
        "read.request": "size offset",
        "read.response": "data",
        "write.request": "offset data",
        "write_read.request": "outputs",
        "write_read.response": "inputs",
        "set_outputs.request": "mask",
        "clear_outputs.request": "mask",
        "loop_back.request": "offset data",
        "loop_back.response": "offset data",
    },
)
_NEEDS.names(qlink, {"PositionType": "none", "MotorStatus": "running position_valid"})

BAUD: Final = _NEEDS.bus(qlink.BUS, "baud")
BROADCAST: Final = _NEEDS.bus(qlink.BUS, "broadcast")
NODES: Final = range(_NEEDS.bus(qlink.BUS, "first_node"), _NEEDS.bus(qlink.BUS, "last_node") + 1)
#: Words that one motion can carry.
WORDS: Final = _NEEDS.items(qlink.MotionRequest, "segments")
#: Bytes of a program's text that one request can carry.
PIECE: Final = _NEEDS.items(qlink.NodeProgramLoadRequest, "program_data")
#: Numbers of motions, syncs and pieces of a program.
MOTIONS: Final = _NEEDS.cycle(qlink.MotionRequest, "counter")
SYNCS: Final = _NEEDS.cycle(qlink.NodeSyncRequest, "counter")
PIECES: Final = _NEEDS.cycle(qlink.NodeProgramLoadRequest, "counter")
#: Mask of all inputs, or of all outputs.
LINES: Final = _NEEDS.number(qlink.WriteReadRequest, "outputs")
#: Masks of the outputs and inputs that a motion carries.
MOTION_OUTPUTS: Final = _NEEDS.number(qlink.MotionRequest, "outputs")
MOTION_INPUTS: Final = _NEEDS.number(qlink.MotionResponse, "inputs")
#: Words of a FIFO that a node can report as free.
MOST_SPACE: Final = _NEEDS.number(qlink.MotionResponse, "fifo_space")
#: Ways to ask a motor for its position.
POSITION_TYPES: Final = frozenset(qlink.PositionType.members.values()) - {qlink.PositionType.NONE}
#: Largest value of each number that a node states of itself; delays in seconds.
INFO: Final = {
    field: _NEEDS.number(qlink.NodeInfoResponse, field)
    for field in ("version_major", "version_minor", "product_id", "serial_number", "position_type")
}
LONGEST_DELAY: Final = _NEEDS.largest(qlink.NodeSetupRequest, "t1_delay")
