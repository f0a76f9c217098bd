"""The ring on the command line: `simulate`, `ring`, `send` and `monitor` of trio."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import time
from collections.abc import Iterator
from decimal import Decimal
from pathlib import Path

import pytest

from qlinkgen.codecs import trio
from qlinkgen.protocols.trio import CoordinatorNode, KeypadNode, MotionCoordinator
from qlinkgen.sim.port_ring import RingBus, ring_bus
from qlinkgen.transport import open_port, open_pty
from qlinkgen.transport.port import Port
from tests.cli.conftest import Run
from tests.cli.wire import end, objects, read_until, records, simulated, started

HELLO = trio.CharacterTransfer(address=3, characters="HELLO YOU\r\n")


@contextlib.contextmanager
def ring(*nodes: CoordinatorNode | KeypadNode) -> Iterator[RingBus]:
    with ring_bus(nodes or (CoordinatorNode(), CoordinatorNode())) as running:
        yield running


def test_as_processes(tmp_path: Path) -> None:
    link = tmp_path / "ring"
    options = ("--ring", "coordinator,keypad,coordinator", "--link", link)
    with simulated("trio", *options) as (path, process):
        assert os.readlink(link) == path  # noqa: PTH115
        with MotionCoordinator(open_port(str(link))) as mc:
            mc.send(10, 1, 7, -0.25)
            mc.send(11, 2, 11)
            mc.print_(11, "HELLO", end="")
            mc.send(13, 1, 0, 42)  # once around the ring
            mc.wait_until(lambda: mc.vr[0] == 42, 60)
        code, out, err = end(process, signal.SIGTERM)
    assert (code, out) == (0, "")
    assert not os.path.lexists(link)
    assert "3 nodes of trio on" in err
    assert "address 1, coordinator: 1 taken, 3 forwarded, NETSTAT 0; VR(7) = -0.25\n" in err
    assert "address 2, keypad: 2 taken, 1 forwarded, NETSTAT 0; offset 2; display 'HELLO'\n" in err
    assert "address 3, coordinator: 0 taken, 1 forwarded, NETSTAT 0\n" in err
    assert err.endswith("qlinkgen: total: 3 messages taken, 0 damaged\n")


def send(qlinkgen: Run, path: str, *words: str) -> tuple[list[dict[str, object]], str]:
    result = qlinkgen("send", "trio", path, *words)
    assert result.code == 0, result.err
    return objects(result.out), result.err


#: The command ends when its own message returns.
ROUND = ("--count", "1", "--seconds", "60")


def test_send_reaches_the_node(qlinkgen: Run) -> None:
    keypad, coordinator = KeypadNode(), CoordinatorNode()
    with ring(keypad, coordinator) as running:
        assert send(
            qlinkgen, running.path, "keypad_offset", "--address", "1", "offset=2", "--seconds", "0"
        ) == (
            [],
            "qlinkgen: sent; 0 messages for this node, 0 forwarded; NETSTAT 0\n",
        )
        words = ("direct_variable_transfer", "--address", "2", "number=7", "value=-0.25", "--seconds", "0")
        send(qlinkgen, running.path, *words)
        # It follows the others on the ring: when it returns, they have arrived.
        found, err = send(
            qlinkgen, running.path, "character_transfer", "--address", "3", "characters=X Y", *ROUND
        )
    assert found == [{"message": "character_transfer", "address": 1, "fields": {"characters": "X Y"}}]
    assert err == (
        "qlinkgen: sent, and returned: 3 nodes on this ring; 1 message for this node, "
        "0 forwarded; NETSTAT 0\n"
    )
    assert keypad.offset == 2
    assert coordinator.vr[7] == -0.25


def test_send_is_a_node_that_sends_on(qlinkgen: Run) -> None:
    first = CoordinatorNode()
    with ring(first, CoordinatorNode()) as running:
        words = ("character_transfer", "--address", "6", "characters=TWICE")
        found, err = send(qlinkgen, running.path, *words, *ROUND)
    assert records(found, "address") == [(1,)]
    assert "3 nodes on this ring; 1 message for this node, 1 forwarded" in err
    assert first.link.counters.passed == 2


def test_send_as_a_process_among_others() -> None:
    own = trio.KeypadMode(address=2, mode=trio.KeypadModeEnum.ON_OFF).to_frame()
    bad = HELLO.to_frame()[:-1] + bytes((0x90,))
    mine = trio.CharacterTransfer(address=1, characters="5").to_frame()
    with open_pty() as port:
        words = ("keypad_mode", "mode=on_off", "--address", "2", *ROUND)
        with started("send", "trio", port.path, *words) as node:
            assert received(port, len(own)) == own
            port.write(HELLO.to_frame())
            assert received(port, len(HELLO.to_frame()))[1:-1] == HELLO.to_frame()[1:-1]
            port.write(bad + mine)
            out, err = node.communicate(timeout=60)
    assert node.returncode == 0
    assert records(objects(out.decode()), "address", "fields") == [(1, {"characters": "5"})]
    assert (
        "qlinkgen: warning: damaged (frame): the end byte has another address than the header" in err.decode()
    )
    assert err.decode().endswith("1 message for this node, 1 forwarded; NETSTAT 8 (rx_frame)\n")


def received(port: Port, size: int) -> bytes:
    data, end = b"", time.monotonic() + 60
    while len(data) < size and time.monotonic() < end:
        data += port.read(0.1)
    return data


def test_ring_sends_on_and_prints() -> None:
    unknown = bytes((0x80 | 2 << 3 | 7, 1, 0x80 | 2 << 3))
    mine = trio.DirectVariableTransfer(address=1, number=3, value=Decimal(2))
    bad = bytearray(trio.DirectVariableTransfer(address=1, number=3, value=Decimal(2)).to_frame())
    bad[2] ^= 1
    with open_pty() as port:
        with started("ring", "trio", port.path, "--count", "5") as node:
            read_until(node.stderr, "joined the ring")
            port.write(b"\x05" + HELLO.to_frame() + unknown + mine.to_frame() + bytes(bad))
            out, err = node.communicate(timeout=60)
        assert node.returncode == 0
        # The broken message to this node is not forwarded, nor is the byte between messages.
        sent = received(port, len(HELLO.to_frame()) + len(unknown))
    told = [re.sub(" +", " ", line[14:]) for line in out.decode().splitlines()]
    assert told[:2] == [
        "? damaged (frame) payload bytes outside a message: 05",
        'address 3 character_transfer characters="HELLO YOU\\r\\n"',
    ]
    assert told[2].startswith("? damaged (frame) unknown message number 7")
    assert told[2].endswith("97 01 90 [forwarded]")
    assert told[3] == "address 1, here direct_variable_transfer number=3 value=2"
    assert told[4].startswith("? damaged (crc) ")
    assert sent == bytes((0x91,)) + HELLO.to_frame()[1:-1] + bytes((0x90,)) + b"\x8f\x01\x88"
    assert err.decode().endswith(
        "qlinkgen: 5 messages, 3 of them damaged; 2 forwarded, 1 for this node, 2 broken on arrival; "
        "NETSTAT 12 (rx_crc, rx_frame)\n"
    )


def test_ring_as_json() -> None:
    with open_pty() as port, started("ring", "trio", port.path, "--json", "--raw") as node:
        read_until(node.stderr, "joined the ring")
        port.write(HELLO.to_frame() + b"\x88")
        out = read_until(node.stdout, "error")
        code, rest, _ = end(node, signal.SIGINT)
    assert (code, rest) == (0, "")
    first, second = objects(out)
    assert list(first) == ["at", "message", "address", "fields", "sent_on", "raw"]
    assert records([first], "message", "address", "sent_on", "raw") == [
        ("character_transfer", 3, True, HELLO.to_frame().hex())
    ]
    assert second["error"] == {
        "kind": "frame",
        "offset": None,
        "raw": "88",
        "message": "an end byte outside a message",
    }
    assert second["sent_on"] is False


def test_ring_ends_by_itself(qlinkgen: Run) -> None:
    with open_pty() as port:
        result = qlinkgen("ring", "trio", port.path, "--seconds", "0.05")
    assert (result.code, result.out) == (0, "")
    first, last = result.err.splitlines()
    assert first == f"qlinkgen: joined the ring on {port.path}; press Ctrl-C to stop"
    assert last == (
        "qlinkgen: 0 messages, 0 of them damaged; 0 forwarded, 0 for this node, 0 broken on arrival; "
        "NETSTAT 0"
    )


def test_a_port_that_goes_away() -> None:
    with open_pty() as port, started("ring", "trio", port.path) as node:
        read_until(node.stderr, "joined the ring")
        port.close()
        out, err = node.communicate(timeout=60)
    assert (node.returncode, out) == (1, b"")
    assert f"{port.path} was lost" in err.decode()
    assert "Traceback" not in err.decode()


@pytest.mark.parametrize(
    ("arguments", "code", "text"),
    [
        (("trio", "/dev/not-there"), 1, "port '/dev/not-there' does not exist"),
        (("qlink", "x"), 2, "qlink is not a ring; use `qlinkgen monitor qlink x`"),
        (("trio", "x", "--count", "0"), 2, "--count"),
        (("trio", "x", "--seconds", "soon"), 2, "--seconds soon: not a number of seconds"),
    ],
)
def test_errors(qlinkgen: Run, arguments: tuple[str, ...], code: int, text: str) -> None:
    result = qlinkgen("ring", *arguments)
    assert (result.code, result.out) == (code, "")
    assert text in result.err


def test_monitor_listens_on_a_fibre() -> None:
    bad = HELLO.to_frame()[:-1] + bytes((0x90,))
    with open_pty() as port, started("monitor", "trio", port.path) as monitor:
        read_until(monitor.stderr, "listening to trio")
        port.write(HELLO.to_frame() + bad)
        out = read_until(monitor.stdout, "damaged")
        code, rest, err = end(monitor, signal.SIGTERM)
        assert port.read(0) == b"", "it sends nothing on"
    assert (code, rest) == (0, "")
    first, second = [re.sub(" +", " ", line[14:]) for line in out.splitlines()]
    assert first == 'address 3 character_transfer characters="HELLO YOU\\r\\n"'
    assert second.startswith("? damaged (frame) ")
    assert err.startswith("qlinkgen: 2 messages, 1 of them damaged; ")
