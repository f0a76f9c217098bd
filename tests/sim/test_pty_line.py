"""The line that skips silence waits for a thread that gets no processor, and for nothing else."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable

import pytest

from qlinkgen.codecs import qlink
from qlinkgen.link import SlaveEngine
from qlinkgen.protocols.qlink import VirtualNode
from qlinkgen.sim import Wire
from qlinkgen.transport import Port, aio
from tests.support.pty_line import PtyLine

ASKED = qlink.NodeInfoRequest(node=1).to_frame()
#: Seconds, far longer than the test takes.
LONG = 1000.0
Read = Callable[[Port, float], bytes]


@pytest.fixture
def line() -> PtyLine:
    wire = Wire(baud=None)
    wire.attach(SlaveEngine(qlink, VirtualNode(1)))
    return PtyLine(wire)


@pytest.fixture(params=["blocking", "asyncio"])
def read(request: pytest.FixtureRequest, line: PtyLine) -> Read:
    if request.param == "blocking":
        return lambda port, timeout: port.read(timeout)

    def through_a_loop(port: Port, timeout: float) -> bytes:
        with asyncio.Runner(loop_factory=line.loop_factory) as runner:
            return runner.run(aio.read(port, timeout))

    return through_a_loop


@pytest.mark.pty
def test_silence_is_skipped(line: PtyLine, read: Read) -> None:
    with line:
        begun = line.port.now()
        assert read(line.port, LONG) == b""
        assert LONG <= line.port.now() - begun < 2 * LONG


@pytest.mark.pty
def test_a_thread_that_does_not_run_is_waited_for(line: PtyLine, read: Read) -> None:
    held, go_on = threading.Event(), threading.Event()

    def hold() -> None:
        held.set()
        go_on.wait()

    with line:
        line.bus.call(hold)
        held.wait()
        line.port.write(ASKED)
        begun = line.port.now()
        threading.Timer(0.1, go_on.set).start()
        assert qlink.decode_response(read(line.port, LONG)).node == 1
        assert line.port.now() - begun < LONG
