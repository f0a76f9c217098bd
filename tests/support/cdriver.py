"""A C program that drives a generated header: one process tests all vectors of a protocol.

`build` writes the program (with cdriver_source) and compiles it, `Driver` runs it. It answers each line with
one line:

    encode MESSAGE NODE VALUE...        ok PAYLOAD WIRE              | error KIND
    decode MESSAGE WIRE [REQUEST]       ok NODE VALUE...             | error KIND
    payload MESSAGE PAYLOAD             ok VALUE...                  | error KIND
    stream DIRECTION BYTES              ok EVENT...
    cuts DIRECTION BYTES                ok KIND...                   (of each prefix, "intact" if valid)
    check BYTES                         ok NUMBER                    (check value of the bytes)

Bytes are hex, "-" if empty. VALUEs are those of `Message.values` in order: a raw integer (decimal or 0x, a
bool is 0 or 1), an array as integers separated by commas, bytes and text as hex; "-" if empty. NODE is the
address, "-" if the frame has none. For the response of a packet protocol NODE (encode) and REQUEST (decode)
are the packet of the request, because the check value covers it. MESSAGE is the full name, DIRECTION is
request, response or message. KIND is capacity, length, range, unknown, crc, stuffing, truncated, frame or
illegal. An EVENT is `AT:KIND` or `AT:message:MESSAGE:NODE:PAYLOAD`, where AT is the offset of the byte that
completed it; faults in the contents of an intact frame (unknown, length, range) are also events. A last
`end:KIND` comes from the finish function of the header, if it has one. `cuts` decodes the first 0, 1, 2 ...
bytes, each in memory of exactly its size, and every prefix of an intact payload, so that an address sanitizer
detects reads past the end. The answer to an invalid line is `usage`.
"""

from __future__ import annotations

import hashlib
import subprocess
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from qlinkgen.model.message import Value
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.types import Blob, Scalar
from qlinkgen.plan.content import Raw
from tests.support.cdriver_source import source
from tests.support.sharing import made_once

#: Flags under which every generated header must compile without warnings.
WARNINGS = (
    *("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion"),
    *("-Wcast-qual", "-Wshadow", "-Wundef", "-Werror"),
)


def build(
    protocol: Protocol, folder: Path, compiler: str, flags: Sequence[str] = ("-O1", "-std=c99")
) -> Path:
    """Write header and program to a separate folder in `folder` and compile them; returns the program.

    It is built once, also if several processes need it.
    """
    files = {Path(name).name: text for name, text in c.generate(protocol, Options()).items()}
    files["driver.c"] = source(protocol)
    content = repr((compiler, *flags, *sorted(files.items())))
    place = folder / f"{protocol.name}-{hashlib.sha256(content.encode()).hexdigest()[:16]}"
    with made_once(place) as first:
        if first:
            for name, text in files.items():
                (place / name).write_text(text, "utf-8")
            command = [compiler, *flags, "driver.c", "-o", "driver"]
            subprocess.run(command, cwd=place, check=True, timeout=300)
    return place / "driver"


class Driver:
    """A running program; one question, one answer."""

    def __init__(self, *command: str | Path) -> None:
        """Start it, optionally in an emulator."""
        words = [str(word) for word in command]
        self._process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def ask(self, *words: object) -> str:
        """Send a line; return the answer without its line end."""
        assert self._process.stdin
        assert self._process.stdout
        self._process.stdin.write(" ".join(str(word) for word in words) + "\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        if not answer.endswith("\n"):
            raise RuntimeError(f"the driver stopped with status {self._process.wait()} at {words}")
        return answer[:-1]

    def close(self) -> None:
        """End the program."""
        assert self._process.stdin
        assert self._process.stdout
        self._process.stdin.close()
        self._process.stdout.close()
        self._process.wait(timeout=60)

    def __enter__(self) -> Self:
        """The driver itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the program."""
        self.close()


def raw_text(value: Value, raw: Raw) -> str:
    """A raw value in the format of the program."""
    if isinstance(value.type, Scalar):
        assert isinstance(raw, int)
        return str(int(raw))
    if isinstance(value.type, Blob):
        assert isinstance(raw, bytes)
        return raw.hex() or "-"
    assert isinstance(raw, list)
    return ",".join(str(item) for item in raw) or "-"
