"""The support code of the firmware tests: one build for all workers, and no process left running."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from tests.firmware import firmware
from tests.firmware.firmware import HANGS, ROOT, TARGETS, BuildFailed, Firmware, build
from tests.firmware.fixtures import BuildFirmware
from tests.firmware.line import Answers, Garbage


@pytest.fixture
def sources(tmp_path: Path, require_tool: Callable[..., str], monkeypatch: pytest.MonkeyPatch) -> Path:
    """A Makefile in place of the real one: it is slow, and logs each run."""
    require_tool("make", package="make")
    (tmp_path / "Makefile").write_text(
        "program:\n\tsleep 0.2; echo $(CPPFLAGS) >> log\n"
        "\ttest $(APP) != broken && touch $(BUILD)/$(PORT)-$(APP)\n"
    )
    monkeypatch.setattr(firmware, "SOURCES", tmp_path)
    return tmp_path


def test_many_builds_at_once_are_one(sources: Path) -> None:
    with ThreadPoolExecutor(4) as pool:
        programs = set(pool.map(lambda _: build("posix", "node", sources / "b", "-DX=1"), range(8)))
    assert programs == {sources / "b" / "posix-node"}
    assert (sources / "log").read_text() == "-DX=1\n"


def test_a_build_that_fails_says_so_to_everybody_and_is_not_tried_again(sources: Path) -> None:
    for _ in range(2):
        with pytest.raises(BuildFailed, match="make PORT=posix APP=broken ended with 2"):
            build("posix", "broken", sources / "b")
    assert len((sources / "log").read_text().splitlines()) == 1


@pytest.mark.parametrize("target", TARGETS)
def test_a_firmware_ends_when_it_is_told_to(target: str, build_firmware: BuildFirmware) -> None:
    with Firmware(target, build_firmware(target, "qlink_node", TARGETS[target].options)) as running:
        assert running.running
        assert Path(running.path).is_char_device()
        # Until QEMU handles the signal, the signal itself ends it.
        assert running.stop() in {0, -signal.SIGTERM}
    assert not running.running


def test_a_program_that_names_no_line_is_an_error(tmp_path: Path) -> None:
    for odd in ("true", "echo"):
        running = Firmware("posix", tmp_path)
        running._command = [odd]
        with pytest.raises(RuntimeError, match="ended before it named its line"):
            running.start()
        assert not running.running


def test_a_firmware_does_not_outlive_who_started_it(
    build_firmware: BuildFirmware, require_tool: Callable[..., str]
) -> None:
    require_tool("setpriv", package="util-linux")
    program = build_firmware("posix", "qlink_node", TARGETS["posix"].options)
    code = (
        "import sys, os, signal; from pathlib import Path; from tests.firmware.firmware import Firmware\n"
        "firmware = Firmware('posix', Path(sys.argv[1])); firmware.start()\n"
        "print(firmware._process.pid, flush=True); os.kill(os.getpid(), signal.SIGKILL)"
    )
    run = subprocess.run(
        [sys.executable, "-c", code, str(program)],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        check=False,
    )
    process = Path("/proc") / run.stdout.decode().strip()
    end = time.monotonic() + HANGS
    while process.exists() and "Z" not in (process / "stat").read_text().split()[2]:
        assert time.monotonic() < end, "it is still there"
        time.sleep(0.01)


class TestAnswers:
    """Only whole answers are accepted."""

    @staticmethod
    def frames() -> tuple[bytes, bytes]:
        """Two answers, the second with a checksum that ends in A5."""
        from qlinkgen.codecs import qlink

        odd = next(
            frame
            for position in range(100_000)
            if (frame := qlink.MotorPositionResponse(node=1, position=position).to_frame()).endswith(
                b"\xa5\0"
            )
        )
        return qlink.WriteResponse(node=1).to_frame(), odd

    def test_they_are_cut_wherever_they_are_split(self) -> None:
        first, odd = self.frames()
        for place in range(1, len(first + odd)):
            answers = Answers()
            stream = first + odd
            assert answers.feed(stream[:place]) + answers.feed(stream[place:]) == [first, odd]
        assert Answers().feed(odd[:-1]) == [], "the inserted byte belongs to it"

    @pytest.mark.parametrize("extra", [b"\0", b"\xa5", b"x"])
    def test_another_byte_is_garbage(self, extra: bytes) -> None:
        first, odd = self.frames()
        with pytest.raises(Garbage):
            Answers().feed(extra + first)
        with pytest.raises(Garbage):
            Answers().feed(first + extra + odd)
        with pytest.raises(Garbage):
            Answers().feed(odd[:-1] + first)
        with pytest.raises(Garbage):
            Answers().feed(first[:-1] + b"\0" + first)
