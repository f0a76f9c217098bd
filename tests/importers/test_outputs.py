"""What is imported works in every output: generated code agrees with interpreter and reference."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from qlinkgen.importers.checking import written
from qlinkgen.importers.header import read_header
from qlinkgen.importers.ksy import read_ksy
from qlinkgen.importers.mavlink import read_mavlink
from qlinkgen.importers.notes import Notes
from qlinkgen.importers.table import read_csv
from tests.importers.test_header import HEADER, RECORDS
from tests.importers.test_mavlink import dialect
from tests.importers.test_table import TABLE
from tests.support.whole.trial import Effort, run_text

KSY = Path(__file__).parent / "ksy"
INPUTS: dict[str, tuple[Callable[..., Any], str]] = {
    "header": (read_header, HEADER),
    "records": (read_header, RECORDS),
    "table": (read_csv, TABLE),
    "mavlink": (lambda path, notes: read_mavlink(path, notes, version=1), dialect()),
    **{
        name: (read_ksy, (KSY / f"{name}.ksy").read_text())
        for name in (
            "arrays",
            "bit_flags",
            "can_frame",
            "conditions",
            "expressions",
            "gnss",
            "nested_types",
            "sensor_packet",
            "serial_frame",
            "tlv_stream",
        )
    },
}


@pytest.mark.slow
@pytest.mark.parametrize("name", INPUTS)
def test_every_output_agrees(tmp_path: Path, name: str, require_tool: Callable[..., str]) -> None:
    for compiler in ("gcc", "clang"):
        require_tool(compiler, package=compiler)
    read, text = INPUTS[name]
    (tmp_path / "file").write_text(text)
    notes = Notes("file")
    outcome = run_text(
        written(read(tmp_path / "file", notes), notes), 0, effort=Effort(messages=4, streams=24)
    )
    assert not outcome.refused
    assert not outcome.differences, outcome.report()
