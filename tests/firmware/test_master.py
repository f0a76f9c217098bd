"""The example of a master, on an emulated Cortex-M0: four simulated nodes, one of them silent at first."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import pytest

from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from qlinkgen.backends.c import master
from qlinkgen.codecs import qlink
from qlinkgen.codecs.qlink_bus import Slave
from qlinkgen.protocols.qlink import VirtualNode
from qlinkgen.schema import find, load
from qlinkgen.transport import open_port
from tests.firmware.firmware import HANGS, SOURCES, TARGETS, Firmware, has_header
from tests.firmware.test_build import sure

pytestmark = [pytest.mark.pty, pytest.mark.program]


class Node(VirtualNode):
    """A node that is silent until it is switched on."""

    on = True

    def write_read(self, request: qlink.WriteReadRequest, now: float) -> qlink.WriteReadResponse | None:
        """Answer if it is on."""
        return super().write_read(request, now) if self.on else None


def wait_for(condition: Callable[[], bool]) -> None:
    """Wait until a condition holds."""
    end = time.monotonic() + HANGS
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_outputs_follow_the_inputs_of_the_node_before(
    tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    target = TARGETS["microbit"]
    for tool, package in (("make", "make"), *target.tools):
        require_tool(tool, package=package)
    if not has_header("string.h", "arm-none-eabi-gcc"):
        require_tool("string.h", package="libnewlib-arm-none-eabi")
    for generate in (c.generate, master.generate):
        for path, text in generate(load(find("qlink")), Options()).items():
            (tmp_path / Path(path).name).write_text(text, "utf-8")
    options = "CPPFLAGS=-DMASTER_PACED=0 -DMASTER_SLACK_US=100000ul"
    where = (f"HEADERS={tmp_path}", f"BUILD={tmp_path}/build", "PORT=microbit", "APP=qlink_master")
    sure("make", "-C", SOURCES, *where, options)
    nodes = [Node(number) for number in range(1, 5)]
    for number, node in enumerate(nodes, 1):
        node.io.power_up(0x010101 * number)
    nodes[3].on = False
    program = tmp_path / "build" / "microbit-qlink_master.elf"
    with (
        Firmware("microbit", program) as firmware,
        open_port(firmware.path) as port,
        Slave(port, *nodes).running(),
    ):
        wait_for(lambda: [node.io.outputs for node in nodes[1:3]] == [0x010101, 0x020202])
        assert nodes[0].io.outputs == nodes[3].io.outputs == 0
        nodes[3].on = True
        wait_for(lambda: [node.io.outputs for node in nodes] == [0x040404, 0x010101, 0x020202, 0x030303])
