"""What the procedures and the virtual node need from the schema, all read from the generated module."""

from __future__ import annotations

from typing import Final

from qlinkgen.codecs import qlink
from qlinkgen.protocols.needs import Needs

#: Fields by message, and values by enum or flags, that this package uses.
FIELDS: Final = {
    "node_setup.request": "node node_number t1_delay t2_delay position_type",
    "node_setup.response": "node",
    "node_info.request": "node",
    "node_info.response": (
        "version_major version_minor product_id t1_delay t2_delay position_type serial_number"
    ),
    "node_start.request": "node",
    "node_stop.request": "node",
    "node_sync.request": "counter",
    "node_program_load.request": "counter program_data",
    "node_program_load.response": "counter",
    "node_reset.request": "node",
    **dict.fromkeys(("node_reset.response", "motor_request.response", "write.response"), "node"),
    **dict.fromkeys(("clear_fifo.response", "preset_motor_position.response"), "node"),
    **dict.fromkeys(("set_outputs.response", "clear_outputs.response"), "node"),
    **dict.fromkeys(("motor_response_poll.request", "motor_position.request"), "node"),
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
}
ENUMS: Final = {"position_type": "none jvl_mactalk", "motor_status": "running position_valid"}
_NEEDS: Final = Needs(qlink, "qlinkgen/protocols/qlink")
_NEEDS.check(FIELDS, enums=ENUMS)

BAUD: Final = _NEEDS.bus("baud")
BROADCAST: Final = _NEEDS.bus("broadcast")
NODES: Final = range(_NEEDS.bus("first_node"), _NEEDS.bus("last_node") + 1)
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
