"""Where behaviours of buses are tried: every protocol of the library, every client, every transport."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from tests.bus.cases import Case
from tests.bus.rig import Rig, Setting, make_rig

#: Protocols of the library with transactions.
NAMES = (
    "cobs", "dnp3", "dynamixel_1", "dynamixel_2", "mbus", "mc1231a", "modbus_ascii", "modbus_rtu", "msp",
    "pelco_d", "qlink", "shdlc", "slip", "stm32", "tmcl", "ubx", "vesc", "visca", "xbee",
)  # fmt: skip
#: Those that are tried over a pty, too: all if the environment says so.
ON_PTYS = NAMES if os.environ.get("QLINKGEN_PTYS") == "all" else ("dynamixel_2", "tmcl")
VIRTUAL = [Setting("blocking", "virtual"), Setting("asyncio", "virtual")]
MEMORY = [Setting("blocking", "memory"), Setting("asyncio", "memory")]
PTY = [Setting("blocking", "pty"), Setting("asyncio", "pty")]
#: The master in C, on a virtual clock; for protocols of which it has every command.
IN_C = Setting("c", "virtual")
NAMES_IN_C = (
    "cobs", "modbus_ascii", "modbus_rtu", "msp", "pelco_d", "qlink", "shdlc", "slip", "ubx", "vesc", "xbee",
)  # fmt: skip


def _pairs(*settings: Setting) -> list[Any]:
    return [
        pytest.param(name, setting, id=f"{name}-{setting}")
        for name in NAMES
        for setting in settings
        if setting.transport != "pty" or name in ON_PTYS
        if setting is not IN_C or name in NAMES_IN_C
    ]


everywhere = pytest.mark.parametrize(("name", "setting"), _pairs(*VIRTUAL, IN_C, *MEMORY, *PTY))
#: Where time is exact.
timed = pytest.mark.parametrize(("name", "setting"), _pairs(*VIRTUAL, IN_C))
#: Where other tasks run meanwhile.
tasks = pytest.mark.parametrize(("name", "setting"), _pairs(VIRTUAL[1], MEMORY[1], PTY[1]))


@contextmanager
def rig_for(case: Case, setting: Setting, **options: Any) -> Iterator[Rig]:
    """A rig to try one command on, which a failure names."""
    try:
        with make_rig(setting, case.protocol, **options) as rig:
            rig.select(case)
            yield rig
    except BaseException as error:
        error.add_note(str(case))
        raise
