"""One session of a host with a simulated chip set over a bad line, and its account.

Without frames, faults on the line can turn a packet into other packets; the host notices by the checksum, and
cannot undo it. So the session does what a careful program does: it repeats failed calls, and if the host was
out of step it reads every register back, writes those that differ, and makes all choices again that cannot be
read. The session records each packet sent and carried out, and checks the host with them: no call may have
sent an action twice, and only packets made by the line may have a wrong effect.
"""

from __future__ import annotations

import random
import warnings
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from qlinkgen.codecs import mc1231a
from qlinkgen.errors import LinkError
from qlinkgen.protocols.mc1231a import ChipEngine, ChipSet, Host, UnconfirmedCommand
from qlinkgen.sim import FaultPlan, VirtualPort
from qlinkgen.sim.chip_bus import chip_wire
from tests.soak.host_model import AXES, CHOOSES, FIELD, REGISTERS, Model

#: Host slack in seconds.
SLACK = 0.002
#: Attempts of a call until it counts as failed.
PATIENCE = 200
#: Commands between audits, if one is needed.
AUDIT_EVERY = 500
UNSAFE = {command.id for command in mc1231a.COMMANDS.values() if not command.repeat_safe}
_SIZES = {command.id: command.request.MAX_WIRE_SIZE for command in mc1231a.COMMANDS.values()}
_RULES = {name: mc1231a.COMMANDS[f"set_{name}"].request.RULES[0] for name in REGISTERS}
#: Operations of a session, with their weights.
WEIGHTS = {"write": 45, "read": 30, "choose": 10, "act": 12, "global": 2, "reset": 0.3}
ACTIONS = ("update", "multi_update", "clr_status", "rst_status", "rst_intrpt", "get_capt", "init_phase")


class Tap(VirtualPort):
    """The host's port, with a list of the packets that were sent."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.sent: list[bytes] = []

    def write(self, data: bytes) -> None:
        """As a port."""
        if data[0] in _SIZES:  # else it is a filling byte
            self.sent.append(bytes(data))
        super().write(data)


@dataclass
class Result:
    """The result of a session.

    Attributes:
        commands: calls of the session itself.
        failed: calls that failed and were repeated.
        most_sent: most times that one call sent an action that must not be repeated.
        made_up: packets carried out but never sent: made by the line from others.
        unnoticed: those of them that the host has noticed neither in their call nor at the next one.
        wrong_reads: values changed by the line with a correct checksum.
        explained: wrong values read after a packet made by the line, before the next audit.
        rewritten: registers found changed, and written again.
        complaints: errors found.
        counters: those of the host.
        faults: injected faults.
        seconds: on the virtual clock.
    """

    commands: int = 0
    failed: int = 0
    most_sent: int = 0
    made_up: int = 0
    unnoticed: int = 0
    wrong_reads: int = 0
    explained: int = 0
    rewritten: int = 0
    complaints: list[str] = field(default_factory=list)
    counters: dict[str, Any] = field(default_factory=dict)
    faults: int = 0
    seconds: float = 0.0


class Session:
    """A host, a chip set, and the model of the expected state."""

    def __init__(self, faults: FaultPlan, *, seed: int = 1, forgets: float = 0.0) -> None:
        self.chip = ChipSet(geared=(1, 2))
        self.engine = ChipEngine(self.chip, forgets=forgets, record=True)
        self.faults = faults
        self.port = Tap(chip_wire(self.engine, faults=faults))
        self.host = Host(self.port, slack=SLACK, forgets=forgets)
        self.model = Model()
        self.result = Result()
        self._random = random.Random(f"session {seed}")
        self._dirty = False  # seen by the host: a mismatch since the last audit
        self._unseen = 0  # packets made by the line that may be noticed at the next call
        self._ghosts = False  # seen only here: a packet was carried out that was not sent

    def run(self, commands: int) -> Result:
        """Do `commands`, then synchronise host and chip set, and compare."""
        result = self.result
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UnconfirmedCommand)
            self._begin()
            for number in range(1, commands + 1):
                self._step()
                if number % AUDIT_EVERY == 0 and self._dirty:
                    self.audit()
            self._finish()
        result.commands = commands
        result.counters = self.host.engine.count.as_dict()
        result.faults = self.faults.counts.total
        result.seconds = self.port.now()
        return result

    # One call -----------------------------------------------------------------------------------------------

    def call(self, name: str, *axis: int, **arguments: Any) -> Any:
        """Call until it succeeds: each command here is idempotent."""
        for _ in range(PATIENCE):
            engine = self.host.engine
            before, known = engine.count.out_of_step, not engine.in_step
            self.port.sent.clear()
            try:
                return getattr(self.host, name)(*axis, **arguments)
            except LinkError:
                self.result.failed += 1
            finally:
                noticed = known or engine.count.out_of_step != before
                self._dirty |= noticed
                self._account(name, noticed=noticed)
        raise AssertionError(f"{name} failed {PATIENCE} times")

    def _account(self, name: str, *, noticed: bool) -> None:
        """Compare the packets sent and carried out."""
        sent = Counter(self.port.sent)
        record = self.engine.record
        assert record is not None
        made_up = Counter(record) - sent
        record.clear()
        for packet, count in sent.items():
            if packet[0] in UNSAFE:
                self.result.most_sent = max(self.result.most_sent, count)
                if count > 1:
                    self.result.complaints.append(f"{name} sent {packet.hex(' ')} {count} times")
        if not noticed:
            self.result.unnoticed += self._unseen
        self._unseen = 0 if noticed else made_up.total()
        if made_up:
            self._ghosts = True
            self.result.made_up += made_up.total()

    # Operations of a session --------------------------------------------------------------------------------

    def _begin(self) -> None:
        self.call("reset")
        for axis in AXES:
            self.call("axis_off", axis)

    def _step(self) -> None:
        kind = self._random.choices(list(WEIGHTS), list(WEIGHTS.values()))[0]
        getattr(self, f"_{kind}")(self._random.choice(AXES))

    def _write(self, axis: int) -> None:
        name = self._random.choice(REGISTERS)
        self._put(axis, name, self._value(name))

    def _put(self, axis: int, name: str, value: Any) -> None:
        self.call(f"set_{name}", axis, **{FIELD[name]: value})
        self.model.axes[axis].values[name] = value

    def _value(self, name: str) -> Any:
        """A valid value of the register; no acceleration below 0, since a profile refuses that."""
        rule = _RULES[name]
        if scale := getattr(rule, "scale", None):
            low = 0 if name == "acc" else scale.low
            return scale.value(self._random.randint(low, scale.high))
        if name == "intrpt_mask":
            return self._random.randrange(0x1000)
        low, high = rule.ranges[0]
        return self._random.randint(low, high)

    def _read(self, axis: int) -> None:
        name = self._random.choice(REGISTERS)
        self._compare(axis, name)

    def _compare(self, axis: int, name: str) -> bool:
        before = self.faults.counts.total
        value = getattr(self.call(f"get_{name}", axis), FIELD[name])
        wanted = self.model.axes[axis].values[name]
        if value == wanted:
            return True
        if self._ghosts:
            self.result.explained += 1
        elif self.faults.counts.total != before:
            self.result.wrong_reads += 1
        else:
            self.result.complaints.append(f"axis {axis}: {name} reads {value}, not {wanted}")
        return False

    def _choose(self, axis: int) -> None:
        self._select(axis, self._random.choice(list(CHOOSES)))

    def _select(self, axis: int, command: str) -> None:
        self.call(command, axis)
        self.model.axes[axis].chosen[CHOOSES[command]] = command

    def _act(self, axis: int) -> None:
        action = self._random.choice(ACTIONS)
        if action == "multi_update":
            axes = self._random.randrange(4)
            self.call(action, axes=axes)
            self._updated(*(each for each in AXES if axes >> (each - 1) & 1))
        elif action == "rst_intrpt":
            self.call(action, mask=self._random.randrange(0x1000))
        elif action == "rst_status":
            self.call(action, axis, mask=self._random.randrange(0x1000))
        else:
            self.call(action, axis)
            if action == "update":
                self._updated(axis)

    def _updated(self, *axes: int) -> None:
        for axis in axes:
            self.model.axes[axis].update()

    def _global(self, axis: int) -> None:
        del axis
        if self._random.random() < 0.5:
            self.call(
                self._random.choice(("get_time", "get_vrsn", "get_home", "get_lmt_swtch", "get_intrpt"))
            )
            return
        self.model.output = self._random.choice((mc1231a.OutputMode.PWM, mc1231a.OutputMode.DAC16))
        self._choose_output()

    def _choose_output(self) -> None:
        self.call("set_output_dac16" if self.model.output else "set_output_pwm")

    def _reset(self, axis: int) -> None:
        del axis
        self._begin()
        self.model = Model()

    # Audit --------------------------------------------------------------------------------------------------

    def audit(self) -> bool:
        """Read back all readable registers, correct those that differ, and repeat all other choices.

        True if nothing differed, and the host was in step all the time.
        """
        self._dirty = False
        agreed = True
        for number, axis in self.model.axes.items():
            self.call("axis_off", number)
            for command in axis.chosen.values():
                self.call(command, number)
            for name in REGISTERS:
                if not self._compare(number, name):
                    agreed = False
                    self.result.rewritten += 1
                    self._put(number, name, axis.values[name])
        self._choose_output()
        if agreed and not self._dirty:
            self._ghosts = False
        return agreed and not self._dirty

    def _finish(self) -> None:
        """Audit until nothing differs and no event occurs meanwhile; then compare with the chip set."""
        for _ in range(PATIENCE * 10):
            for axis in AXES:
                self.call("update", axis)
                self._updated(axis)
            if self.audit():
                break
        else:
            self.result.complaints.append("host and chip set do not agree after all audits")
        self.result.complaints += self.model.differences(self.chip)
