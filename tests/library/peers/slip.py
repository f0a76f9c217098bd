"""SLIP by sliplib."""

from __future__ import annotations

from sliplib import END, decode, encode

from qlinkgen.model.message import Direction
from tests.library.peers.cobs import body, seen
from tests.library.protocols import Record

UNKNOWN: frozenset[str] = frozenset()


def build(record: Record) -> bytes | None:
    return bytes(encode(body(record)) + END)


def read(wire: bytes, direction: Direction) -> Record | None:
    return seen(decode(wire.removesuffix(END)), direction)
