"""Large inputs: time grows with their size, not with its square."""

from __future__ import annotations

from pathlib import Path
from time import process_time

import pytest

from qlinkgen.importers.header import read_header
from qlinkgen.importers.ksy import read_ksy
from qlinkgen.importers.mavlink import read_mavlink
from qlinkgen.importers.table import read_csv
from tests.importers.conftest import Reader, survives

#: A few seconds; each takes minutes where every item looks at all others.
PATIENCE = 15


def dialect(entries: int) -> str:
    listed = "".join(f'<entry name="A" value="{at}"/>' for at in range(entries))
    field = '<field type="uint16_t" name="a" enum="E"/>'
    message = f'<messages><message id="1" name="m">{field}</message></messages>'
    return f'<mavlink><enums><enum name="E">{listed}</enum></enums>{message}</mavlink>'


INPUTS: dict[str, tuple[Reader, str]] = {
    "structs": (read_header, "".join(f"struct s{at} {{ uint8_t a; }};\n" for at in range(1000))),
    "members": (read_header, f"struct s {{ {' '.join(f'uint8_t a{at};' for at in range(5000))} }};"),
    "constants": (
        read_header,
        f"enum e {{ {', '.join(f'A{at}' for at in range(15000))} }}; struct s {{ char a; }};",
    ),
    "comments": (read_header, "struct s { uint8_t a; };\n" + "// x\n" * 150_000),
    "terms": (read_header, f"struct s {{ uint8_t a; }}; int x[{'1+' * 200_000}1];"),
    "brackets": (read_header, "struct s { uint8_t a; };" + "[" * 100_000),
    "equal names": (read_csv, "name,type\n" + "x,u8\n" * 8_000),
    "messages": (read_csv, "message,name,type\n" + "".join(f"m{at},a,u8\n" for at in range(1500))),
    "errors": (read_csv, "message,name,type\n" + "".join(f"m{at},a,text[70000]\n" for at in range(5000))),
    "rows": (read_csv, "a,b\n" * 90_000),
    "attributes": (
        read_ksy,
        "meta: {id: x, endian: le}\nseq:\n" + "".join("  - {id: a, type: u1}\n" for _ in range(5000)),
    ),
    "entries": (read_mavlink, dialect(15000)),
}


@pytest.mark.slow
@pytest.mark.parametrize("what", INPUTS)
def test_time(tmp_path: Path, what: str) -> None:
    read, text = INPUTS[what]
    start = process_time()
    survives(tmp_path, read, text, "x.txt")
    assert process_time() - start < PATIENCE
