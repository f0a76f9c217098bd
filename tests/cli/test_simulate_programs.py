"""`qlinkgen simulate trio` with programs, keys and displays."""

from __future__ import annotations

import json
import os
import re
import select
import signal
import subprocess
import termios
from pathlib import Path

import pytest

from qlinkgen.protocols.trio import MotionCoordinator
from qlinkgen.protocols.trio.basic.lexer import WORDS
from tests.cli.conftest import Run
from tests.cli.wire import COMMAND, ENVIRONMENT, PATIENCE, REPOSITORY, end, objects, read_until, simulated

EXAMPLES = REPOSITORY / "examples" / "basic"
COUNTER = ("--ring", "coordinator,keypad,keypad", "--program", f"1={EXAMPLES / 'counter.bas'}")
FEEDER = ("--ring", "coordinator,coordinator,keypad", "--program", f"1={EXAMPLES / 'master.bas'}",
          "--program", f"2={EXAMPLES / 'feeder.bas'}")  # fmt: skip


def test_the_examples_use_every_word() -> None:
    text = "\n".join(re.sub(r"'.*|\".*?\"", "", path.read_text()) for path in EXAMPLES.glob("*.bas"))
    assert set(re.findall(r"\w+", text.upper())) >= WORDS


def test_two_keypads(qlinkgen: Run) -> None:
    done = qlinkgen("simulate", "trio", *COUNTER, "--closed", "--keys", "2=1 5 -", "--keys", "3=1s + enter")
    assert done.code == 0
    first, *shown = objects(done.out)
    assert first == {"port": None}
    for address in (2, 3):
        made = [each["display"] for each in shown if each["address"] == address]
        assert made[:3] == [[f"WANTED:{wanted:5}", "MADE:      0", "", ""] for wanted in (0, 1, 15)]
        assert made[-1] == ["WANTED:   15", "MADE:     15", "", ""]
        assert len(made) == 20
    assert "address 1, coordinator: 5 taken, 0 forwarded, NETSTAT 0; program ended; VR(1) = 15" in done.err


def test_no_parts(qlinkgen: Run) -> None:
    done = qlinkgen("simulate", "trio", *COUNTER, "--closed", "--keys", "3=- enter")
    assert objects(done.out)[-1]["display"] == ["WANTED:    0", "MADE:      0", "NOTHING TO DO", ""]


@pytest.mark.parametrize("options", [(), ("--baud", "38400"), ("--set", "crc=crc-16/xmodem")])
def test_two_programs(options: tuple[str, ...], qlinkgen: Run) -> None:
    done = qlinkgen("simulate", "trio", *FEEDER, "--closed", *options, "--keys", "3=+ + 11 20 0.5s - start")
    assert done.code == 0
    shown = [each["display"] for each in objects(done.out)[1:]]
    assert ["LENGTH   2.75", "", "FED   2.75 LAMP 1", ""] in shown
    assert shown[-1] == ["LENGTH   2.50", "", "FED   5.25 LAMP 0", ""]
    assert re.search(r"NETSTAT 0; program at \S+master.bas:11:3; VR\(201\) = 5.25", done.err)


def test_faults_on_a_closed_ring(qlinkgen: Run) -> None:
    options = ("--faults", "flip=1", "--seed", "1", "--seconds", "2")
    done = qlinkgen("simulate", "trio", *FEEDER, "--closed", *options)
    assert "4 damaged, 5 faults (flip 5); seed 1\n" in done.err


def test_what_a_format_with_a_point_counts(qlinkgen: Run, tmp_path: Path) -> None:
    program = tmp_path / "x.bas"
    program.write_text("SEND(10,2,10)\nPRINT #10,2.5[6.1];")
    options = ("--ring", "coordinator,keypad", "--closed", "--program", f"1={program}")
    for given, row in (((), "     2.5"), (("before",), "     2.5"), (("width",), "   2.5")):
        done = qlinkgen("simulate", "trio", *options, *(("--point-format", *given) if given else ()))
        assert objects(done.out)[-1]["display"] == [row, "", "", ""]


def test_the_time_to_end(qlinkgen: Run, tmp_path: Path) -> None:
    program = tmp_path / "x.bas"
    program.write_text("x: WA(1000): VR(0)=VR(0)+1: GOTO x")
    for options, seconds in (((), 10), (("--seconds", "25.5"), 25)):
        done = qlinkgen("simulate", "trio", "--program", f"1={program}", "--closed", *options)
        assert f"VR(0) = {seconds}\n" in done.err
    program.write_text("WA(1000)\nVR(0)=1\nWAIT UNTIL FALSE")
    done = qlinkgen("simulate", "trio", "--program", f"1={program}", "--closed")
    assert f"program at {program}:3:1; VR(0) = 1\n" in done.err


def test_keys_that_no_offset_ever_allows_do_not_keep_it_running(qlinkgen: Run, tmp_path: Path) -> None:
    program = tmp_path / "x.bas"
    program.write_text("x: IF NOT(KEY#4) THEN GOTO x")
    ring = ("--ring", "coordinator,keypad", "--closed", "--program", f"1={program}", "--keys", "2=1 2")
    done = qlinkgen("simulate", "trio", *ring)
    assert (done.code, done.out) == (0, '{"port": null}\n')


def test_a_program_that_cannot_go_on(qlinkgen: Run, tmp_path: Path) -> None:
    program = tmp_path / "x.bas"
    program.write_text("SEND(10,2,10)\n  PRINT #10,VR(251)\n")
    done = qlinkgen(
        "simulate", "trio", "--ring", "coordinator,keypad", "--closed", "--program", f"1={program}"
    )
    assert done.code == 1
    told = f"{program}:2:13: VR(251): a Motion Coordinator has the variables VR(0) to VR(250)"
    assert f"qlinkgen: address 1: {told}\n" in done.err
    assert f"; program failed at {program}:2:13" in done.err


def test_a_program_that_cannot_be_read(qlinkgen: Run, tmp_path: Path) -> None:
    program = tmp_path / "x.bas"
    program.write_bytes(b"' 20 \xb0C\nPRNT\n")
    done = qlinkgen("simulate", "trio", "--closed", "--program", f"1={program}")
    assert (done.code, done.out) == (1, "")
    assert done.err == f"qlinkgen: error: {program}:2:1: unknown word 'prnt'; did you mean PRINT?\n"


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("--program", "1"), "--program 1: write the address of a coordinator and a value, such as 1=x"),
        (("--program", "x=a.bas"), "such as 1=a.bas"),
        (("--program", "2=a.bas"), "--program 2=a.bas: the ring has the addresses 1 to 1; see --ring"),
        (("--program", "1=nowhere.bas"), "cannot read nowhere.bas: No such file or directory"),
        (("--ring", "keypad", "--program", "1=a"), "address 1 is a keypad; give the address of"),
        (("--keys", "1=5"), "--keys 1=5: address 1 is a coordinator; give the address of a keypad"),
        (("--ring", "keypad", "--keys", "1=5", "--keys", "1=6"), "address 1 has one already"),
        (("--ring", "keypad", "--keys", "1=5 64"), "'64' is neither a key nor a pause; write the number"),
        (("--ring", "keypad", "--closed"), "a ring needs a Motion Coordinator"),
        (("--point-format", "width"), "--point-format width: no program prints; give --program, or omit it"),
        (("--closed", "--link", "x"), "--link x: a closed ring has no port"),
    ],
)  # fmt: skip
def test_wrong_usage(arguments: tuple[str, ...], text: str, qlinkgen: Run) -> None:
    done = qlinkgen("simulate", "trio", *arguments)
    assert (done.code, done.out) == (2, "")
    assert text in done.err


def test_of_rings_only(qlinkgen: Run) -> None:
    for options in (
        ("--program", "1=x"),
        ("--keys", "1=x"),
        ("--closed",),
        ("--seconds", "1"),
        ("--point-format", "width"),
    ):
        done = qlinkgen("simulate", "qlink", *options)
        assert (done.code, done.out) == (2, "")
        assert f"{options[0]} requires a ring; qlink is a bus with a master" in done.err


def test_with_a_port(tmp_path: Path) -> None:
    program = tmp_path / "x.bas"
    program.write_text('SEND(10,2,11)\nGET #4,a\nPRINT #10,"KEY",a[0];\nSEND(11,1,0,a)\n')
    ring = ("--ring", "coordinator,keypad", "--program", f"1={program}", "--keys", "2=42")
    with simulated("trio", *ring) as (path, process):
        with MotionCoordinator.open(path) as outside:  # closes the ring
            outside.wait_until(lambda: outside.vr[0] == 42, PATIENCE)
        shown = read_until(process.stdout, "KEY 42")
        code, _, err = end(process, signal.SIGTERM)
    assert json.loads(shown)["display"] == ["KEY 42", "", "", ""]
    assert code == 0
    assert "program ended" in err


def test_with_a_port_for_a_time(tmp_path: Path) -> None:
    program = tmp_path / "x.bas"
    program.write_text("RETURN")
    with simulated("trio", "--program", f"1={program}", "--seconds", "0.1") as (_, process):
        _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert f"address 1: {program}:1:1: RETURN without GOSUB" in err.decode()


def read_terminal(descriptor: int, wanted: str) -> bytes:
    data = b""
    while wanted not in data.decode():
        assert select.select([descriptor], [], [], PATIENCE)[0], data
        data += os.read(descriptor, 4096)
    return data


def test_keys_typed_on_a_terminal() -> None:
    own, theirs = os.openpty()
    before = termios.tcgetattr(own)
    environment = {**ENVIRONMENT, "TERM": "xterm"}
    command = [*COMMAND, "simulate", "trio", *COUNTER, "--closed"]
    with subprocess.Popen(command, env=environment, stdin=theirs, stdout=theirs, stderr=theirs) as process:
        try:
            shown = b""
            for typed, wanted in ((b"", "WANTED:    0"), (b"1", "WANTED:    1"), (b"x+", "WANTED:    2"),
                                  (b"\t", "> address 3"), (b"-\r", "MADE:      1")):  # fmt: skip
                os.write(own, typed)
                shown += read_terminal(own, wanted)
            assert termios.tcgetattr(own) != before, "it does not wait for lines"
            process.send_signal(signal.SIGINT)
            shown += read_terminal(own, "damaged")
            assert process.wait(PATIENCE) == 0
            assert termios.tcgetattr(own) == before
        finally:
            process.kill()
            os.close(theirs)
            os.close(own)
    assert "\x1b[15A" in shown.decode(), "drawn over the last state"
    assert "program ended; VR(1) = 1" in shown.decode()
