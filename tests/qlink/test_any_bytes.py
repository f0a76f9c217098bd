"""For any traffic, a call ends within its worst case, with the right answer or a LinkError."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qlinkgen.codecs import qlink
from qlinkgen.errors import BadReply, LinkError
from qlinkgen.link import EchoMode, SlaveEngine
from qlinkgen.protocols.qlink import Bus
from qlinkgen.sim import VirtualPort, Wire
from tests.qlink.behaviour_rig import Probe

SLACK = 0.003
ANSWER = qlink.MotorPositionResponse(node=2, position=0x5AA5).to_frame()
PIECES = st.one_of(
    st.binary(max_size=40),
    st.sampled_from([b"\xa5", b"\xa5\xa5", b"\xa5\xa5\x1e", b"\0", ANSWER, ANSWER[:5], ANSWER[5:]]),
    st.builds(lambda node: qlink.ClearFifoResponse(node=node).to_frame(), st.integers(1, 16)),
)
#: Bursts: seconds since the previous one, and the bytes.
BURSTS = st.lists(st.tuples(st.floats(0, 0.02), PIECES), max_size=25)
CALLS: list[tuple[str, Callable[[Bus], object]]] = [
    ("motor_position", lambda bus: bus.motor_position(1)),
    ("clear_fifo", lambda bus: bus.clear_fifo(1)),
    ("read", lambda bus: bus.read(1, size=26)),
    ("motor_request", lambda bus: bus.motor_request(1, motor_data=b"x")),
    ("node_program_load", lambda bus: bus.node_program_load(1)),
    ("node_stop", lambda bus: bus.node_stop(0)),
    ("node_info", lambda bus: bus.node_info(0)),
]


class Babbler:
    """A station that sends given bytes, and ignores the line."""

    def __init__(self, bursts: list[tuple[float, bytes]]) -> None:
        self._bursts: list[tuple[float, bytes]] = []
        at = 0.0
        for pause, data in bursts:
            at += pause
            if data:
                self._bursts.append((at, data))

    def receive(self, data: bytes, now: float) -> None:
        pass

    def bytes_to_send(self, now: float) -> bytes:
        return self._bursts.pop(0)[1] if self._bursts and self._bursts[0][0] <= now else b""

    def next_timer(self) -> float | None:
        return self._bursts[0][0] if self._bursts else None


def worst_case(bus: Bus, command: str, attempts: int | None = None) -> float:
    return bus.engine.timing.worst_case(qlink.COMMANDS[command], attempts)


@settings(max_examples=150)
@given(
    BURSTS,
    st.lists(st.sampled_from(CALLS), min_size=1, max_size=4),
    st.sampled_from(["none", "expect", "auto"]),
)
def test_random_bytes(
    bursts: list[tuple[float, bytes]], calls: list[tuple[str, Callable[[Bus], object]]], echo: EchoMode
) -> None:
    node = Probe(serial_number=1)
    wire = Wire(baud=115200, echo=echo != "none", chunks="random")
    wire.attach(SlaveEngine(qlink, node))
    wire.attach(Babbler(bursts))
    with Bus(VirtualPort(wire), echo=echo, health=None, slack=SLACK) as bus:
        for command, call in calls:
            began = bus.port.now()
            try:
                answer = call(bus)
            except LinkError:
                pass
            else:
                if answer is not None:
                    assert answer.node == 1  # type: ignore[attr-defined]
                    name = f"{command}.request"
                    assert any(name == each.NAME for each in node.heard), (
                        "only received requests are answered"
                    )
            assert bus.port.now() - began <= worst_case(bus, command) + 1e-9


@pytest.mark.parametrize(
    "unit",
    [
        b"\0",
        b"\xa5",
        b"\xa5\xa5",
        b"\xa5\0",
        b"\xff",
        b"\xa5\xa5\x1e\x21\x01",
        ANSWER,
        ANSWER[:-1],
        b"\xa5\xa5\x04\x21",
    ],
    ids=lambda unit: unit.hex(),
)
@pytest.mark.parametrize("collisions", [False, True])
@pytest.mark.parametrize("echo", ["none", "expect", "auto"])
def test_an_endless_flood(unit: bytes, collisions: bool, echo: EchoMode) -> None:
    wire = Wire(baud=115200, chunks="byte", collisions=collisions)
    wire.attach(SlaveEngine(qlink, Probe()))
    wire.attach(Babbler([(0.0, unit * (60_000 // len(unit)))]))
    with Bus(VirtualPort(wire), echo=echo, health=None, slack=SLACK) as bus:
        for command, call in CALLS:
            began = bus.port.now()
            outcome: object = None
            try:
                outcome = call(bus)
            except LinkError as error:
                outcome = error
            if command != "node_stop" and collisions:
                assert isinstance(outcome, LinkError), "nothing gets through a flood"
            assert bus.port.now() - began <= worst_case(bus, command) + 1e-9


def test_a_flood_that_ends_leaves_a_usable_bus() -> None:
    wire = Wire(baud=115200, chunks="byte")
    wire.attach(SlaveEngine(qlink, Probe()))
    wire.attach(Babbler([(0.0, b"\xa5\xa5\x1e" * 1000)]))
    with Bus(VirtualPort(wire), echo="none", slack=SLACK, health=None) as bus:
        with pytest.raises(LinkError):
            bus.motor_position(1)
        with pytest.raises(BadReply, match="never became idle"):
            bus.motor_position(1)
        bus.port.sleep(1.0)
        assert bus.motor_position(1).position == 0
