"""Errors of numbers that follow from other bytes: check values in a payload, and numbers derived from others.

Copied next to modules that use it, unchanged.
"""

from __future__ import annotations

from ._support import DecodeError

TYPE_CHECKING = False  # as typing.TYPE_CHECKING; importing `typing` costs 5 ms
if TYPE_CHECKING:
    from ._support import BaseMessage


def differing(
    message: type[BaseMessage],
    kind: str,
    name: str,
    seen: int,
    right: int,
    *,
    offset: int,
    payload: bytes,
) -> DecodeError:
    """The error for a wrong number of a field; a negative offset counts from the end."""
    text = f"{message.NAME}: {name}: received {seen:#x}, expected {right:#x}"
    return DecodeError(
        text, kind, name, offset if offset >= 0 else len(payload) + offset, payload
    )
