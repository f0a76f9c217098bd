"""`--record`: recordings of `send`, `simulate` and `monitor`."""

from __future__ import annotations

import signal
import time
from pathlib import Path

from qlinkgen.captures import Packet, read_pcapng
from qlinkgen.cli.cutting import MOST, Cutter, Piece
from qlinkgen.codecs import qlink
from qlinkgen.link.codec import Fault, Framed
from qlinkgen.transport import open_pty
from tests.cli.conftest import Run
from tests.cli.test_send_host import chip
from tests.cli.wire import CALM, SLACK, end, read_until, simulated, started

REQUEST = qlink.MotorPositionRequest(node=3)
ANSWER = qlink.MotorPositionResponse(node=3, position=0)
ASKED, ANSWERED = REQUEST.to_frame(), ANSWER.to_frame()


def ways(packets: list[Packet]) -> list[tuple[str | None, bytes]]:
    return [(each.direction, each.data) for each in packets]


def test_both_ends_of_a_bus(tmp_path: Path, qlinkgen: Run) -> None:
    ours, theirs = tmp_path / "ours.pcapng", tmp_path / "theirs.pcapng"
    before = time.time_ns()
    with simulated("qlink", "--nodes", "3", "--record", theirs, "--baud", "19200") as (path, process):
        done = qlinkgen("send", "qlink", path, "motor_position", "--node", "3", *CALM, "--record", ours)
        assert done.code == 0
        while len(list(read_pcapng(theirs))) < 2:
            time.sleep(0.01)
        process.kill()
    sent, received = read_pcapng(ours)
    assert ways([sent, received]) == [("sent", ASKED), ("received", ANSWERED)]
    assert before <= sent.at < received.at <= time.time_ns()
    name, link_type, (comment,), _ = sent.interface
    assert (name, link_type, comment[:-12]) == (path, 147, "schema qlink.yaml ")
    assert comment[-12:] in (qlink.__doc__ or "")
    at_node = list(read_pcapng(theirs))
    assert ways(at_node) == [("received", ASKED), ("sent", ANSWERED)]
    assert (at_node[0].interface.name, at_node[0].interface.speed) == ("simulated qlink", 19200)


def test_frames_that_a_silence_ends(tmp_path: Path, qlinkgen: Run) -> None:
    theirs = tmp_path / "theirs.pcapng"
    asked = ("read_exception_status", "--node", "7", "--attempts", "1", "--slack", "0.05")
    with simulated("modbus_rtu", "--nodes", "8", "--record", theirs) as (path, process):
        for _ in range(2):
            assert qlinkgen("send", "modbus_rtu", path, *asked).code == 1
        end(process, signal.SIGTERM)
    assert ways(list(read_pcapng(theirs))) == [("received", bytes.fromhex("07074242"))] * 2


def test_answers_that_only_their_request_tells(tmp_path: Path, qlinkgen: Run) -> None:
    file = tmp_path / "line.pcapng"
    with chip() as (path, _):
        words = ("set_vel", "value=2.75", "--axis", "2", *SLACK, "--record", file)
        assert qlinkgen("send", "mc1231a", path, *words).code == 0
    assert [each.direction for each in read_pcapng(file)] == ["sent", "received"] * 2


def test_a_closed_ring(tmp_path: Path, qlinkgen: Run) -> None:
    file = tmp_path / "ring.pcapng"
    program = tmp_path / "main.bas"
    program.write_text("SEND(10,1,7,-0.25)\n")
    ring = ("--ring", "coordinator,coordinator", "--closed", "--program", f"1={program}")
    assert qlinkgen("simulate", "trio", *ring, "--record", file).code == 0
    packets = list(read_pcapng(file))
    assert packets
    assert {each.interface.name for each in packets} == {"node 0"}
    assert {each.direction for each in packets} == {"sent"}


def test_a_monitor(tmp_path: Path) -> None:
    file = tmp_path / "line.pcapng"
    damaged = ASKED[:-1] + bytes((ASKED[-1] ^ 1,))
    with (
        open_pty() as line,
        started("monitor", "qlink", line.path, "--count", "3", "--record", file, *SLACK) as monitor,
    ):
        read_until(monitor.stderr, "listening")
        line.write(b"\x01\x02\x03" + ASKED + ANSWERED + damaged + ASKED)
        monitor.communicate()
        assert monitor.returncode == 0
    packets = list(read_pcapng(file))
    assert b"".join(each.data for each in packets) == b"\x01\x02\x03" + ASKED + ANSWERED + damaged + ASKED
    assert ways(packets)[:4] == [("received", each) for each in (b"\x01\x02\x03", ASKED, ANSWERED, damaged)]
    assert [bool(each.comments) for each in packets[:4]] == [False, False, False, True]
    assert packets[3].comments[0].startswith("crc: ")


def test_a_file_that_cannot_be_written(tmp_path: Path, qlinkgen: Run) -> None:
    file = tmp_path / "missing" / "line.pcapng"
    done = qlinkgen("send", "qlink", "/dev/not-there", "motor_position", "--node", "3", "--record", file)
    assert done.code == 1
    assert f"{file}: No such file" in done.err


Found = tuple[Framed | Fault, bytes]


def cut(cutter: Cutter, *found: Found) -> list[tuple[float, bytes, object]]:
    return [(piece.at, piece.data, piece.event) for piece in cutter.cut(found)]


def test_cutting() -> None:
    cutter = Cutter()
    cutter.take(1.0, b"xx" + ASKED[:3])
    assert not cut(cutter)
    cutter.take(2.0, ASKED[3:] + ANSWERED[:2])
    assert cut(cutter, (REQUEST, ASKED)) == [(1.0, b"xx", None), (1.0, ASKED, REQUEST)]
    cutter.take(3.0, ANSWERED[2:] + b"y")
    assert cut(cutter, (ANSWER, ANSWERED)) == [(2.0, ANSWERED, ANSWER)]
    assert list(cutter.rest()) == [Piece(3.0, b"y", None)]
    assert not list(cutter.rest())


def test_cutting_a_fault_in_which_a_frame_begins() -> None:
    cutter, (fault,) = Cutter(), qlink.StreamDecoder("request").feed(ASKED[:4] + bytes(3))[:1]
    assert not hasattr(fault, "to_frame")
    cutter.take(1.0, ASKED[:4] + ASKED)
    found = cut(cutter, (fault, ASKED[:4] + ASKED[:3]), (REQUEST, ASKED))
    assert found == [(1.0, ASKED[:4], fault), (1.0, ASKED, REQUEST)]


def test_cutting_what_was_read_in_another_spelling() -> None:
    cutter = Cutter()
    cutter.take(1.0, b"abc")
    assert not cut(cutter, (REQUEST, ASKED))
    cutter.take(2.0, ASKED)
    assert cut(cutter, (REQUEST, ASKED)) == [(1.0, b"abc", None), (2.0, ASKED, REQUEST)]


def test_cutting_noise_without_end() -> None:
    cutter = Cutter()
    cutter.take(1.0, bytes(MOST))
    assert not cut(cutter)
    cutter.take(2.0, b"a")
    assert cut(cutter) == [(1.0, bytes(MOST) + b"a", None)]
