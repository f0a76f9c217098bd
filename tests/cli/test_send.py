"""`qlinkgen send`: one transaction, written as for encode and printed as by decode."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from qlinkgen.backends.python import load
from qlinkgen.cli.repeating import summary
from qlinkgen.codecs import qlink
from qlinkgen.link import SlaveEngine
from qlinkgen.link.poll import PollStatistics
from qlinkgen.protocols.qlink import VirtualNode
from qlinkgen.schema import load as load_schema
from qlinkgen.sim import Wire
from qlinkgen.sim.pty_bus import PtyBus
from qlinkgen.transport import PtyPort, open_port, open_pty
from tests.cli.conftest import OnLine, Run
from tests.cli.full_disk import FULL_DISK
from tests.cli.wire import (
    CALM,
    PATIENCE,
    REPOSITORY,
    bus,
    call,
    end,
    line,
    objects,
    read_until,
    simulated,
    started,
)

SCHEMAS = REPOSITORY / "tests" / "schemas"


@pytest.fixture
def silent() -> Iterator[PtyPort]:
    """A port without a node."""
    with open_pty() as port:
        yield port


def test_as_processes() -> None:
    with simulated("qlink", "--nodes", "3") as (path, _):
        done = call("send", "qlink", path, "motion", "--node", "3", "counter=9", "segments=5,6", *CALM)
        assert (done.returncode, done.stderr) == (0, "")
        assert objects(done.stdout) == [
            {
                "message": "motion.response",
                "node": 3,
                "fields": {"counter": 9, "inputs": 0, "position": 0, "motor_status": 2, "fifo_space": 46},
            }
        ]
        started = call("send", "qlink", path, "node_start", "--node", "0")
        assert (started.returncode, started.stdout, started.stderr) == (0, "", "")


def test_the_counter_is_used_as_it_is(qlinkgen: Run) -> None:
    node = VirtualNode(3, record=True)
    with bus(node) as running:
        for counter in (200, 200, 7):
            arguments = ("motion", "--node", "3", f"counter={counter}", "segments=1")
            found = json.loads(qlinkgen("send", "qlink", running.path, *arguments, *CALM).out)
            assert found["fields"]["counter"] == counter
    assert (node.statistics.motions, node.statistics.duplicates) == (2, 1)


def test_every_way_to_say_it(qlinkgen: Run) -> None:
    with bus() as running:
        for words in (
            ("motor_position", "--node", "1"),
            ("motor_position.request", "--address", "0x01"),
            ("motor_position", "--json", "{}", "--node", "1"),
            ("--json", '{"message": "motor_position.request", "node": 1, "fields": {}}'),
        ):
            result = qlinkgen("send", "qlink", running.path, *words, *CALM)
            assert (result.code, result.err) == (0, "")
            assert json.loads(result.out) == {
                "message": "motor_position.response",
                "node": 1,
                "fields": {"position": 0},
            }


def test_a_renumbered_node_may_answer_with_its_new_number(qlinkgen: Run) -> None:
    node = VirtualNode(3)
    with bus(node) as running:
        result = qlinkgen("send", "qlink", running.path, "node_setup", "--node", "3", "node_number=9", *CALM)
    assert json.loads(result.out)["node"] == 9
    assert node.number == 9


def test_no_answer(qlinkgen: Run, silent: PtyPort) -> None:
    request = ("qlink", silent.path, "motor_position", "--node", "4", "--slack", "0.05", "--echo", "none")
    result = qlinkgen("send", *request)
    assert (result.code, result.out) == (1, "")
    assert "motor_position.request to node 4: no answer; sent 3 times" in result.err
    frame = qlink.MotorPositionRequest(node=4).to_frame()
    assert silent.read(0) == 3 * frame
    result = qlinkgen("send", *request, "--attempts", "1")
    assert "sent once" in result.err
    assert silent.read(0) == frame


def test_what_must_not_be_repeated_is_sent_once(qlinkgen: Run, silent: PtyPort) -> None:
    request = ("motor_request", "--node", "4", "motor_data=01", "--slack", "0.05", "--echo", "none")
    assert qlinkgen("send", "qlink", silent.path, *request, "--attempts", "5").code == 1
    assert silent.read(0) == qlink.MotorRequestRequest(node=4, motor_data=b"\x01").to_frame()


class Reciter:
    """A station that answers every request with the same bytes."""

    def __init__(self, answer: bytes) -> None:
        self._answer = answer
        self._due = False

    def receive(self, data: bytes, now: float) -> None:
        self._due = True

    def bytes_to_send(self, now: float) -> bytes:
        answer, self._due = self._answer if self._due else b"", False
        return answer

    def next_timer(self) -> float | None:
        return 0.0 if self._due else None


@contextlib.contextmanager
def reciting(answer: bytes) -> Iterator[str]:
    wire = Wire(baud=None)
    wire.attach(Reciter(answer))
    with PtyBus(wire) as running:
        yield running.path


def test_a_wrong_answer(qlinkgen: Run) -> None:
    request = ("motor_position", "--node", "4", "--slack", "0.3", "--attempts", "1", "--echo", "none")
    good = qlink.MotorPositionResponse(node=4, position=1).to_frame()
    with reciting(good[:-1] + bytes([good[-1] ^ 1])) as path:
        result = qlinkgen("send", "qlink", path, *request)
        assert (result.code, result.out) == (1, "")
        assert "received only invalid replies (crc)" in result.err
    with reciting(qlink.MotorPositionResponse(node=5, position=1).to_frame()) as path:
        result = qlinkgen("send", "qlink", path, *request)
        assert (result.code, result.out) == (1, "")
        assert 'not the response: {"message": "motor_position.response", "node": 5' in result.err


def test_a_refusal_of_the_schema_is_shown(qlinkgen: Run) -> None:
    file = SCHEMAS / "modbus_rtu.yaml"
    codec = load(load_schema(file))
    refusal = codec.MESSAGES["read_input_registers.exception"](address=7, code=2)

    with reciting(refusal.to_frame()) as path:
        request = ("read_input_registers", "--node", "7", "start=1")
        result = qlinkgen("send", file, path, *request, "--attempts", "1", "--slack", "0.3")
    assert result.code == 1
    assert result.out == (
        '{"message": "read_input_registers.exception", "address": 7, '
        '"fields": {"code": "illegal_data_address"}, "refused": true}\n'
    )
    assert "refused by node 7: illegal_data_address" in result.err


def test_a_port_that_goes_away(qlinkgen: Run, silent: PtyPort) -> None:
    def unplug() -> None:
        silent.read(PATIENCE)
        silent.close()

    other = threading.Thread(target=unplug)
    other.start()
    result = qlinkgen("send", "qlink", silent.path, "motor_position", "--node", "4", *CALM)
    other.join()
    assert (result.code, result.out) == (1, "")
    assert f"{silent.path} was lost" in result.err


def test_two_commands_at_one_port(qlinkgen: Run) -> None:
    with bus() as running, open_port(running.path):
        done = call("send", "qlink", running.path, "motor_position", "--node", "1")
        assert (done.returncode, done.stdout) == (1, "")
        assert f"{running.path} is in use by" in done.stderr
        assert f"(process {os.getpid()})" in done.stderr
    with bus() as running:
        assert call("send", "qlink", running.path, "motor_position", "--node", "1", *CALM).returncode == 0


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("qlink", "motion", "--node", "3", "counter=256"), "counter: 256 cannot be sent"),
        (("qlink", "motion", "--node", "17"), "node: 17 cannot be sent"),
        (("qlink", "motion"), "needs an address"),
        (("qlink", "motion", "--node", "0"), "motion cannot be broadcast"),
        (("qlink", "motion", "--node", "3", "nonsense=1"), "motion.request has no field 'nonsense'"),
        (("qlink", "moition", "--node", "3"), "did you mean motion"),
        (
            ("qlink", "motion.response", "--node", "3"),
            "motion.response is a response; send its request",
        ),
        (("qlink",), "Missing argument 'MESSAGE'"),
        (("qlink", "motor_position", "--node", "3", "--attempts", "0"), "--attempts"),
        (
            ("qlink", "motor_position", "--node", "3", "--slack", "inf"),
            "--slack inf: not a number of seconds",
        ),
        (("qlink", "motor_position", "--node", "3", "--baud", "0"), "--baud"),
        (
            ("qlink", "motor_position", "--node", "3", "--axis", "1"),
            "--axis requires a host with one device",
        ),
        (("qlink", "motor_position", "--node", "3", "--seconds", "1"), "--seconds requires a ring"),
        (("trio", "keypad_mode", "--attempts", "2"), "trio is a ring: omit it"),
        (("trio", "keypad_mode", "mode=on_off"), "needs an address"),
        (("trio", "keypad_mode", "--address", "16"), "address: 16 cannot be sent"),
        (("trio", "character_transfer", "--address", "1", "characters=é"), "character_transfer"),
        (("mc1231a", "get_pos", "--node", "2"), "mc1231a has no address in its frame; omit --node 2"),
        (("mc1231a", "get_pos.response"), "get_pos.response is a response"),
        (("mc1231a", "get_pos", "--axis", "3"), "--axis"),
        (("mc1231a", "get_pos", "--check"), "add --axis 1 or --axis 2"),
        (("mc1231a", "get_vrsn", "--axis", "1"), "get_vrsn does not depend on the current axis"),
        (("mc1231a", "get_pos", "--echo", "none"), "--echo requires a bus with a master"),
    ],
)
def test_what_cannot_be_sent_is_refused_first(
    qlinkgen: Run, silent: PtyPort, arguments: tuple[str, ...], text: str
) -> None:
    result = qlinkgen("send", arguments[0], silent.path, *arguments[1:])
    assert (result.code, result.out) == (2, "")
    assert text in result.err
    assert silent.read(0) == b""


ONE_WAY = [
    (path, message.name)
    for path in sorted(SCHEMAS.glob("*.yaml"))
    for protocol in [load_schema(path)]
    if protocol.bus.kind == "master_slave"
    for message in protocol.messages
    if protocol.command_of(message) is None
]


@pytest.mark.parametrize(("path", "message"), ONE_WAY, ids=lambda each: getattr(each, "stem", each))
def test_a_message_that_nothing_answers(qlinkgen: Run, silent: PtyPort, path: Path, message: str) -> None:
    protocol = load_schema(path)
    node = ["--node", "3"] if protocol.message(message).addresses else []
    wire = qlinkgen("encode", path, message, *node)
    assert wire.code == 0, wire.err
    result = qlinkgen("send", path, silent.path, message, *node, "--baud", "9600")
    assert (result.code, result.out) == (0, "")
    assert result.err.endswith(f"qlinkgen: {message} sent; it has no response\n")
    assert silent.read(PATIENCE).hex() == wire.out.strip()


def test_no_port(qlinkgen: Run) -> None:
    result = qlinkgen("send", "qlink", "/dev/not-there", "motor_position", "--node", "3")
    assert (result.code, result.out) == (1, "")
    assert "port '/dev/not-there' does not exist" in result.err


def test_a_schema_without_a_speed(qlinkgen: Run, thermo: Path, silent: PtyPort) -> None:
    result = qlinkgen("send", thermo, silent.path, "set_target", "--node", "3")
    assert result.code == 2
    assert "the schema of thermo states no speed; add --baud N" in result.err
    with simulated(thermo, "--nodes", "3") as (path, _):
        result = qlinkgen("send", thermo, path, "get_log", "--node", "3", "first=0", "--baud", "9600", *CALM)
    assert result.code == 0
    assert json.loads(result.out)["fields"] == {"samples": [], "heating": False, "level": 0}
    assert "get_log.request is unconfirmed" in result.err


def test_no_search_for_an_echo_without_a_preamble(qlinkgen: Run, silent: PtyPort) -> None:
    request = ("read_input_registers", "--node", "7", "start=1", "--attempts", "1", "--slack", "0.05")
    assert qlinkgen("send", SCHEMAS / "modbus_rtu.yaml", silent.path, *request).code == 1
    assert silent.read(0)[:1] == b"\x07"
    searching = ("motor_position", "--node", "4", "--attempts", "1", "--slack", "0.05")
    assert qlinkgen("send", "qlink", silent.path, *searching).code == 1
    assert silent.read(0)[:4] == b"\0\0\xa5\xa5"


@FULL_DISK
def test_a_full_disk_leaves_a_usable_bus() -> None:
    request = ("motor_position", "--node", "1", *CALM)
    with simulated("qlink") as (path, _):
        with Path("/dev/full").open("wb") as full:
            done = call("send", "qlink", path, *request, stdout=full)
        assert done.returncode == 1
        assert "No space left on device" in done.stderr
        assert "Traceback" not in done.stderr
        assert call("send", "qlink", path, *request).returncode == 0


def test_a_dialogue() -> None:
    schema = str(SCHEMAS / "answers.yaml")
    with simulated(schema, "--nodes", "3") as (path, _):
        asked = ("send", schema, path, "transfer", "--node", "3", "number=5", *CALM)
        done = call(*asked, "--then", '{"start": 2}', "--then", '{"data": "0102"}')
        assert (done.returncode, done.stderr) == (0, "")
        acknowledged = {"message": "ack", "node": 3, "fields": {}}
        written = {"message": "transfer.written", "node": 3, "fields": {"number": 5, "size": 0}}
        assert objects(done.stdout) == [acknowledged, acknowledged, written]
        done = call(*asked, "--then", '{"start": 2}')
        assert done.returncode == 2
        assert (
            "followed by 2 frames: transfer.place, transfer.block; pass --then OBJECT for each" in done.stderr
        )


def test_answers_until_they_are_stopped() -> None:
    schema = str(SCHEMAS / "answers.yaml")
    with simulated(schema, "--nodes", "3") as (path, _):
        done = call("send", schema, path, "observe", "--node", "3", "number=5", "--count", "3", *CALM)
        told = {"message": "observe.response", "node": 3, "fields": {"value": 0}}
        assert (done.returncode, done.stderr) == (0, "")
        assert objects(done.stdout) == [told] * 3
        done = call("send", schema, path, "clear", "--node", "3", "number=5", "--count", "3", *CALM)
        assert done.returncode == 2
        assert "--count requires --every or endless answers; clear.request has none: omit it" in done.stderr


def test_an_answer_of_each_node() -> None:
    schema = str(SCHEMAS / "answers.yaml")
    with simulated(schema, "--nodes", "3,5") as (path, _):
        asked = ("send", schema, path, "gather", "--node", "0", "nodes=5,4,3")
        done = call(*asked, "--slack", "0.4", "--attempts", "1", "--echo", "none")
        told = [{"message": "gather.response", "node": node, "fields": {"value": 0}} for node in (5, 3)]
        assert objects(done.stdout) == told
        assert "no answer of node 4" in done.stderr


def test_again_and_again(qlinkgen: Run, on_line: OnLine) -> None:
    """Times are those of the line's own clock; of three requests, one is not answered."""
    heard = 0

    class Forgetful(VirtualNode):
        def handle(self, request: Any, now: float) -> Any:
            nonlocal heard
            heard += 1
            return None if heard == 2 else super().handle(request, now)

    wire = Wire(baud=115200)
    wire.attach(SlaveEngine(qlink, Forgetful(3)))
    asked = ("qlink", on_line(wire), "motor_position", "--node", "3", "--every", "0.5")
    result = qlinkgen("send", *asked, "--count", "3", "--attempts", "1", "--echo", "none")
    found = objects(result.out)
    assert result.code == 0
    assert [each.pop("at") for each in found] == pytest.approx([0.001, 0.501, 1.001], abs=0.01)
    answer = {"message": "motor_position.response", "node": 3, "fields": {"position": 0}}
    assert [found[0], found[2]] == [answer, answer]
    assert found[1]["error"]["kind"] == "no_reply"  # type: ignore[index]
    assert "qlinkgen: 3 requests, 2 answered, 1 not; 0 turns left out; response time " in result.err
    heard = -100
    started = qlinkgen("send", "qlink", asked[1], "node_start", "--node", "3", *asked[-2:], "--count", "2")
    assert [each["sent"] for each in objects(started.out)] == ["node_start", "node_start"]


def test_no_response_time_without_a_response() -> None:
    assert "response time" in summary(PollStatistics(answered=1))
    assert summary(PollStatistics(failed=2)).startswith(
        "2 requests, 0 answered, 2 not; 0 turns left out; jitter"
    )


def test_a_signal_ends_the_repetition() -> None:
    with simulated("qlink", "--nodes", "3") as (path, _):
        asked = ("send", "qlink", path, "motor_position", "--node", "3", "--every", "1000", *CALM)
        with started(*asked) as process:
            read_until(process.stdout, "position")
            code, _, err = end(process, signal.SIGTERM)
    assert code == 0
    assert "1 request, 1 answered" in err


def test_a_trace(qlinkgen: Run, on_line: OnLine) -> None:
    node = VirtualNode(3)
    port = on_line(line(node, baud=115200))
    result = qlinkgen("send", "qlink", port, "motor_position", "--node", "3", "--trace")
    assert result.code == 0
    lines = [line.split(maxsplit=1)[1] for line in result.err.splitlines()]
    assert lines[0].split() == ["sent", "00", "00"]
    assert lines[1] == "sent      a5 a5 04 21 03 15 e8 [motor_position.request node 3]"
    assert lines[2] == (
        "received  a5 a5 08 21 03 00 00 00 00 fc 19 [motor_position.response node 3 position=0]"
    )
    times = [float(line.split()[0]) for line in result.err.splitlines()]
    assert times == sorted(times)
    assert times[2] - times[1] == pytest.approx(18 * 10 / 115200, abs=0.001)


def test_a_trace_of_what_is_no_answer(qlinkgen: Run, on_line: OnLine) -> None:
    wire = Wire(baud=115200)
    wire.attach(Reciter(bytes.fromhex("a5a5082103000000000000")))
    asked = ("motor_position", "--node", "3", "--trace", "--attempts", "1", "--echo", "none")
    result = qlinkgen("send", "qlink", on_line(wire), *asked)
    assert result.code == 1
    assert "received  a5 a5 08 21 03 00 00 00 00 00 00 [damaged (crc): " in result.err


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("motor_position", "--node", "3", "--every", "0"), "--every 0: a period is above 0 s"),
        (("motor_position", "--node", "3", "--count", "2"), "--count requires --every or endless answers"),
        (("motor_position", "--node", "3", "--every", "x"), "--every x: not a number of seconds"),
    ],
)
def test_wrong_repetition(qlinkgen: Run, words: tuple[str, ...], text: str) -> None:
    result = qlinkgen("send", "qlink", "/dev/not-there", *words)
    assert (result.code, result.out) == (2, "")
    assert text in result.err
