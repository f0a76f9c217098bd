"""`qlinkgen export`: tables of captures."""

from __future__ import annotations

import csv
import json
from pathlib import Path

from qlinkgen.codecs import qlink
from tests.captures.written import EVERY, START, Burst
from tests.cli.conftest import THERMO, Run


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_tables_of_messages(qlinkgen: Run, tmp_path: Path) -> None:
    file, tables = tmp_path / "line.log", tmp_path / "deep" / "tables"
    bursts = []
    for index in range(5):
        at = START + index * 10**9
        request = qlink.MotionRequest(node=3, counter=index, segments=[1, index])
        answer = qlink.MotionResponse(
            node=3, counter=index, position=-index, motor_status=qlink.MotorStatus.RUNNING
        )
        bursts += [Burst(request.to_frame(), at, "sent"), Burst(answer.to_frame(), at + 10**6, "received")]
    bursts.append(Burst(bytes.fromhex("a5a504210315e9"), START + 10**10, "sent"))
    file.write_bytes(EVERY["log brackets"][1](bursts))
    done = qlinkgen("export", "qlink", file, "-o", tables)
    assert done.code == 0
    assert "wrote 11 rows" in done.err
    assert {each.name for each in tables.iterdir()} == {
        "motion.request.csv",
        "motion.response.csv",
        "faults.csv",
    }
    asked, answered = rows(tables / "motion.request.csv"), rows(tables / "motion.response.csv")
    assert [json.loads(each["segments"]) for each in asked] == [[1, index] for index in range(5)]
    assert [each["position"] for each in answered] == ["0", "-1", "-2", "-3", "-4"]
    assert {each["motor_status"] for each in answered} == {'["running"]'}
    assert answered[2]["time"] == f"{START // 10**9 + 2}.001000000"
    assert list(answered[0])[:3] == ["time", "offset", "node"]
    (fault,) = rows(tables / "faults.csv")
    assert (fault["kind"], fault["raw"]) == ("crc", "a5a504210315e9")
    qlinkgen("export", "qlink", file, "-o", tables, "--where", "counter == 2")
    assert len(rows(tables / "motion.request.csv")) == 1


def test_json_lines(qlinkgen: Run, tmp_path: Path) -> None:
    file = tmp_path / "line.bin"
    file.write_bytes(qlink.MotorPositionRequest(node=3).to_frame() * 3)
    assert qlinkgen("export", "qlink", file, file, "-o", tmp_path, "--to", "jsonl").code == 0
    lines = (tmp_path / "frames.jsonl").read_text("utf-8").splitlines()
    assert [json.loads(each)["offset"] for each in lines] == [0, 7, 14] * 2
    assert {json.loads(each)["file"] for each in lines} == {str(file)}


def test_an_own_schema(qlinkgen: Run, tmp_path: Path) -> None:
    schema, file = tmp_path / "thermo.yaml", tmp_path / "hex"
    schema.write_text(THERMO)
    wire = qlinkgen(
        "encode", schema, "get_log.response", "--node", "3", "samples=-1,2", "heating=true", "level=5"
    ).out
    file.write_text(wire)
    assert qlinkgen("export", schema, file, "-o", tmp_path).code == 0
    (row,) = rows(tmp_path / "get_log.response.csv")
    assert (row["unit"], row["samples"], row["heating"], row["level"]) == ("3", "[-1, 2]", "true", "5")


def test_what_is_refused(qlinkgen: Run, tmp_path: Path) -> None:
    file = tmp_path / "none"
    file.write_bytes(b"")
    assert qlinkgen("export", "qlink", file, "-o", tmp_path / "tables").code == 1
    done = qlinkgen("export", "qlink", file, "-o", file)
    assert (done.code, "it is not a folder" in done.err) == (2, True)
