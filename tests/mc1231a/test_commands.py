"""All rows of the command table: each can be called, does something at the chip set, and is warned of."""

from __future__ import annotations

import asyncio
import csv
import re
import warnings
from pathlib import Path
from typing import Any

import pytest

from qlinkgen.codecs import mc1231a
from qlinkgen.protocols.mc1231a import AsyncHost, ChipSet, Host, UnconfirmedCommand
from qlinkgen.protocols.mc1231a.axis_commands import AXIS_COMMANDS
from qlinkgen.protocols.mc1231a.registers import BUFFERED, IMMEDIATE, READABLE
from qlinkgen.sim import VirtualPort
from qlinkgen.sim.chip_bus import chip_wire
from tests.mc1231a.line import sample
from tests.mc1231a.rig import virtual

TABLE = Path(__file__).parents[1] / "schema" / "mc1231a.csv"
with TABLE.open(encoding="utf-8", newline="") as file:
    ROWS = {row["name"]: row for row in csv.DictReader(file)}
WEAK = [name for name, row in ROWS.items() if row["confirmed"] == "no"]


def arguments(name: str) -> dict[str, Any]:
    request = sample(mc1231a.COMMANDS[name])
    return {field: getattr(request, field) for field in request.FIELDS}


def place(name: str) -> tuple[int, ...]:
    """The argument for the axis, where a command takes one."""
    return (2,) if mc1231a.COMMANDS[name].attributes["axis"] in {"current", "unknown"} else ()


def test_there_are_101() -> None:
    assert len(ROWS) == 101
    assert set(ROWS) == set(mc1231a.COMMANDS)


@pytest.mark.parametrize("name", ROWS)
def test_every_row_can_be_called_on_the_host_and_on_its_axis(name: str) -> None:
    row = ROWS[name]
    with virtual() as rig:
        response = getattr(rig.host, name)(*place(name), **arguments(name))
        packet = bytes.fromhex(rig.packets[-1])
        assert packet[0] == int(row["code"], 16)
        assert len(packet) == 1 + 2 * int(row["words"]) * (row["direction"] == "write")
        assert 2 * int(row["words"]) * (row["direction"] == "read") == type(response).MAX_SIZE
        assert rig.packets[:-1] == (["02"] if place(name) else [])
        axis = rig.host.axis(2)
        assert hasattr(axis, name) == bool(place(name))
        if place(name):
            getattr(axis, name)(**arguments(name))
            assert bytes.fromhex(rig.packets[-1]) == packet


def test_every_command_does_something_at_the_chip_set() -> None:
    chip = ChipSet()
    for name in mc1231a.COMMANDS:
        assert name in AXIS_COMMANDS or hasattr(chip, f"_do_{name}"), name
    assert set(AXIS_COMMANDS) <= set(mc1231a.COMMANDS)


@pytest.mark.parametrize("register", READABLE)
def test_what_is_written_is_read_back(register: str) -> None:
    (field,) = mc1231a.COMMANDS[f"set_{register}"].request.FIELDS
    with virtual() as rig:
        value = arguments(f"set_{register}")
        getattr(rig.host, f"set_{register}")(2, **value)
        assert getattr(getattr(rig.host, f"get_{register}")(2), field) == value[field]
        assert getattr(getattr(rig.host, f"get_{register}")(1), field) == ChipSet().axes[1].values[register]


def test_the_page_says_what_is_known() -> None:
    page = (Path(__file__).parents[2] / "docs/mc1231a.md").read_text("utf-8")
    assert f"the {len(ROWS)} commands whose codes are known" in page
    assert f"For {len(WEAK)} rows no source confirms" in page
    unknown = page.partition("**Missing commands.**")[2].partition("\n- ")[0]
    names = re.findall(r"[A-Z_0-9]{8,}", unknown)
    assert len(names) == 8
    assert not {name.lower() for name in names} & set(mc1231a.COMMANDS)


def test_the_phase_info_is_flags() -> None:
    flags = mc1231a.PhaseInfo
    named = (flags.HALL, flags.MICROSTEPPING, flags.TWO_PHASE, flags.PRESCALER, flags.NOT_INITIALISED)
    assert [int(each) for each in named] == [1 << bit for bit in (0, 2, 3, 7, 8)]
    response = mc1231a.GetPhaseInfoResponse(value=flags.TWO_PHASE | 1 << 12)
    assert int(response.value) == 0x1008  # bits without a name are kept


def test_registers_are_those_of_the_table() -> None:
    buffered = [
        name[4:] for name, row in ROWS.items() if row["double_buffered"] == "yes" and name[:4] == "set_"
    ]
    assert sorted(BUFFERED) == sorted(buffered)
    assert not set(BUFFERED) & set(IMMEDIATE)
    assert set(READABLE) == {name for name in (*BUFFERED, *IMMEDIATE) if f"get_{name}" in ROWS}


# Warnings


@pytest.mark.parametrize("name", ROWS)
def test_the_first_use_of_a_weak_command_is_warned_of(name: str) -> None:
    with virtual() as rig, warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        for _ in range(3):
            getattr(rig.host, name)(*place(name), **arguments(name))
            if place(name):
                getattr(rig.host.axis(1), name)(**arguments(name))
    assert len(seen) == (name in WEAK)
    for warning in seen:
        assert warning.category is UnconfirmedCommand
        assert str(warning.message).startswith(f"{name} (code {ROWS[name]['code']})")
        assert warning.filename == __file__


def test_each_host_warns_for_itself_and_axes_too() -> None:
    for _ in range(2):
        with virtual() as rig, pytest.warns(UnconfirmedCommand, match="set_kvff") as seen:
            rig.host.axis(1).set_kvff(value=1)
        assert seen[0].filename == __file__


def test_warnings_of_asyncio_show_the_caller() -> None:
    async def use() -> None:
        host = AsyncHost(VirtualPort(chip_wire(ChipSet())))
        await host.set_kvff(1, value=1)
        await host.axis(1).get_pos_err()

    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        asyncio.run(use())
    assert [str(each.message).split()[0] for each in seen] == ["set_kvff", "get_pos_err"]
    assert {each.filename for each in seen} == {__file__}


def test_a_warning_made_an_error_sends_nothing() -> None:
    with virtual() as rig, warnings.catch_warnings():
        warnings.simplefilter("error", UnconfirmedCommand)
        with pytest.raises(UnconfirmedCommand):
            rig.host.axis(1).set_kvff(value=1)
        assert rig.port.sent == []


def test_both_faces_have_the_same_methods() -> None:
    def public(kind: type[Any]) -> set[str]:
        return {name for name in dir(kind) if not name.startswith("_")}

    # A forked child has no use for the tasks of its parent.
    assert public(Host) - {"after_fork"} == public(AsyncHost)
