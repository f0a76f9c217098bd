"""The master end of a pty, with programs that open and close the other end."""

from __future__ import annotations

import os
import subprocess
import sys
import termios
from pathlib import Path

import pytest

from qlinkgen.errors import PortBusy, PortError, PortLost
from qlinkgen.transport import Ability, PtyPort, SerialPort, open_pty
from tests.transport.conftest import PATIENCE, descriptors


def test_raw_both_ways(pty: PtyPort) -> None:
    every = bytes(range(256))
    with SerialPort(pty.path) as client:
        client.write(every)
        assert pty.read(PATIENCE) == every
        pty.write(every)
        assert client.read(PATIENCE) == every
        assert pty.read(0) == b""  # no echo


def test_raw_for_a_program_that_sets_nothing(pty: PtyPort) -> None:
    code = "import os, sys; os.write(os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY), b'\\x03\\r\\n\\xa5')"
    subprocess.run([sys.executable, "-c", code, pty.path], check=True, timeout=PATIENCE)
    assert pty.read(PATIENCE) == b"\x03\r\n\xa5"
    assert pty.read(0) == b""


def test_usable_without_a_client_and_across_clients(pty: PtyPort) -> None:
    assert pty.read(0) == b""
    for number in range(3):
        pty.write(b"no reader")
        with SerialPort(pty.path) as client:
            assert client.read(0) == b""  # bytes from before the open are discarded
            client.write(bytes([number]))
            assert pty.read(PATIENCE) == bytes([number])
        assert pty.read(0) == b""


def test_a_line_does_not_wait_for_listeners(pty: PtyPort) -> None:
    pty.write(bytes(30_000))
    assert pty.dropped > 0
    pty.write(b"last")
    descriptor = os.open(pty.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        rest = b""
        while not rest.endswith(b"last"):
            rest += os.read(descriptor, 4096)
    finally:
        os.close(descriptor)
    assert len(rest) + pty.dropped == 30_004


def test_full_and_switched_to_lines(pty: PtyPort) -> None:
    # The kernel discards bytes beyond the length of a line; no call hangs.
    descriptor = os.open(pty.path, os.O_RDWR | os.O_NOCTTY)
    try:
        state = termios.tcgetattr(descriptor)
        state[3] |= termios.ICANON
        termios.tcsetattr(descriptor, termios.TCSANOW, state)
        pty.write(bytes([65]) * 100_000)
        pty.write(b"\n")
        assert os.read(descriptor, 8000).endswith(b"A\n")
    finally:
        os.close(descriptor)


def test_close(pty: PtyPort) -> None:
    before = descriptors()
    assert pty.fileno() is not None
    pty.close()
    assert descriptors() == before - 4  # two ends of the pty, and of the pipe that wakes
    with open_pty() as other:  # takes over the numbers of the descriptors
        pty.close()
        assert descriptors() == before
        assert other.read(0) == b""
    assert pty.fileno() is None
    for use in (lambda: pty.read(0), lambda: pty.write(b"x")):
        with pytest.raises(PortLost, match="was closed here"):
            use()


def test_capabilities(pty: PtyPort) -> None:
    assert pty.name == pty.path
    assert pty.capabilities.paced is Ability.NO
    assert pty.capabilities.latency == 0.0


def test_link(tmp_path: Path) -> None:
    link = tmp_path / "bus"
    with open_pty(link, baud=19200) as port:
        assert port.name == str(link)
        assert port.baud == 19200
        assert link.readlink() == Path(port.path)
        with SerialPort(str(link)) as client:
            client.write(b"hi")
            assert port.read(PATIENCE) == b"hi"
    assert not os.path.lexists(link)
    assert list(tmp_path.iterdir()) == []


def test_relative_link_is_removed_from_where_it_was_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    port = open_pty("bus")
    monkeypatch.chdir("/")
    port.close()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("stale", ["/dev/pts/999999", "nowhere"])
def test_a_stale_link_is_replaced(tmp_path: Path, stale: str) -> None:
    link = tmp_path / "bus"
    link.symlink_to(stale)
    with open_pty(link) as port:
        assert link.readlink() == Path(port.path)
    assert not os.path.lexists(link)


def test_a_link_that_leads_elsewhere_by_now_is_not_removed(tmp_path: Path) -> None:
    link = tmp_path / "bus"
    first = open_pty(link)
    link.unlink()
    with open_pty(link) as second:
        first.close()
        assert link.readlink() == Path(second.path)


def test_the_same_link_by_other_ways_to_write_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "alias").symlink_to("folder")
    monkeypatch.chdir(tmp_path / "folder")
    with open_pty("bus"):
        for path in (tmp_path / "folder" / "bus", tmp_path / "alias" / "bus", Path("../folder/bus")):
            with pytest.raises(PortBusy):
                open_pty(path)


@pytest.mark.parametrize("clients", [0, 1])
def test_the_link_of_a_running_program_is_left_alone(tmp_path: Path, clients: int) -> None:
    """Here and from another process, also after a client has opened and closed the port."""
    link = tmp_path / "bus"
    code = (
        "import sys; from qlinkgen.errors import PortBusy; from qlinkgen.transport import open_pty\n"
        "try:\n    open_pty(sys.argv[1])\nexcept PortBusy as error:\n    print(error)"
    )
    with open_pty(link) as first:
        for _ in range(clients):
            SerialPort(str(link)).close()
        before = descriptors()
        with pytest.raises(
            PortBusy, match=f"{link} is a link to {first.path} and belongs to a running program"
        ):
            open_pty(link)
        assert descriptors() == before
        other = subprocess.run(
            [sys.executable, "-c", code, str(link)],
            check=True,
            capture_output=True,
            text=True,
            timeout=PATIENCE,
        )
        assert "belongs to a running program; stop that program" in other.stdout
        assert link.readlink() == Path(first.path)
        with SerialPort(str(link)) as client:
            client.write(b"hi")
            assert first.read(PATIENCE) == b"hi"


def test_the_link_of_a_killed_program_is_replaced(tmp_path: Path) -> None:
    """Also if a terminal, or the pty of another link, has reused the number of its pty."""
    link = tmp_path / "bus"
    with open_pty(tmp_path / "other") as other:
        link.symlink_to(other.path)
        with open_pty(link) as port:
            assert link.readlink() == Path(port.path)
    master, slave = os.openpty()
    try:
        link.symlink_to(os.ttyname(slave))
        with open_pty(link) as port:
            assert link.readlink() == Path(port.path)
    finally:
        os.close(master)
        os.close(slave)
    code = "import os, sys; from qlinkgen.transport import open_pty\n"
    code += "port = open_pty(sys.argv[1]); os.kill(os.getpid(), 9)"
    subprocess.run([sys.executable, "-c", code, str(link)], check=False, timeout=PATIENCE)
    assert link.is_symlink()
    with open_pty(link) as port:
        assert link.readlink() == Path(port.path)


@pytest.mark.parametrize("kind", ["file", "folder", "link"])
def test_what_is_no_link_to_a_pty_is_left_alone(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "bus"
    if kind == "file":
        path.write_text("precious")
    elif kind == "folder":
        path.mkdir()
    else:
        (tmp_path / "other").write_text("precious")
        path.symlink_to(tmp_path / "other")
    before = descriptors()
    with pytest.raises(PortError, match="not replaced; remove it, or choose another path"):
        open_pty(path)
    assert path.is_dir() if kind == "folder" else path.read_text() == "precious"
    assert descriptors() == before


def test_a_link_that_cannot_be_made(tmp_path: Path) -> None:
    with pytest.raises(PortError, match=r"cannot make the link .*No such file.*folder must exist"):
        open_pty(tmp_path / "nowhere" / "bus")


def test_no_pty_left(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse() -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "openpty", refuse)
    with pytest.raises(PortError, match="cannot open a pty: No space left on device"):
        open_pty()
