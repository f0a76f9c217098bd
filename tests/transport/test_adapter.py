"""Reading the hardware of a terminal from sysfs."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from qlinkgen.transport import Ability, PtyPort, adapter, open_port
from tests.transport.conftest import Disguise


@pytest.fixture
def terminal(pty: PtyPort) -> Iterator[int]:
    descriptor = os.open(pty.path, os.O_RDWR | os.O_NOCTTY)
    yield descriptor
    os.close(descriptor)


@pytest.fixture
def cpuinfo(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The description of the processor, if any."""
    monkeypatch.setattr(adapter, "CPUINFO", tmp_path / "cpuinfo")
    return tmp_path / "cpuinfo"


@pytest.fixture
def dressed(pty: PtyPort, disguise: Disguise) -> Callable[[str], PtyPort]:
    """A pty that looks like a device of a driver."""

    def dress(driver: str) -> PtyPort:
        disguise(pty.path, driver, uart=driver == "serial8250")
        return pty

    return dress


def test_latency_timer(terminal: int, pty: PtyPort, disguise: Disguise) -> None:
    device = disguise(pty.path, "ftdi_sio", "16\n")
    assert adapter.look_up(terminal).latency == 0.016
    (device / "latency_timer").write_text("1\n")
    found = adapter.look_up(terminal)
    assert found == adapter.Adapter(
        "ftdi_sio",
        0.001,
        "latency_timer of ftdi_sio (/sys/class/tty/ttyUSB7/device/latency_timer)",
        Ability.YES,
    )


def test_a_link_leads_to_the_same_entry(pty: PtyPort, disguise: Disguise, tmp_path: Path) -> None:
    disguise(pty.path, "ftdi_sio", "2\n")
    link = tmp_path / "usb-FTDI_FT232R_A50285BI-if00-port0"
    link.symlink_to(pty.path)
    descriptor = os.open(link, os.O_RDWR | os.O_NOCTTY)
    try:
        assert adapter.look_up(descriptor).latency == 0.002
    finally:
        os.close(descriptor)


@pytest.mark.parametrize("content", ["", "soon\n", "\xff"])
def test_a_timer_that_cannot_be_read(terminal: int, pty: PtyPort, disguise: Disguise, content: str) -> None:
    disguise(pty.path, "ftdi_sio", content)
    found = adapter.look_up(terminal)
    assert found.latency is None
    assert found.source == "the driver ftdi_sio does not report it"


def test_no_driver(terminal: int, pty: PtyPort, disguise: Disguise) -> None:
    disguise(pty.path)
    assert adapter.look_up(terminal) == adapter.Adapter("", None, "the driver is unknown")


@pytest.mark.parametrize(
    ("driver", "cpu", "paced"),
    [
        ("cp210x", "hypervisor", Ability.YES),
        ("cdc_acm", "", Ability.UNKNOWN),
        ("serial8250", "flags : fpu vme", Ability.YES),
        ("serial8250", "flags : fpu hypervisor", Ability.UNKNOWN),
        ("serial8250", None, Ability.UNKNOWN),
    ],
)
def test_paced_where_that_is_sure(
    driver: str, cpu: str | None, paced: Ability, dressed: Callable[[str], PtyPort], cpuinfo: Path
) -> None:
    pty = dressed(driver)
    if cpu is not None:
        cpuinfo.write_text(cpu)
    with open_port(pty.path) as port:
        assert port.capabilities.paced is paced


def test_pty_and_what_is_not_known(terminal: int) -> None:
    assert adapter.look_up(terminal) == adapter.Adapter(
        "pty", 0.0, "a pty delivers bytes immediately", Ability.NO
    )
    nothing = os.open(os.devnull, os.O_RDWR)
    try:
        assert adapter.look_up(nothing).latency is None
    finally:
        os.close(nothing)
