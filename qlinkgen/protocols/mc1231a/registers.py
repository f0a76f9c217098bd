"""Registers of an axis, found in the schema: what is written by set_x is read by get_x."""

from __future__ import annotations

from typing import Final

from qlinkgen.codecs import mc1231a

#: Registers with a life of their own, which are not just kept.
_LIVE: Final = {"actl_pos", "mtr_cmd"}
_NAMES: Final = {
    name.removeprefix("set_"): command
    for name, command in mc1231a.COMMANDS.items()
    if name.startswith("set_") and len(command.request.FIELDS) == 1
}

#: Values that wait for an update, and are read back as they wait: acc, buf_mtr_cmd, i_lm, ...
BUFFERED: Final = tuple(n for n, c in _NAMES.items() if c.attributes["double_buffered"] is True)
#: Values of an axis that act at once. Whether those of the commutation do was not found; here they do.
IMMEDIATE: Final = tuple(
    name
    for name, command in _NAMES.items()
    if name not in BUFFERED and name not in _LIVE and command.attributes["axis"] == "current"
)
#: Registers that can be read back.
READABLE: Final = tuple(n for n in (*BUFFERED, *IMMEDIATE) if f"get_{n}" in mc1231a.COMMANDS)
#: Values after reset that are not 0; no source has them.
AFTER_RESET: Final[dict[str, float]] = {"pos_err": 32767, "mtr_lmt": 32767, "phase_cnts": 129}


def after_reset() -> dict[str, float]:
    """Return every register as it is after a reset."""
    return {name: AFTER_RESET.get(name, 0) for name in (*BUFFERED, *IMMEDIATE)}
