"""`qlinkgen decode` of captures: every format gives the frames of the raw bytes, with place and time."""

from __future__ import annotations

import gzip
import itertools
import json
import random
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import zstandard

from qlinkgen.captures.pcapng import Direction as Way
from qlinkgen.codecs import qlink
from qlinkgen.model.checksum import catalogue
from tests.captures.written import EVERY, NANO, SILENT, START, STATED, Burst
from tests.cli.conftest import THERMO, Run

#: Only a silence ends its frames, and its bytes have times of their own in captures of analysers.
GAUGE = """
qlinkgen: 1
protocol: {name: gauge, revision: "1", source: Made up}
frame:
  parts:
    code: {role: message, type: u8}
    data: {role: payload, size: 0..8}
    sum: {type: u8, algorithm: sum8, over: [code, data]}
    gap: {role: idle, time: 3.5 bytes, alone: true}
bus: {kind: master_slave}
defaults: {repeat: safe}
commands: {read: {id: 1, request: {text: text}, response: {value: u16}}}
"""
#: A request and its response, on the wire.
READ = (bytes.fromhex("01414284"), bytes.fromhex("01010204"))
WAYS: tuple[Way, Way] = ("sent", "received")


def exchanges(count: int, *, sent: str = "request") -> Iterator[Burst]:
    """Return transactions of a bus, as recorded by its master or by a slave."""
    chance = random.Random(1)
    at = START
    for _ in range(count):
        node = chance.randrange(1, 17)
        asked = qlink.MotionRequest(node=node, counter=chance.randrange(256), segments=[7, 8])
        told = qlink.MotionResponse(
            node=node, counter=chance.randrange(256), position=chance.randrange(10**6)
        )
        for way, frame in (("request", asked.to_frame()), ("response", told.to_frame())):
            at += 3_000_000
            yield Burst(frame, at, "sent" if way == sent else "received")


def records(text: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in text.splitlines()]


def without(found: list[dict[str, Any]], *keys: str) -> list[dict[str, Any]]:
    return [{key: value for key, value in each.items() if key not in keys} for each in found]


@pytest.mark.parametrize("name", EVERY)
@pytest.mark.parametrize("sent", ["request", "response"])
def test_every_format(qlinkgen: Run, name: str, sent: str, tmp_path: Path) -> None:
    """Also where the capture was made by a slave, which sends responses."""
    bursts = list(exchanges(20, sent=sent))
    wire = b"".join(each.data for each in bursts)
    shown = records(qlinkgen("decode", "qlink", wire.hex()).out)
    assert [each["message"] for each in shown] == ["motion.request", "motion.response"] * 20
    file = tmp_path / "capture"
    file.write_bytes(EVERY[name][1](bursts))
    done = qlinkgen("decode", "qlink", file)
    assert done.code == 0, done.err
    assert done.err == f"qlinkgen: frames 40; 0 of {len(wire)} bytes outside frames\n"
    found = records(done.out)
    assert without(found, "offset", "time") == without(shown, "offset")
    if name in STATED:
        first = found[0]["time"] - (bursts[0].at - START) / NANO
        for record, burst in zip(found, bursts, strict=True):
            assert record["time"] - first == pytest.approx((burst.at - START) / NANO, abs=2e-6)
    if name == "raw":
        assert [each["offset"] for each in found] == [each["offset"] for each in shown]
    # The same on standard input, and compressed in any way.
    for packed in (bytes, gzip.compress, zstandard.compress):
        assert qlinkgen("decode", "qlink", "-", stdin=packed(file.read_bytes())).out == done.out


@pytest.mark.parametrize("name", ["log words", "pcapng", "saleae 2", "raw"])
def test_answers_that_are_ambiguous(qlinkgen: Run, name: str, tmp_path: Path) -> None:
    """A response that is also a request is a response where the capture says what was sent."""
    answer = qlink.MotorPositionRequest(node=3).to_frame()  # of other drivers, an acknowledgement
    asked = qlink.MotionRequest(node=3, counter=1).to_frame()
    bursts = [
        *exchanges(3),
        Burst(asked, START + 10**9, "sent"),
        Burst(answer, START + 2 * 10**9, "received"),
    ]
    file = tmp_path / "capture"
    file.write_bytes(EVERY[name][1](bursts))
    done = qlinkgen("decode", "qlink", file)
    named = [each.get("message") or each["error"]["kind"] for each in records(done.out)[-2:]]
    assert named == ["motion.request", "motor_position.request" if name == "raw" else "length"]


def test_ends_by_silence(qlinkgen: Run, tmp_path: Path) -> None:
    """Packets are frames; single bytes are joined until the line was idle."""
    schema, file = tmp_path / "gauge.yaml", tmp_path / "capture"
    schema.write_text(GAUGE)
    at = itertools.count(START, 50_000_000)
    bursts = [Burst(frame, next(at), way) for _ in range(3) for frame, way in zip(READ, WAYS, strict=True)]
    for name in EVERY:
        file.write_bytes(EVERY[name][1](bursts))
        done = qlinkgen("decode", schema, file)
        if name == "raw":
            assert "one frame on each line" in done.err
        elif name == "sigrok":  # it has no times
            assert done.code == 1
        else:
            names = [each["message"] for each in records(done.out)]
            assert names == ["read.request", "read.response"] * 3, name
    file.write_bytes(EVERY["saleae 1"][1](bursts))
    assert qlinkgen("decode", schema, "--capture-baud", "4000000", file).code == 1  # 100 us are a silence


def test_an_own_schema_and_a_ring(qlinkgen: Run, tmp_path: Path) -> None:
    schema, file = tmp_path / "thermo.yaml", tmp_path / "capture"
    schema.write_text(THERMO)
    wire = bytes.fromhex(qlinkgen("encode", schema, "set_target", "--node", "3", "target=21.5").out)
    keys = bytes.fromhex("947f90")
    for name in EVERY:
        file.write_bytes(EVERY[name][1]([Burst(wire, START, "sent"), Burst(wire, START + 10**7, "sent")]))
        assert [each["unit"] for each in records(qlinkgen("decode", schema, file).out)] == [3, 3], name
        file.write_bytes(EVERY[name][1]([Burst(keys, START, "sent"), Burst(keys, START + 10**7, "received")]))
        found = records(qlinkgen("decode", "trio", file).out)
        assert [each["message"] for each in found] == ["keypad_mode"] * 2, name


def test_levels_of_a_line_that_is_not_as_the_schema_states(qlinkgen: Run, tmp_path: Path) -> None:
    """Without the parity bit of the schema, and at another speed, if it is not given."""
    file = tmp_path / "capture"
    frames = [bytes.fromhex(f"01030{index}6b000376"[:12]) for index in range(6)]
    crc = next(each for each in catalogue() if each.name == "crc-16/modbus")
    whole = [each + crc.compute(each).to_bytes(2, "little") for each in frames]
    bursts = [Burst(each, START + 10**8 * index, "sent") for index, each in enumerate(whole)]
    file.write_bytes(EVERY["samples"][1](bursts))
    done = qlinkgen("decode", "modbus_rtu", file)
    assert [each["message"] for each in records(done.out)] == ["read_holding_registers.request"] * 6
    assert qlinkgen("decode", "modbus_rtu", "--capture-baud", "9600", file).code == 1


def test_packets_of_a_host(qlinkgen: Run, tmp_path: Path) -> None:
    file = tmp_path / "log"
    file.write_text("12:00:00 TX 4a\n12:00:00.5 RX 0012d687d6e3\n12:00:01 TX 02\n")
    found = records(qlinkgen("decode", "mc1231a", file).out)
    assert [each["message"] for each in found] == ["get_pos.request", "get_pos.response", "set_2.request"]
    assert [each["time"] for each in found] == [43200, 43200.5, 43201]


def test_texts_that_are_frames(qlinkgen: Run, tmp_path: Path) -> None:
    """The bytes of a protocol of text are raw, though they look like a log or hex."""
    file = tmp_path / "gps.txt"
    wire = b":010300000002FA\r\n"
    file.write_bytes(wire * 3)
    found = records(qlinkgen("decode", "modbus_ascii", file).out)
    assert [each["offset"] for each in found] == [0, len(wire), 2 * len(wire)]
    file.write_text(f"{wire.hex(' ')}\n" * 3)
    assert len(records(qlinkgen("decode", "modbus_ascii", file).out)) == 3


def test_offsets_of_faults_and_noise(qlinkgen: Run, tmp_path: Path) -> None:
    good = qlink.MotorPositionRequest(node=3).to_frame()
    bad = good[:-1] + b"\0"
    file = tmp_path / "capture"
    file.write_bytes(b"\0\xa5" + good + b"noise" + bad + good)
    done = qlinkgen("decode", "qlink", file)
    assert done.code == 0
    places = [each.get("offset", each.get("error", {}).get("offset")) for each in records(done.out)]
    assert places == [2, 14, 21]
    assert qlinkgen("decode", "qlink", "--strict", file).code == 1
    file.write_bytes(bad)
    assert qlinkgen("decode", "qlink", file).code == 1


def test_what_cannot_be_read(qlinkgen: Run, tmp_path: Path) -> None:
    file = tmp_path / "log"
    lines = [*EVERY["log words"][1](list(exchanges(30))).decode().splitlines(), "12:00:00 rebooted", ""]
    file.write_text("\n".join(["* a driver *", *lines]))
    done = qlinkgen("decode", "qlink", file)
    assert (done.code, len(done.lines)) == (0, 60)
    assert f"{file}, line 1: no time or direction with bytes in '* a driver *'; passed over" in done.err
    assert f"{file}, line 62:" in done.err
    assert qlinkgen("decode", "qlink", "--strict", file).code == 1
    file.write_text("\n".join([*lines[:2], *["nothing"] * 50]))
    assert f"{file}: 30 further places could not be read" in qlinkgen("decode", "qlink", file).err
    whole = EVERY["pcapng"][1](list(exchanges(5)))
    file.write_bytes(gzip.compress(whole)[:-20])
    done = qlinkgen("decode", "qlink", file)
    assert done.code == 0
    assert "it was cut" in done.err


def test_formats_by_name(qlinkgen: Run, tmp_path: Path) -> None:
    file = tmp_path / "capture"
    file.write_bytes(EVERY["log words"][1](list(exchanges(5))))
    assert len(qlinkgen("decode", "qlink", "--capture-format", "log", file).lines) == 10
    assert "no frame in" in qlinkgen("decode", "qlink", "--raw", file).err
    regex = r"^(?P<time>\S+) (?P<direction>\w+): (?P<hex>.*)$"
    named = qlinkgen("decode", "qlink", "--line-regex", regex, file)
    assert named.out == qlinkgen("decode", "qlink", file).out
    for arguments, said in (
        (("--line-regex", "(", file), "is not a regular expression"),
        (("--line-regex", "(?P<data>.)", file), "the groups are time, direction, hex, text"),
        (("--line-regex", "a", file), "has not one group"),
        (("--line-regex", regex, "--raw", file), "omit --capture-format and --raw"),
        (("--raw", "--capture-format", "hex", file), "contradict each other"),
        (("--raw", "a5"), "omit HEX"),
        ((tmp_path,), "is a folder"),
        ((file, "a5"), "'a5' is not a file"),
        (("-", "-"), "read once"),
        (("missing.txt",), "is not a hex digit"),
    ):
        done = qlinkgen("decode", "qlink", *arguments)
        assert done.code == 2, said
        assert said in done.err


def test_text_of_a_log(qlinkgen: Run, tmp_path: Path) -> None:
    file = tmp_path / "log"
    file.write_text("0.5 > :010100010002FB\n")
    found = qlinkgen(
        "decode", "modbus_ascii", "--line-regex", r"(?P<time>\S+) > (?P<text>.*)", file
    )  # the end of a line is not in it
    assert json.loads(found.out)["error"]["kind"] == "truncated"


def test_several_files(qlinkgen: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    wire = qlink.MotorPositionRequest(node=3).to_frame()
    Path("dead").write_bytes(wire)
    Path("log.txt").write_text(f"TX {wire.hex()}\n")
    found = records(qlinkgen("decode", "qlink", "./dead", "log.txt").out)
    assert [each["file"] for each in found] == ["./dead", "log.txt"]
    assert qlinkgen("decode", "qlink", "dead").code == 1  # it is hex
    assert "file" not in records(qlinkgen("decode", "qlink", "./dead").out)[0]


def test_what_decode_prints_can_be_encoded(qlinkgen: Run, tmp_path: Path) -> None:
    file = tmp_path / "capture"
    bursts = list(exchanges(3))
    file.write_bytes(EVERY["log words"][1](bursts))
    for line, burst in zip(qlinkgen("decode", "qlink", file).lines, bursts, strict=True):
        assert qlinkgen("encode", "qlink", "--json", line).out.strip() == burst.data.hex()


def test_silent_formats_are_listed() -> None:
    assert {kind for kind, _ in SILENT.values()} | {kind for kind, _ in STATED.values()} == {
        "raw", "hex", "log", "saleae", "sigrok", "samples", "pcap", "pcapng"
    }  # fmt: skip


@pytest.mark.program
def test_a_recording_of_another_program(qlinkgen: Run, tmp_path: Path, require_tool: Any) -> None:
    editcap = require_tool("editcap", package="tshark")
    ours, theirs = tmp_path / "ours.pcapng", tmp_path / "theirs.pcap"
    ours.write_bytes(EVERY["pcapng"][1](list(exchanges(10))))
    subprocess.run([editcap, "-F", "pcap", ours, theirs], check=True, capture_output=True)
    assert qlinkgen("decode", "qlink", theirs).out.count("motion") == 20


def test_the_first_bad_frame(qlinkgen: Run, tmp_path: Path) -> None:
    bursts = list(exchanges(20))
    for name in ("pcapng", "log words", "raw"):
        file, wrong = tmp_path / "good", tmp_path / "bad"
        file.write_bytes(EVERY[name][1](bursts))
        data = bursts[7].data
        damaged = [*bursts[:7], bursts[7]._replace(data=data[:-1] + bytes([data[-1] ^ 1])), *bursts[8:]]
        wrong.write_bytes(EVERY[name][1](damaged))
        good = qlinkgen("explain", "qlink", file, "--first-bad")
        assert (good.code, good.out) == (0, "no bad frame among 40 frames\n")
        bad = qlinkgen("explain", "qlink", wrong, "--first-bad")
        assert bad.code == 1
        assert bad.lines[0].startswith(f"{wrong}: frame 8, offset ")
        assert "wrong: crc is" in bad.out
        assert bad.out.count("motion.response") == 1
        same = qlinkgen("explain", "qlink", file, file)
        assert (same.code, same.out) == (0, "no difference in 40 frames\n")
        differ = qlinkgen("explain", "qlink", file, wrong)
        assert differ.code == 1
        assert differ.out.count(": frame 8, offset ") == 2
        assert differ.out.count("no errors") == 1
        wrong.write_bytes(EVERY[name][1](bursts[:10]))
        assert f"{wrong}: it has no more frames" in qlinkgen("explain", "qlink", file, wrong).out


def test_an_answer_is_explained_with_its_request(qlinkgen: Run, tmp_path: Path) -> None:
    good, bad = tmp_path / "good", tmp_path / "bad"
    good.write_text("TX 4a\nRX 0012d687d6e3\n" * 4)
    bad.write_text("TX 4a\nRX 0012d687d6e3\n" * 3 + "TX 4a\nRX 0012d687d6e4\n")
    done = qlinkgen("explain", "mc1231a", bad, "--first-bad")
    assert (done.code, done.lines[0]) == (1, f"{bad}: frame 8, offset 72")
    assert "get_pos.response" in done.out
    assert "wrong: checksum is" in done.out
    assert qlinkgen("explain", "mc1231a", good, bad).out.count("get_pos.response") >= 2


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("a5", "--first-bad"), "--first-bad looks for a frame in a capture"),
        (("{file}",), "two FILEs without it"),
        (("{file}", "{file}", "--first-bad"), "two FILEs without it"),
        (("{file}", "a5"), "is not a file"),
    ],
)
def test_what_explain_takes(qlinkgen: Run, tmp_path: Path, arguments: tuple[str, ...], said: str) -> None:
    file = tmp_path / "capture"
    file.write_bytes(b"")
    done = qlinkgen("explain", "qlink", *(each.format(file=file) for each in arguments))
    assert done.code == 2
    assert said in done.err


def test_a_bar_on_a_terminal(qlinkgen: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only for long files, and only where the output goes elsewhere."""
    file, tables = tmp_path / "capture", tmp_path / "tables"
    file.write_bytes(b"".join(each.data for each in exchanges(200)))
    assert "100%" not in qlinkgen("export", "qlink", file, "-o", tables).err
    monkeypatch.setattr("qlinkgen.cli.progress.LONG", 1)
    monkeypatch.setattr("qlinkgen.cli.progress.STEP", 1)
    assert "100%" not in qlinkgen("export", "qlink", file, "-o", tables).err
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    assert "100%" in qlinkgen("export", "qlink", file, "-o", tables).err
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    assert "100%" not in qlinkgen("export", "qlink", file, "-o", tables).err
