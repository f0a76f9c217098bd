"""`qlinkgen shell`: lines, units, completion, and the line editor."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from prompt_toolkit.application import create_app_session
from prompt_toolkit.completion import CompleteEvent
from prompt_toolkit.document import Document
from prompt_toolkit.input import PipeInput, create_pipe_input
from prompt_toolkit.output import DummyOutput

from qlinkgen.backends.python import load
from qlinkgen.cli.shell_lines import Lines, perform_all
from qlinkgen.cli.shell_prompt import Offers, reader
from qlinkgen.link import MasterEngine, SlaveEngine
from qlinkgen.protocols.qlink import VirtualNode
from qlinkgen.schema import load as load_schema
from qlinkgen.sim import VirtualPort, Wire
from qlinkgen.sim.generic import GenericNode
from qlinkgen.transport.blocking import BlockingMaster
from qlinkgen.transport.conversation import timing_of
from tests.cli.conftest import OnLine, Run
from tests.cli.wire import line

SILENT = ("--attempts", "1", "--echo", "none")


def test_lines_of_standard_input(qlinkgen: Run, on_line: OnLine) -> None:
    node = VirtualNode(3, position_type=1, serial_number=77, t1_delay=0.3)
    port = on_line(line(VirtualNode(1), node, baud=115200))
    text = b"""\
motor_position      # of node 3
.node 1
motor_position @0x03
node_setup @3 node_number=3 "t1_delay=0.5 s" t2_delay=0.2s
node_info @3
node_start @0
.fields motion
.quit
nonsense
"""
    result = qlinkgen("shell", "qlink", port, "--node", "3", "--echo", "none", stdin=text)
    assert (result.code, result.err) == (0, "")
    assert result.lines[:2] == ["motor_position.response node 3", "  position = 0 encoder counts"]
    assert result.out.count("motor_position.response node 3\n") == 2
    assert "  t1_delay = 0.5 s" in result.lines
    assert "  sent; " in result.out
    assert any(row.startswith("segments") for row in result.lines)
    assert result.out.count("  answered after ") == 4
    assert [node.t1_delay, node.t2_delay] == [0.5, 0.2]


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("motoin", "did you mean motion?"),
        ("motion @3 countr=1", "did you mean counter?"),
        ("motion @17", "node: 17 cannot be sent"),
        ("motion.response @3", "is a response; send its request"),
        ("motor_position", "needs an address"),
        ("motor_position @9", "no answer; sent once"),
        ("read @1 size='3", "No closing quotation"),
        (".nod 3", "'.nod 3' is not a line of the shell; did you mean .node"),
        (".node", "'.node' is not a line of the shell; NODE: "),
        (".node 17", "qlink has nodes 1..16"),
    ],
)
def test_a_wrong_line_does_not_end_it(qlinkgen: Run, on_line: OnLine, text: str, error: str) -> None:
    port = on_line(line(VirtualNode(1), baud=115200))
    result = qlinkgen("shell", "qlink", port, *SILENT, stdin=f"{text}\nmotor_position @1\n".encode())
    assert result.code == 1
    assert error in result.err
    assert "motor_position.response node 1" in result.out


def test_own_words_list_what_there_is(qlinkgen: Run, on_line: OnLine) -> None:
    result = qlinkgen("shell", "qlink", on_line(line()), stdin=b".help\n.list\n")
    assert result.code == 0
    assert [row.split()[0] for row in result.lines[1:6]] == [".node", ".list", ".fields", ".help", ".quit"]
    listed = [row.split()[0] for row in result.lines[6:]]
    assert "motion" in listed
    assert not any(name.endswith(".response") for name in listed)


@pytest.mark.parametrize("words", [("trio", "x"), ("qlink", "x", "--node", "many")])
def test_refused(qlinkgen: Run, words: tuple[str, ...]) -> None:
    assert qlinkgen("shell", *words).code == 2


def lines_of(thermo: Path) -> Lines:
    protocol = load_schema(thermo)
    codec = load(protocol)
    wire = Wire(baud=9600)
    wire.attach(SlaveEngine(codec, GenericNode(codec, 3), baud=9600))
    port = VirtualPort(wire)
    master = BlockingMaster(MasterEngine(codec, timing_of(codec, port)), port)
    return Lines(protocol, codec, master, 3)


@pytest.mark.parametrize(
    ("text", "last", "found"),
    [
        ("", "", ["set_target", "get_log"]),
        ("se", "se", ["set_target"]),
        (".q", ".q", [".quit"]),
        (".fields get_log.", "get_log.", ["get_log.request", "get_log.response"]),
        ("set_target ", "", ["mode=", "target="]),
        ("set_target @3 mode=heat t", "t", ["target="]),
        ("set_target mode=h", "mode=h", ["mode=heat"]),
        ("nonsense m", "m", []),
    ],
)
def test_completion(thermo: Path, text: str, last: str, found: list[str]) -> None:
    words, items = lines_of(thermo).complete(text)
    assert (words, [item.value for item in items]) == (last, found)


@pytest.fixture
def keyboard() -> Iterator[PipeInput]:
    """Keys for the line editor, whose output is discarded."""
    with create_pipe_input() as keys, create_app_session(input=keys, output=DummyOutput()):
        yield keys


def test_the_line_editor(
    thermo: Path, tmp_path: Path, keyboard: PipeInput, capsys: pytest.CaptureFixture[str]
) -> None:
    """Ctrl-C discards a line, the arrow brings a line of last time back, Ctrl-D ends."""
    history = tmp_path / "home" / "history"
    for keys in ("nonsense\x03set_target mode=heat\r\x04", "\x1b[A\r\x04"):
        lines = lines_of(thermo)
        keyboard.send_text(keys)
        assert perform_all(lines, reader(lines, history))
        assert capsys.readouterr().out.startswith("set_target.response unit 3\n  answered after ")
    assert history.read_text().count("+set_target mode=heat") >= 1


def test_the_line_editor_completes(thermo: Path) -> None:
    offered = Offers(lines_of(thermo)).get_completions(Document("set_target mode=h"), CompleteEvent())
    assert [(each.text, each.start_position) for each in offered] == [("mode=heat", -len("mode=h"))]


def test_a_terminal_without_the_extra(
    qlinkgen: Run, on_line: OnLine, monkeypatch: pytest.MonkeyPatch
) -> None:
    port = on_line(line())
    monkeypatch.setitem(sys.modules, "qlinkgen.cli.shell_prompt", None)
    monkeypatch.setattr("qlinkgen.cli.shell.on_terminal_input", lambda: True)
    result = qlinkgen("shell", "qlink", port)
    assert result.code == 2
    assert 'pip install "qlinkgen[shell]"' in result.err
