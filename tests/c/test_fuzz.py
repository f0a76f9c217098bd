"""libFuzzer with sanitizers on three targets: the receiver, the decoders, dispatch.

The first two decode any bytes, and encode and compare the decoded messages. The third calls functions with
any response through a slave's table: the result must be a frame that can be decoded.
"""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NoReturn

import pytest

from tests.c.conftest import OTHERS, protocol_of
from tests.c.test_compile import header
from tests.support import cfuzz_corpus
from tests.support.ccoverage import Refuted, replay
from tests.support.cfuzz import FUZZER, TARGETS, compiled, program
from tests.support.planted import Fault
from tests.support.sharing import made_once

#: Seconds for each target, over all shipped protocols; the schemas of the tests get less.
SECONDS = int(os.environ.get("QLINKGEN_FUZZ_SECONDS", "20" if os.environ.get("CI") else "5"))
OTHER_SECONDS = 1
#: The fuzzers run in parallel with other tests, at lower priority.
NICE = ("nice", "-n", "15")
Missing = Callable[..., NoReturn]


def build(compiler: str, folder: Path, name: str, missing_tool: Missing) -> Path:
    done = compiled(compiler, folder, name, *FUZZER)
    if "libclang_rt.fuzzer" in done.stderr:
        missing_tool("libFuzzer", package="libclang-rt-14-dev")
    assert done.returncode == 0, done.stderr[:4000]
    return folder / name


def fuzz(fuzzer: Path, seconds: int, *corpus: Path) -> int:
    """Fuzz for a number of seconds; returns the number of inputs."""
    options = [
        f"-max_total_time={seconds}",
        "-max_len=300",
        "-timeout=30",
        f"-artifact_prefix={fuzzer}-",
        "-seed=1",
        "-print_final_stats=1",
        "-print_funcs=0",
    ]
    command = [*NICE, str(fuzzer), *options, *(str(folder) for folder in corpus)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=seconds + 300, check=False)
    found = [file.read_bytes().hex() for file in fuzzer.parent.glob(f"{fuzzer.name}-*")]
    assert done.returncode == 0, f"{found}\n{done.stderr[-4000:]}"
    (runs,) = re.findall(r"stat::number_of_executed_units:\s*(\d+)", done.stderr)
    return int(runs)


@pytest.mark.slow
def test_shipped_protocols(tmp_path: Path, require_tool: Callable[..., str], missing_tool: Missing) -> None:
    """Run all fuzzers in parallel in one test, which occupies one worker for the time of one fuzzer."""
    compiler = require_tool("clang", package="clang")

    def run(target: str) -> tuple[int, int]:
        folder = tmp_path / target
        folder.mkdir()
        cfuzz_corpus.write_program(folder, target, (target,))
        known = cfuzz_corpus.read(target)
        files = cfuzz_corpus.unpack(known, folder / "corpus")
        return fuzz(build(compiler, folder, target, missing_tool), SECONDS, files), len(known)

    with ThreadPoolExecutor(len(TARGETS)) as pool:
        for runs, known in pool.map(run, TARGETS):
            assert runs > known > 100


@pytest.mark.slow
@pytest.mark.parametrize("name", OTHERS)
def test_other_frames(
    name: str, tmp_path: Path, require_tool: Callable[..., str], missing_tool: Missing
) -> None:
    compiler = require_tool("clang", package="clang")
    header(name, tmp_path)
    (tmp_path / "fuzz.c").write_text(program([protocol_of(name)], TARGETS))
    assert fuzz(build(compiler, tmp_path, "fuzz", missing_tool), OTHER_SECONDS) > 100


FAULTS = [
    pytest.param("receiver", Fault("qlink_receive", r"> \d+U", "> 254U"), id="any-length"),
    pytest.param("receiver", Fault("qlink_receive", "position = 0U", "position = 1U"), id="first-byte"),
    pytest.param(
        "decoders", Fault("qlink_node_setup_request_decode", "size != 4U", "size > 4U"), id="read-behind"
    ),
    pytest.param("decoders", Fault("qlink_node_setup_request_decode", "> 16U", "> 254U"), id="range"),
    pytest.param("dispatch", Fault("qlink_slave_dispatch", "== slave->node", "<= slave->node"), id="others"),
    pytest.param("dispatch", Fault("qlink_slave_dispatch", r"size > 0\)", "size > 99)"), id="no-answer"),
]


@pytest.mark.parametrize(("target", "fault"), FAULTS)
def test_the_corpus_finds_a_planted_fault(
    target: str, fault: Fault, tmp_path: Path, shared: Path, require_tool: Callable[..., str]
) -> None:
    compiler = require_tool("gcc", package="gcc")
    flags = ("-std=gnu99", "-O0", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-DREPLAY")
    # The first byte selects the protocol if there are several.
    inputs = [each for each in cfuzz_corpus.read(target) if each[0] % len(cfuzz_corpus.SHIPPED) == 0]
    right = shared / f"corpus of {target}"
    with made_once(right) as first:
        if first:
            header("qlink", right)
            (right / f"{target}.c").write_text(program([protocol_of("qlink")], (target,)))
            assert compiled(compiler, right, target, *flags).returncode == 0
            replay(right / target, inputs)
    (tmp_path / f"{target}.c").write_text((right / f"{target}.c").read_text())
    (tmp_path / "qlink.h").write_text(fault.planted((right / "qlink.h").read_text("utf-8")))
    assert compiled(compiler, tmp_path, target, *flags).returncode == 0
    with pytest.raises(Refuted):
        replay(tmp_path / target, inputs)
