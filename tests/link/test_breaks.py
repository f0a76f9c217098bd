"""Frames that a break of the line begins."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from qlinkgen.backends.python import load as load_codec
from qlinkgen.link import MasterEngine, Monitor, SlaveEngine, Timing
from qlinkgen.link.gaps import break_of
from qlinkgen.schema import loads
from qlinkgen.transport.blocking import BlockingMaster
from qlinkgen.transport.gate import Gate
from qlinkgen.transport.memory import MemoryPort, memory_pair
from qlinkgen.transport.serial_port import SerialPort
from qlinkgen.transport.serving import serving
from tests.support.cdriver import WARNINGS

HEAD = """\
qlinkgen: 1
protocol: {name: lin, title: Lin, revision: "1", source: Manual}
"""
LIN = """\
frame:
  parts:
    start: {role: break, time: 1.3 bytes, at_least: 100 us}
    sync: "55"
    identifier: {role: message, type: u8}
    data: {role: payload, size: 0..8}
    check: {type: u8, algorithm: sum8-carry-inverted, over: [identifier, data]}
bus: {kind: master_slave, baud: 19200, response_within: 10 ms}
defaults: {repeat: safe}
messages:
  lamp: {id: 0x61, fields: {level: u8, pattern: u16}}
commands:
  status: {id: 0x50, request: {}, response: {id: 0x11, fields: {value: u8}}}
  reset: {id: 0x92, request: {}, response: none}
"""
DMX = """\
frame:
  parts:
    start: {role: break, time: 176 us, alone: true}
    code: {role: message, type: u8}
    slots: {role: payload, size: 1..512}
bus: {kind: link, baud: 250000, bits_per_byte: 11}
messages:
  levels: {id: 0, fields: {level: "bytes[1..512]"}}
  text: {id: 0x17, fields: {page: u8, text: "text[1..511]"}}
"""


def codec_of(text: str) -> ModuleType:
    protocol, faults = loads(HEAD + text, "lin.yaml")
    assert protocol is not None, faults
    return load_codec(protocol)


class Broken:
    """Notes breaks and frames."""

    def __init__(self, port: MemoryPort) -> None:
        self.sent: list[float | bytes] = []
        self._write = port.write
        port.write = self.write  # type: ignore[method-assign]
        port.send_break = self.send_break  # type: ignore[method-assign]

    def send_break(self, seconds: float) -> None:
        self.sent.append(seconds)

    def write(self, data: bytes) -> None:
        self.sent.append(data)
        self._write(data)


def test_each_break_begins_a_frame_anew() -> None:
    lin = codec_of(LIN)
    decoder = lin.StreamDecoder("request")
    lamp = lin.Lamp(level=1, pattern=2)
    frame = lamp.to_frame()
    assert lin.BREAK == (1.3, 0.0001)
    assert not hasattr(lin, "IDLE")
    assert decoder.feed(frame[:4]) == []
    (fault,) = decoder.gap()
    assert fault.kind == "truncated"
    assert decoder.feed(frame) == [lamp]  # ended by the size of its message
    assert decoder.gap() == []
    assert decoder.feed(b"\0" + frame) == [lamp]  # a break that is received as a byte


def test_only_the_next_break_ends_a_frame() -> None:
    dmx = codec_of(DMX)
    decoder = dmx.StreamDecoder("message")
    levels, text = dmx.Levels(level=bytes(range(200))), dmx.Text(page=1, text="HELLO")
    found = []
    for message in (levels, text, levels):
        assert decoder.feed(message.to_frame()) == []
        found += decoder.gap()
    assert found == [levels, text, levels]
    assert not hasattr(dmx, "IDLE_ALONE")


def test_drivers_send_a_break_before_each_frame() -> None:
    lin = codec_of(LIN)
    here, there = memory_pair(19200)
    master_line, slave_line = Broken(here), Broken(there)

    class Node:
        number = 0

        def handle(self, request: object, now: float) -> object:
            return lin.StatusResponse(value=7) if type(request) is lin.StatusRequest else None

    master = BlockingMaster(MasterEngine(lin, Timing.of(lin, host_slack=0.5)), here)
    slave = serving(there, SlaveEngine(lin, Node(), baud=19200))  # type: ignore[arg-type]
    next(slave)
    steps = here.read

    def read(timeout: float) -> bytes:
        slave.send(there.read(0))
        there.sleep(0.005)
        slave.send(b"")
        return steps(min(timeout, 0.01))

    here.read = read  # type: ignore[method-assign]
    assert master.transact(lin.StatusRequest()).response == lin.StatusResponse(value=7)
    master.transact(lin.ResetRequest())
    wait = pytest.approx(13 / 19200)
    asked, reset = lin.StatusRequest().to_frame(), lin.ResetRequest().to_frame()
    assert master_line.sent == [wait, asked, wait, reset]
    assert slave_line.sent == [wait, lin.StatusResponse(value=7).to_frame()]


def test_deadlines_have_time_for_the_breaks() -> None:
    lin = codec_of(LIN)
    plain = codec_of(LIN.replace("    start: {role: break, time: 1.3 bytes, at_least: 100 us}\n", ""))
    timing, without = (Timing.of(each, host_slack=0.0) for each in (lin, plain))
    longer = timing.deadline(lin.COMMANDS["status"], 0) - without.deadline(plain.COMMANDS["status"], 0)
    assert longer == pytest.approx(13 / 19200)
    assert break_of(plain, 0.001) == 0.0
    engine = MasterEngine(lin, timing)
    engine.start(lin.StatusRequest(), 0.0)
    engine.bytes_to_send(0.0)
    before = MasterEngine(plain, without)
    before.start(plain.StatusRequest(), 0.0)
    before.bytes_to_send(0.0)
    assert (engine.next_timer() or 0) - (before.next_timer() or 0) == pytest.approx(2 * 13 / 19200)


def test_a_monitor_takes_frames_that_end_otherwise() -> None:
    lin = codec_of(LIN)
    monitor = Monitor(lin, Timing.of(lin, host_slack=0.01))
    monitor.receive(b"\0" + lin.StatusRequest().to_frame(), 0.0)
    monitor.receive(b"\0" + lin.StatusResponse(value=1).to_frame(), 0.005)
    assert [type(each).__name__ for each in monitor.heard] == ["Asked", "Replied"]


def test_a_serial_port_breaks_the_line_once_all_is_sent(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[object] = []

    class Serial:
        @property
        def break_condition(self) -> bool:
            raise AssertionError

        @break_condition.setter
        def break_condition(self, value: bool) -> None:
            told.append(value)

    port = object.__new__(SerialPort)
    port._gate = Gate(lambda: None)
    port._direction = told.append
    port._serial = Serial()  # type: ignore[assignment]
    monkeypatch.setattr(SerialPort, "_drain", lambda _: told.append("drained"))
    monkeypatch.setattr("qlinkgen.transport.serial_port.time.sleep", told.append)
    port.send_break(0.001)
    assert told == [True, "drained", True, 0.001, False]


@pytest.mark.parametrize("schema", [LIN, DMX], ids=["lin", "dmx"])
def test_c(tmp_path: Path, schema: str, require_tool: Callable[..., str]) -> None:
    require_tool("gcc", package="gcc")
    protocol, faults = loads(HEAD + schema, "lin.yaml")
    assert protocol is not None, faults
    for name, text in c.generate(protocol, Options()).items():
        (tmp_path / Path(name).name).write_text(text)
        assert "IDLE_" not in text
    codec = load_codec(protocol)
    alone = schema == DMX
    message = codec.Levels(level=b"123") if alone else codec.Lamp(level=1, pattern=2)
    frame = message.to_frame()
    listed = ", ".join(f"0x{byte:02X}" for byte in frame)
    source = f"""
#include "lin.h"
#include <stdio.h>

int main(void)
{{
    static const uint8_t bytes[] = {{{listed}}};
    static lin_receiver_t receiver;
    lin_receiver_init(&receiver{"" if alone else ", LIN_REQUEST"});
    for (size_t at = 0U; at < 3U; ++at) {{
        (void)lin_receive(&receiver, bytes[at]);
    }}
    while (lin_rx_idle(&receiver) != LIN_EVENT_NONE) {{
    }}
    lin_event_t event = LIN_EVENT_NONE;
    for (size_t at = 0U; at < sizeof bytes; ++at) {{
        event = lin_receive(&receiver, bytes[at]);
    }}
    printf("%d", (int)(event == LIN_EVENT_FRAME));
    event = lin_rx_idle(&receiver);
    printf("%d %u %u", (int)(event == LIN_EVENT_FRAME), LIN_BREAK_BITS, LIN_BREAK_US);
    return 0;
}}
"""
    (tmp_path / "main.c").write_text(source)
    program = tmp_path / "main"
    command = [
        "gcc",
        "-std=c99",
        *WARNINGS,
        "-I",
        str(tmp_path),
        str(tmp_path / "main.c"),
        "-o",
        str(program),
    ]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    told = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    assert told == ("01 0 176" if alone else "10 13 100")
