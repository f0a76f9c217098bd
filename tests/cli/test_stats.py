"""`qlinkgen stats`: figures of captures whose traffic is known."""

from __future__ import annotations

import json
import random
import re
from pathlib import Path
from typing import Any

import pytest

from qlinkgen.captures.statistics import Histogram, Load
from qlinkgen.codecs import qlink
from tests.captures.written import EVERY, START, Burst
from tests.cli.conftest import Run

MILLI = 10**6


def traffic() -> list[Burst]:
    """Return 100 transactions with node 3: answers after 3 ms, one after 50 ms, one missing, one bad."""
    found, at = [], START
    for index in range(100):
        request = qlink.MotionRequest(node=3, counter=index).to_frame()
        answer = qlink.MotionResponse(node=3, counter=index, position=index).to_frame()
        found.append(Burst(request, at, "sent"))
        if index == 10:  # no answer: the request is repeated
            found.append(Burst(request, at + 60 * MILLI, "sent"))
            at += 60 * MILLI
        if index == 20:
            answer = answer[:-1] + bytes([answer[-1] ^ 1])
        delay = 50 if index == 30 else 3
        found.append(Burst(answer, at + delay * MILLI, "received"))
        at += 100 * MILLI
    return found


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    file = tmp_path / "line.pcapng"
    file.write_bytes(EVERY["pcapng"][1](traffic()))
    return file


def figures(qlinkgen: Run, *arguments: str | Path, code: int = 0) -> dict[str, Any]:
    done = qlinkgen("stats", "qlink", "--format", "json", *arguments)
    assert done.code == code, done.err
    found: dict[str, Any] = json.loads(done.out)
    return found


def test_figures(qlinkgen: Run, capture: Path) -> None:
    found = figures(qlinkgen, capture)
    bursts = traffic()
    size = sum(len(each.data) for each in bursts)
    assert (found["frames"], found["bytes"], found["outside"]) == (200, size, 0)
    assert found["faults"] == {"crc": 1}
    assert found["seconds"] == pytest.approx(9.963)
    assert found["utilisation"] == pytest.approx(size * 10 / 115200 / 9.963)
    (row,) = found["rows"]
    counts = ("node", "name", "requests", "repeats", "responses", "late", "unanswered", "strays", "messages")
    assert [row[each] for each in counts] == [3, "motion", 101, 1, 99, 1, 3, 0, 0]
    times = row["times"]
    assert times["count"] == 99
    assert times["median"] == pytest.approx(0.003, rel=0.03)
    assert times["most"] == pytest.approx(0.05)
    assert sum(count for _, _, count in times["histogram"]) == 99


def test_text_and_page(qlinkgen: Run, capture: Path, tmp_path: Path) -> None:
    text = qlinkgen("stats", "qlink", capture)
    assert re.search(r"^ *3 +motion +101 +1 +99 +1 +3 +3\.0\d +\S+ +50\.00$", text.out, re.MULTILINE)
    assert "bad frames: crc 1" in text.out
    assert re.search(r"^ *3 +1$", text.out, re.MULTILINE)  # the node whose answer was damaged
    page = tmp_path / "page.html"
    done = qlinkgen("stats", "qlink", capture, "--format", "html", "-o", page)
    assert "wrote" in done.err
    html = page.read_text("utf-8")
    assert html.count("<svg") == 2
    assert "Response times of motion, node 3" in html
    assert not re.search(r"(src|href)=|@import|url\(", html)
    plain = tmp_path / "text"
    assert qlinkgen("stats", "qlink", capture, "-o", plain).code == 0
    assert "bad frames: crc 1" in plain.read_text("utf-8")


def test_names_of_files_are_not_markup(qlinkgen: Run, capture: Path, tmp_path: Path) -> None:
    file = tmp_path / "<script>alert(1)<script>"
    file.write_bytes(capture.read_bytes())
    assert "<script>" not in qlinkgen("stats", "qlink", file, "--format", "html").out


def test_filters_and_several_files(qlinkgen: Run, capture: Path) -> None:
    assert figures(qlinkgen, capture, capture)["frames"] == 400
    some = figures(qlinkgen, capture, "--message", "motion.request")
    assert (some["frames"], some["outside"]) == (101, None)
    assert figures(qlinkgen, capture, "--node", "4", code=1)["frames"] == 0
    assert figures(qlinkgen, capture, "--strict", code=1)["frames"] == 200


def test_captures_without_times(qlinkgen: Run, tmp_path: Path) -> None:
    file = tmp_path / "line.bin"
    file.write_bytes(b"".join(each.data for each in traffic()))
    found = figures(qlinkgen, file)
    assert (found["frames"], found["seconds"], found["utilisation"]) == (200, None, None)
    (row,) = found["rows"]
    assert (row["requests"], row["responses"], "times" in row) == (101, 99, False)


def test_a_ring_and_a_host(qlinkgen: Run, tmp_path: Path) -> None:
    file = tmp_path / "log"
    file.write_text("0.1 TX 94 7f 90\n0.4 TX 94 7f 90\n")
    found = json.loads(qlinkgen("stats", "trio", "--format", "json", file).out)
    assert [(row["name"], row["address"], row["messages"]) for row in found["rows"]] == [
        ("keypad_mode", 2, 2)
    ]
    file.write_text("0.1 TX 4a\n0.104 RX 0012d687d6e3\n0.2 TX 4a\n")
    found = json.loads(qlinkgen("stats", "mc1231a", "--format", "json", file).out)
    (row,) = found["rows"]
    assert (row["name"], row["requests"], row["responses"]) == ("get_pos", 2, 1)
    assert row["times"]["most"] == pytest.approx(0.004)


def test_refusals(qlinkgen: Run, tmp_path: Path) -> None:
    file = tmp_path / "log"
    wire = qlinkgen("encode", "modbus_rtu", "read_coils", "--node", "17", "start=0", "quantity=3").out
    refused = qlinkgen("encode", "modbus_rtu", "read_coils.exception", "--node", "17", "code=2")
    assert refused.code == 0, refused.err
    file.write_text(f"0.1 TX {wire.strip()}\n0.12 RX {refused.out}")
    found = json.loads(qlinkgen("stats", "modbus_rtu", "--format", "json", file).out)
    (row,) = found["rows"]
    assert (row["responses"], row["refused"], row["unanswered"]) == (1, 1, 0)


def test_quantiles() -> None:
    chance = random.Random(1)
    times = [10 ** chance.uniform(-5, 2) for _ in range(5000)]
    histogram = Histogram()
    for each in times:
        histogram.add(each)
    times.sort()
    for part in (0.01, 0.5, 0.9, 0.99):
        assert histogram.quantile(part) == pytest.approx(times[int(part * len(times)) - 1], rel=0.03)
    assert histogram.quantile(1.0) == times[-1]
    assert histogram.mean() == pytest.approx(sum(times) / len(times))
    assert sum(count for _, _, count in histogram.bars(7)) == 5000
    assert len(list(histogram.bars(7))) <= 7
    assert (Histogram().quantile(0.5), list(Histogram().bars(5))) == (0.0, [])


def test_load_over_any_time() -> None:
    load = Load()
    for at in (START, START + 5, START + 3600 * 10**9, START - 9):
        load.add(at, 10)
    assert sum(load.bytes()) == 40
    assert load.bytes()[0] == 30
    assert len(load.bytes()) <= 240
    assert load.piece * len(load.bytes()) >= 3600 * 10**9


def test_a_monitor_of_a_capture(qlinkgen: Run, capture: Path, tmp_path: Path) -> None:
    done = qlinkgen("monitor", "qlink", "--capture", capture)
    assert done.code == 0
    assert "qlinkgen: 201 frames; 0 bytes outside frames" in done.err
    assert done.lines[0].split()[:6] == ["0.000000", "master", ">", "node", "3", "motion.request"]
    assert "[after 3.00 ms]" in done.lines[1]
    for said in ("[repeat]", "[late, after 50.00 ms]", "damaged (crc)", "[not answered]"):
        assert said in done.out
    found = [json.loads(line) for line in qlinkgen("monitor", "qlink", "--capture", capture, "--json").lines]
    assert found[1]["delay"] == pytest.approx(0.003)
    assert [each["at"] for each in found] == sorted(each["at"] for each in found)
    assert len(qlinkgen("monitor", "qlink", "--capture", capture, "--count", "3").lines) == 3
    for arguments, message in (
        (("qlink",), "give a PORT, or --capture FILE"),
        (("qlink", "/dev/null", "--capture", capture), "give a PORT, or --capture FILE"),
        (("trio", "--capture", capture), "`qlinkgen decode trio"),
    ):
        done = qlinkgen("monitor", *arguments)
        assert done.code == 2
        assert message in done.err
    empty = tmp_path / "empty"
    empty.write_bytes(b"")
    assert qlinkgen("monitor", "qlink", "--capture", empty).code == 1


def test_what_a_capture_covers(qlinkgen: Run, capture: Path, tmp_path: Path) -> None:
    done = qlinkgen("coverage", "qlink", capture)
    assert done.code == 0
    assert done.lines[0].startswith("2 of ")
    assert re.search(r"^ +counter +101 +0\.\.99 +0\.\.255$", done.out, re.MULTILINE)
    assert re.search(r"^ +motor_status +99 +0 values +2 +running, position_valid$", done.out, re.MULTILINE)
    assert re.search(r"^node_start\.request +0 +the message$", done.out, re.MULTILINE)
    found = json.loads(qlinkgen("coverage", "qlink", capture, "--format", "json").out)
    assert found["messages"]["motion.request"] == 101
    (position,) = (each for each in found["values"] if each["field"] == "position" and each["count"])
    assert (position["least"], position["most"]) == (0, 99)
    gaps = qlinkgen("coverage", "qlink", capture, "--missing")
    assert gaps.code == 1
    assert "counter" not in gaps.out
    assert qlinkgen("coverage", "qlink", capture, "--node", "9").code == 1


def test_coverage_without_gaps(qlinkgen: Run, tmp_path: Path) -> None:
    """Names of enums, flags, booleans and bits, in arrays and records."""
    schema, file = tmp_path / "own.yaml", tmp_path / "hex"
    schema.write_text(
        """\
qlinkgen: 1
protocol: {name: own, revision: "1", source: Made up}
enums: {mode: {type: u8, values: {off: 0, on: 1}}}
flags: {state: {type: u8, values: {hot: 0, wet: 1}}}
frame:
  parts:
    start: {role: constant, value: 7E}
    size: {role: length, type: u8, counts: [data]}
    number: {role: message, type: u8}
    data: {role: payload, size: 0..32}
bus: {kind: ring}
messages:
  told:
    id: 1
    fields: {mode: mode, modes: "mode[2]", state: state, sure: bool}
"""
    )
    wires = [
        qlinkgen("encode", schema, "told", "mode=on", "modes=off,on", "state=1", "sure=true"),
        qlinkgen("encode", schema, "told", "mode=off", "modes=off,off", "state=2", "sure=false"),
    ]
    file.write_text(wires[0].out)
    first = qlinkgen("coverage", schema, file, "--missing")
    assert first.code == 1, wires[0].err + first.err
    assert re.findall(r"^ *(\w+) +1 .* (\w+)$", first.out, re.MULTILINE) == [
        ("mode", "off"), ("state", "wet"), ("sure", "false")
    ]  # fmt: skip
    file.write_text("".join(each.out for each in wires))
    assert qlinkgen("coverage", schema, file, "--missing").code == 0
