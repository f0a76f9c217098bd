"""Registers of an axis, derived from the schema: written by set_x, read by get_x."""

from __future__ import annotations

from typing import Final

from qlinkgen.codecs import mc1231a

#: Registers with their own behaviour, which are not just stored.
_LIVE: Final = {"actl_pos", "mtr_cmd"}
_NAMES: Final = {
    name.removeprefix("set_"): command
    for name, command in mc1231a.COMMANDS.items()
    if name.startswith("set_") and len(command.request.FIELDS) == 1
}

#: Buffered registers, which are read back before the update: acc, buf_mtr_cmd, i_lm, ...
BUFFERED: Final = tuple(n for n, c in _NAMES.items() if c.attributes["double_buffered"] is True)
#: Registers that act immediately; for those of the commutation this is an assumption.
IMMEDIATE: Final = tuple(
    name
    for name, command in _NAMES.items()
    if name not in BUFFERED and name not in _LIVE and command.attributes["axis"] == "current"
)
#: Registers that can be read back.
READABLE: Final = tuple(n for n in (*BUFFERED, *IMMEDIATE) if f"get_{n}" in mc1231a.COMMANDS)
#: Values after reset other than 0, which are assumptions.
AFTER_RESET: Final[dict[str, float]] = {"pos_err": 32767, "mtr_lmt": 32767, "phase_cnts": 129}


def after_reset() -> dict[str, float]:
    """Return every register with its value after a reset."""
    return {name: AFTER_RESET.get(name, 0) for name in (*BUFFERED, *IMMEDIATE)}
