"""Commands of the STM32 boot loader by stm32loader, which sends and acknowledges them part by part."""

from __future__ import annotations

import contextlib
import io
from types import SimpleNamespace
from typing import Any

from stm32loader import bootloader

from qlinkgen.model.message import Direction
from tests.library.protocols import Record

#: What the device sends, which has no beginning of its own: see test_stm32_live.
UNKNOWN = frozenset(
    {"ack", "nack", "get.known", "get_version.known", "get_id.product", "read_memory.content"}
)
_ACK = b"\x79"
#: Bytes of a command and of an address.
_CODE, _PLACE = 2, 7


class _Line:
    """A device that acknowledges everything."""

    timeout = 0

    def __init__(self) -> None:
        self.sent = b""

    def write(self, data: bytes) -> None:
        self.sent += data

    def read(self, size: int = 1) -> bytes:
        return _ACK * size


def _sent(method: str, *arguments: Any, extended: bool = False) -> bytes:
    """What a call sends."""
    bootloader.time = SimpleNamespace(sleep=lambda _: None)  # it waits for the device to start again
    line = _Line()
    loader = bootloader.Stm32Bootloader(line, verbosity=0)
    loader.extended_erase = extended
    with contextlib.redirect_stderr(io.StringIO()):
        getattr(loader, method)(*arguments)
    return line.sent


def build(record: Record) -> bytes | None:
    fields = record["fields"]
    match record["message"].split("."):
        case [("erase" | "extended_erase") as command, "request"]:
            return _sent("erase_memory", [0], extended=command == "extended_erase")[:_CODE]
        case ["write_protect", "request"]:
            return _sent("write_protect", [0])[:_CODE]
        case [("read_memory" | "write_memory" | "go") as command, ("request" | "place") as part]:
            more = {"read_memory": (4,), "write_memory": (b"1234",)}.get(command, ())
            sent = _sent(command, fields.get("start", 0), *more)
            return sent[:_CODE] if part == "request" else sent[_CODE:_PLACE]
        case ["read_memory", "amount"]:
            return _sent("read_memory", 0, fields["count"])[_PLACE:]
        case ["write_memory", "block"]:
            data = bytes.fromhex(fields["data"])  # it fills words up
            return _sent("write_memory", 0, data)[_PLACE:] if len(data) % 4 == 0 else None
        case [("erase" | "extended_erase") as command, "pages"]:
            return _sent("erase_memory", fields["pages"], extended=command == "extended_erase")[_CODE:]
        case ["write_protect", "sectors"]:
            return _sent("write_protect", fields["sectors"])[_CODE:]
        case [command, "request"]:
            return _sent(command)[:_CODE]
    return None


def read(wire: bytes, direction: Direction) -> Record | None:
    return None
