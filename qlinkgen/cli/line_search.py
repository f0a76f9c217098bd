"""``qlinkgen doctor --find-line``: listen at one speed and parity after another."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from types import ModuleType
from typing import get_args

import click

from qlinkgen._dataclass import dataclass
from qlinkgen.cli import jsonlines
from qlinkgen.cli.boundary import FINE, WRONG, Failure
from qlinkgen.cli.common import warn
from qlinkgen.cli.streams import Bad, Stream, open_stream
from qlinkgen.cli.tables import Table
from qlinkgen.cli.wire_options import Line, Parity, open_line
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan.framing import frame_plan
from qlinkgen.transport.port import Port

#: Usual speeds, those in use today first.
BAUDS = (115200, 9600, 19200, 38400, 57600, 230400, 460800, 921600, 4800, 2400, 1200)
#: Valid frames without a fault after which a setting is taken for right.
ENOUGH = 3
#: Seconds without a byte that end a frame of any protocol.
IDLE = 0.02


@dataclass(slots=True)
class Heard:
    """What was received at one setting.

    Attributes:
        baud: speed in bit/s.
        parity: none, even or odd.
        bytes: bytes received.
        frames: valid frames.
        good: bytes of those.
        faults: damaged frames.
    """

    baud: int
    parity: Parity
    bytes: int = 0
    frames: int = 0
    good: int = 0
    faults: int = 0

    @property
    def certain(self) -> bool:
        """Whether only valid frames were received, and several."""
        return self.frames >= ENOUGH and not self.faults


def find_line(
    protocol: Protocol, codec: ModuleType, name: str, baud: int | None, *, length: float, as_json: bool
) -> int:
    """Listen at each setting for some seconds, print what was heard, and return the exit code."""
    if frame_plan(protocol.frame).needs_request:
        raise Failure(
            f"--find-line: a response of {protocol.name} has a meaning only with its request, which is on "
            "another line; omit it"
        )
    heard = list(_search(protocol, codec, name, baud, length))
    best = max(heard, key=lambda each: (each.certain, each.good))
    found = (
        [each for each in heard if each.good == best.good and each.baud == best.baud] if best.frames else []
    )
    if as_json:
        settings = [{"baud": each.baud, "parity": each.parity} for each in found]
        click.echo(jsonlines.line({"found": settings, "heard": [asdict(each) for each in heard]}))
    else:
        _show(heard, found)
    if not found:
        received = any(each.bytes for each in heard)
        what = "no valid frame at any setting" if received else "nothing was received; let a master send"
        warn(f"{what}; check PROTOCOL, wiring and polarity")
    return FINE if found else WRONG


def _search(
    protocol: Protocol, codec: ModuleType, name: str, baud: int | None, length: float
) -> Iterator[Heard]:
    """Listen until a setting is right, and at the same speed with the other parities, which may be too."""
    usual = protocol.bus.baud
    speeds = (baud,) if baud is not None else tuple(dict.fromkeys((usual, *BAUDS) if usual else BAUDS))
    for speed in speeds:
        certain = False
        for parity in get_args(Parity):
            with open_line(name, speed, Line(parity)) as port:
                heard = Heard(speed, parity)
                _listen(port, open_stream(protocol, codec, None), heard, length)
            yield heard
            certain = certain or heard.certain
            if parity == "none" and certain:
                return
        if certain:
            return


def _listen(port: Port, stream: Stream, heard: Heard, length: float) -> None:
    """Count for some seconds, or until the setting is certainly right."""
    end = port.now() + length
    while port.now() < end and not heard.certain:
        data = port.read(min(IDLE, max(0.0, end - port.now())))
        heard.bytes += len(data)
        for event in stream.feed(data) if data else stream.finish():
            if isinstance(event, Bad):
                heard.faults += 1
            else:
                heard.frames += 1
                heard.good += len(event.to_frame())


def _show(heard: list[Heard], found: list[Heard]) -> None:
    table = Table(["baud", "parity", "bytes", "valid frames", "damaged"], right=frozenset({"baud", "bytes"}))
    for each in heard:
        if each.bytes:
            table.add(each.baud, each.parity, each.bytes, each.frames, each.faults)
    table.show()
    if found:
        options = f"--baud {found[0].baud}"
        parities = [each.parity for each in found]
        if parities != ["none"]:
            options += f" --parity {' or '.join(parities)}"
        click.echo(f"found: {options}")
