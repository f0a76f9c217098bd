"""libFuzzer with sanitizers on the receiver, the frame decoder and every decoder of each header."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import pytest

from tests.c.conftest import PROTOCOLS, SHIPPED, protocol_of
from tests.c.test_compile import header
from tests.support.cfuzz import harness

#: Seconds for all shipped protocols together; the schemas of the tests get a little beside.
SECONDS = int(os.environ.get("QLINKGEN_FUZZ_SECONDS", "30" if os.environ.get("CI") else "5"))
FLAGS = ("-std=c99", "-g", "-O1", "-fsanitize=fuzzer,address,undefined", "-fno-sanitize-recover=all")


@pytest.mark.slow
@pytest.mark.parametrize("name", PROTOCOLS)
def test_any_bytes(
    name: str, tmp_path: Path, require_tool: Callable[..., str], missing_tool: Callable[..., NoReturn]
) -> None:
    compiler = require_tool("clang", package="clang")
    header(name, tmp_path)
    (tmp_path / "fuzz.c").write_text(harness(protocol_of(name)))
    command = [compiler, *FLAGS, str(tmp_path / "fuzz.c"), "-o", str(tmp_path / "fuzz")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    if "libclang_rt.fuzzer" in done.stderr:
        missing_tool("libFuzzer", package="libclang-rt-14-dev")
    assert done.returncode == 0, done.stderr[:4000]
    seconds = SECONDS // len(SHIPPED) if name in SHIPPED else 2
    limits = [
        f"-max_total_time={max(1, seconds)}",
        "-max_len=300",
        "-timeout=10",
        f"-artifact_prefix={tmp_path}/",
        "-seed=1",
    ]
    done = subprocess.run(
        [str(tmp_path / "fuzz"), *limits], capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr[-4000:]
