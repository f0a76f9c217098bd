"""The master's runtime on the serial port of each firmware, compared with a virtual node."""

from __future__ import annotations

import asyncio
import contextlib
import random
from collections.abc import Iterator
from typing import Any, cast

import pytest

from qlinkgen.codecs import qlink
from qlinkgen.errors import NoReply
from qlinkgen.link import SlaveEngine
from qlinkgen.protocols.qlink import AsyncBus, Bus, VirtualNode
from qlinkgen.sim import VirtualPort, Wire
from qlinkgen.transport import Port
from tests.firmware.firmware import TARGETS
from tests.firmware.fixtures import FirmwareLines
from tests.firmware.node import FirmwareNode
from tests.qlink.behaviour_drivers import AsBlocking

ROUNDS = 12
#: Seconds of host slack on the real port: no answer is late, however busy this machine is.
SLACK = 5.0
SETTINGS: dict[str, Any] = {
    "capacity": 40,
    "rate": 0,
    "position_type": 1,
    "serial_number": 0xA5A5,
    "motor_seconds": 0.0,
}
HEX = b":04000000A5A500FFB3\r\n:00000001FF\r\n"


def session(bus: Bus, seed: int) -> Iterator[object]:
    """Call everything; the results depend only on the node."""
    chance = random.Random(seed)
    yield bus.node_setup(1, node_number=4, t1_delay=1.5, t2_delay=25.5, position_type=2)
    yield bus.node_setup(4, node_number=3, t1_delay=0.0, t2_delay=0.0, position_type=2)
    for _ in range(ROUNDS):
        data = chance.choice((b"\xa5\x00\xa5", chance.randbytes(25)))
        yield bus.node_info(0)
        bus.node_sync()
        yield bus.preset_motor_position(3, position=chance.randrange(-(2**31), 2**31))
        bus.node_start(0)
        yield [bus.motion(3, outputs=chance.randrange(256), segments=[each, 0xA5A5]) for each in range(6)]
        yield bus.motor_position(3)
        yield dict(queued(bus, [chance.randrange(65536) for _ in range(20)]))
        bus.node_stop(3)
        yield bus.clear_fifo(3)
        yield bus.write(3, offset=1, data=data)
        yield bus.write_read(3, outputs=chance.getrandbits(24))
        yield bus.set_outputs(3, mask=0xA500A5)
        yield bus.clear_outputs(3, mask=0x00A500)
        yield bus.read(3, size=26, offset=chance.randrange(256))
        yield bus.loop_back(3, offset=0xA5, data=data)
        yield bus.complete_motor_request(3, data)
        yield bus.load(3, HEX, piece=chance.randint(1, 25)).pieces
        yield [(each.node, each.info) for each in bus.scan((3,))]
        yield bus.node_reset(3)
    yield bus.node_setup(3, node_number=1)


def queued(bus: Bus, words: list[int]) -> Iterator[tuple[int, int]]:
    for progress in bus.stream_motion({3: words}):
        yield progress.node, progress.queued


def simulated(seed: int) -> list[object]:
    """The session with a virtual node."""
    wire = Wire(baud=115200)
    wire.attach(SlaveEngine(qlink, VirtualNode(**SETTINGS)))
    with Bus(VirtualPort(wire), echo="none") as bus:
        return list(session(bus, seed))


@contextlib.contextmanager
def on(port: Port, client: str) -> Iterator[Bus]:
    """Make a bus that leaves its port open."""
    if client == "blocking":
        yield Bus(port, echo="none", slack=SLACK)
        return
    with asyncio.Runner() as runner:
        loop = runner.get_loop()
        yield cast(Bus, AsBlocking(AsyncBus(port, echo="none", slack=SLACK), loop))


@pytest.mark.parametrize("client", ["blocking", "asyncio"])
@pytest.mark.parametrize("target", TARGETS)
def test_a_session_is_the_same_as_with_a_virtual_node(
    target: str, client: str, firmware_line: FirmwareLines
) -> None:
    line = firmware_line(target)
    node = FirmwareNode(line, **SETTINGS)
    with on(line.port, client) as bus:
        assert list(session(bus, 1)) == simulated(1)
        total = bus.engine.total
        assert (total.timeouts, total.strays, total.damaged) == (0, 0, {})
    node.check()


def test_a_silent_firmware_is_a_clean_error(firmware_line: FirmwareLines) -> None:
    line = firmware_line("posix")
    FirmwareNode(line, unsupported=("read",))
    bus = Bus(line.port, echo="none", slack=0.05)
    with pytest.raises(NoReply, match=r"read\.request to node 1: no answer; sent 3 times"):
        bus.read(1, size=1)
    assert Bus(line.port, echo="none", slack=SLACK).loop_back(1, data=b"x").data == b"x"
