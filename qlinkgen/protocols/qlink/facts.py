"""Constants of the protocol for the procedures, all read from the generated module."""

from __future__ import annotations

from qlinkgen.codecs import qlink
from qlinkgen.codecs._support import ArrayRule, BytesRule


def _bus(name: str) -> int:
    number = getattr(qlink.BUS, name)
    if not isinstance(number, int):
        raise TypeError(f"the schema of Q.link does not state {name}")
    return number


def _most(message: type[qlink.Message], field: str) -> int:
    """Return the largest number of items of a field."""
    rules = (rule for rule in message.RULES if isinstance(rule, ArrayRule | BytesRule))
    return next(rule.most for rule in rules if rule.name == field)


BAUD = _bus("baud")
BROADCAST = _bus("broadcast")
NODES = range(_bus("first_node"), _bus("last_node") + 1)
#: Words that one motion can carry.
WORDS = _most(qlink.MotionRequest, "segments")
#: Bytes of a program's text that one request can carry.
PIECE = _most(qlink.NodeProgramLoadRequest, "program_data")
