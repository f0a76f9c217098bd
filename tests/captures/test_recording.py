"""Recordings of buses and slaves by `on_frame`."""

from __future__ import annotations

import time
from pathlib import Path

from qlinkgen.captures.reader import read_pcapng
from qlinkgen.captures.recording import Recording
from qlinkgen.codecs import qlink
from qlinkgen.codecs.qlink_bus import Slave
from qlinkgen.link.codec import is_message
from qlinkgen.link.events import Frame
from qlinkgen.protocols.qlink import Bus, VirtualNode
from qlinkgen.transport import memory_pair

ASKED = qlink.MotorPositionRequest(node=3).to_frame()


def test_two_ports_in_a_file(tmp_path: Path) -> None:
    path = tmp_path / "line.pcapng"
    ours, theirs = memory_pair()
    before = time.time_ns()
    with Recording(path) as recording:
        slave = Slave(theirs, VirtualNode(3, position_type=1), on_frame=recording.port("slave", qlink))
        master = Bus(ours, echo="none", on_frame=recording.port("master", qlink, speed=9600))
        with master as bus, slave, slave.running():
            bus.node(3).motor_position()
        assert len(list(read_pcapng(path))) == 4
    seen = {
        name: [each for each in read_pcapng(path) if each.interface.name == name]
        for name in ("master", "slave")
    }
    assert [each.direction for each in seen["master"]] == ["sent", "received"]
    assert [each.direction for each in seen["slave"]] == ["received", "sent"]
    assert {packets[0].data for packets in seen.values()} == {ASKED}
    assert seen["master"][0].interface.speed == 9600
    assert all(before - 10**6 <= each.at <= time.time_ns() for packets in seen.values() for each in packets)


def test_faults_and_modules_without_a_schema(tmp_path: Path) -> None:
    path = tmp_path / "line.pcapng"
    (fault,) = qlink.StreamDecoder("request").feed(ASKED[:-1] + b"\0")
    assert not is_message(fault)
    with Recording(path) as recording:
        port = recording.port("port", object(), clock=lambda: 5.0)
        start = time.time_ns()
        port(Frame(6.5, False, ASKED[:-1] + b"\0", None, fault))
        port.add(-1e12, b"", sent=True)
    first, second = read_pcapng(path)
    assert first.interface.comments == ()
    assert first.comments == (f"crc: {fault.message}",)
    assert abs(first.at - start - 1_500_000_000) < 10**9
    assert second.at == 0
