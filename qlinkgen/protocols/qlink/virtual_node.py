"""A simulated Q.link node: every command of the document, with time as an argument.

Assumptions where the document is silent (those on its parts are in their modules):

* Power-up and reset leave a node stopped: it fills its FIFO and holds it until node_start, so that a
  broadcast starts all nodes at the same time. `started=True` makes a node that moves at once.
* The motor runs (status bit 0) while it is started and has path words. A preset during that is not answered
  and changes nothing; a started motor without words accepts it.
* Without a position type, or with an unknown number, a node has no position: it sends 0 and leaves the valid
  bit clear. The motor moves all the same, and a preset is accepted.
* A motion with more words than fit is not taken, not even in part, and not answered: an answer would tell the
  master that its path is queued. Its repeat is taken once there is room. Any counter except that of the last
  motion taken is new.
* motor_response_poll reports 0x16, the command number of motor_request; 0 before the first completion.
* read reads inputs and write writes outputs. motion writes outputs 1 to 8 and keeps the others.
* Missed syncs are counted from the first sync; one with the same counter again is a repeat.
* A reset empties the FIFO, clears the outputs, and discards the counters and the motor's request. Number,
  settings, program and the position of the motor are kept.
"""
# ruff: noqa: ARG002 -- all handlers have the same arguments

from __future__ import annotations

from qlinkgen.codecs import qlink
from qlinkgen.codecs.qlink_bus import SlaveHandlers
from qlinkgen.protocols.qlink.facts import MOTION_INPUTS, MOTION_OUTPUTS, MOTIONS, SYNCS
from qlinkgen.protocols.qlink.node_state import NodeState
from qlinkgen.protocols.qlink.path_fifo import wrapped


class VirtualNode(NodeState, SlaveHandlers):
    """One node. Subclasses override the methods of commands.

    Arguments and attributes are those of `NodeState`.
    """

    _motion_counter: int | None = None
    _sync_counter: int | None = None

    def handle(self, request: qlink.Message, now: float) -> qlink.Message | None:
        """Execute a request.

        Args:
            request: a received request, for any node.
            now: time in seconds.

        Returns:
            The response; None if the command has none, is not supported, or is for another node.
        """
        command, _, direction = request.NAME.partition(".")
        if direction != "request" or request.node not in {self.number, qlink.BUS.broadcast}:
            return None
        now = self.advance(now)
        self.statistics.requests += 1
        if command in self.unsupported:
            self.statistics.unsupported += 1
            return None
        return super().handle(request, now)

    # Node (7.1 to 7.7) --------------------------------------------------------------------------------------

    def node_setup(self, request: qlink.NodeSetupRequest, now: float) -> qlink.NodeSetupResponse | None:
        """Set number and settings; answer with the new number (section 7.1; docs/qlink.md, 13)."""
        self.number = request.node_number
        self.t1_delay, self.t2_delay = request.t1_delay, request.t2_delay
        self.position_type = request.position_type
        return qlink.NodeSetupResponse(node=self.number)

    def node_info(self, request: qlink.NodeInfoRequest, now: float) -> qlink.NodeInfoResponse | None:
        """Return firmware, product and settings (section 7.2)."""
        major, minor = self.version
        return qlink.NodeInfoResponse(
            node=self.number,
            version_major=major,
            version_minor=minor,
            product_id=self.product_id,
            t1_delay=self.t1_delay,
            t2_delay=self.t2_delay,
            position_type=self.position_type,
            serial_number=self.serial_number,
        )

    def node_start(self, request: qlink.NodeStartRequest, now: float) -> None:
        """Start consuming path words (section 7.3)."""
        self.path.start(self.advance(now))

    def node_stop(self, request: qlink.NodeStopRequest, now: float) -> None:
        """Hold the path words (section 7.4)."""
        self.advance(now)
        self.path.stop()

    def node_sync(self, request: qlink.NodeSyncRequest, now: float) -> None:
        """Count the sync, and missing ones before it (section 7.5)."""
        counts = self.statistics
        counts.syncs += 1
        if self._sync_counter == request.counter:
            counts.repeated_syncs += 1
        elif self._sync_counter is not None:
            counts.missed_syncs += SYNCS.between(self._sync_counter, request.counter)
        self._sync_counter = request.counter

    def node_program_load(
        self, request: qlink.NodeProgramLoadRequest, now: float
    ) -> qlink.NodeProgramLoadResponse | None:
        """Open a load or store a piece of one (section 7.6)."""
        if not self.store.take(request.counter, bytes(request.program_data)):
            return None
        return qlink.NodeProgramLoadResponse(node=self.number, counter=request.counter)

    def node_reset(self, request: qlink.NodeResetRequest, now: float) -> qlink.NodeResetResponse | None:
        """Answer, and reset the node (section 7.7)."""
        self.advance(now)
        self.statistics.resets += 1
        self.reset()
        self._motion_counter = self._sync_counter = None
        return qlink.NodeResetResponse(node=self.number)

    # Motor (7.8 to 7.13) ------------------------------------------------------------------------------------

    def motor_response_poll(
        self, request: qlink.MotorResponsePollRequest, now: float
    ) -> qlink.MotorResponsePollResponse | None:
        """Return whether the motor's request is completed, and its answer (section 7.8)."""
        completed, data = self.motor.poll(self.advance(now))
        return qlink.MotorResponsePollResponse(node=self.number, last_completion=completed, motor_data=data)

    def motor_request(
        self, request: qlink.MotorRequestRequest, now: float
    ) -> qlink.MotorRequestResponse | None:
        """Pass a request to the motor (section 7.9)."""
        self.statistics.motor_requests += 1
        if self.motor.take(request.ID, bytes(request.motor_data), self.advance(now)):
            self.statistics.replaced_motor_requests += 1
        return qlink.MotorRequestResponse(node=self.number)

    def motion(self, request: qlink.MotionRequest, now: float) -> qlink.MotionResponse | None:
        """Queue path words and write outputs 1 to 8, unless it is a repeat (section 7.10)."""
        now = self.advance(now)
        if request.counter == self._motion_counter:
            self.statistics.duplicates += 1
            if self.silent_repeats:
                return None
        elif not self._take_motion(request, now):
            return None
        return qlink.MotionResponse(
            node=self.number,
            counter=request.counter,
            inputs=self.io.inputs & MOTION_INPUTS,
            position=self._told_position(),
            motor_status=self._motor_status(),
            fifo_space=self.path.space,
        )

    def motor_position(
        self, request: qlink.MotorPositionRequest, now: float
    ) -> qlink.MotorPositionResponse | None:
        """Return the motor's position (section 7.11)."""
        self.advance(now)
        return qlink.MotorPositionResponse(node=self.number, position=self._told_position())

    def clear_fifo(self, request: qlink.ClearFifoRequest, now: float) -> qlink.ClearFifoResponse | None:
        """Discard the queued path words; the next motion is new (section 7.12)."""
        self.advance(now)
        self.path.clear()
        self._motion_counter = None
        return qlink.ClearFifoResponse(node=self.number)

    def preset_motor_position(
        self, request: qlink.PresetMotorPositionRequest, now: float
    ) -> qlink.PresetMotorPositionResponse | None:
        """Set the motor's position, unless it runs (section 7.13)."""
        self.advance(now)
        if self.path.running:
            self.statistics.refused_presets += 1
            return None
        self.path.position = wrapped(request.position)
        return qlink.PresetMotorPositionResponse(node=self.number)

    # Inputs and outputs (7.14 to 7.18) ----------------------------------------------------------------------

    def read(self, request: qlink.ReadRequest, now: float) -> qlink.ReadResponse | None:
        """Read bytes of the inputs (section 7.14)."""
        self.advance(now)
        return qlink.ReadResponse(node=self.number, data=self.io.read_bytes(request.size, request.offset))

    def write(self, request: qlink.WriteRequest, now: float) -> qlink.WriteResponse | None:
        """Write bytes of the outputs (section 7.15)."""
        self.advance(now)
        self.io.write_bytes(request.offset, bytes(request.data))
        return qlink.WriteResponse(node=self.number)

    def write_read(self, request: qlink.WriteReadRequest, now: float) -> qlink.WriteReadResponse | None:
        """Write all outputs and read all inputs (section 7.16)."""
        self.advance(now)
        self.io.write(request.outputs)
        return qlink.WriteReadResponse(node=self.number, inputs=self.io.inputs)

    def set_outputs(self, request: qlink.SetOutputsRequest, now: float) -> qlink.SetOutputsResponse | None:
        """Set the outputs of a mask (section 7.17)."""
        self.advance(now)
        self.io.write(request.mask, request.mask)
        return qlink.SetOutputsResponse(node=self.number)

    def clear_outputs(
        self, request: qlink.ClearOutputsRequest, now: float
    ) -> qlink.ClearOutputsResponse | None:
        """Clear the outputs of a mask (section 7.18)."""
        self.advance(now)
        self.io.write(0, request.mask)
        return qlink.ClearOutputsResponse(node=self.number)

    def loop_back(self, request: qlink.LoopBackRequest, now: float) -> qlink.LoopBackResponse | None:
        """Return the received data (section 7.19)."""
        return qlink.LoopBackResponse(node=self.number, offset=request.offset, data=request.data)

    # What a motion does -------------------------------------------------------------------------------------

    def _take_motion(self, request: qlink.MotionRequest, now: float) -> bool:
        """Take a new motion, completely or not at all. Return whether it was taken."""
        counts = self.statistics
        if not self.path.push(request.segments, now):
            counts.overruns += 1
            return False
        if self._motion_counter is not None and request.counter != MOTIONS.after(self._motion_counter):
            counts.jumps += 1
        self._motion_counter = request.counter
        self.io.write(request.outputs, MOTION_OUTPUTS)
        counts.motions += 1
        counts.words += len(request.segments)
        if self.record is not None:
            self.record.add(request.segments, now)
        return True

    def _told_position(self) -> int:
        return self.position if self.position_valid else 0

    def _motor_status(self) -> int:
        running = qlink.MotorStatus.RUNNING if self.running else 0
        return running | (qlink.MotorStatus.POSITION_VALID if self.position_valid else 0)
