"""``qlinkgen monitor --capture``: what a monitor would have heard of the traffic of a capture."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from types import ModuleType

import click

from qlinkgen.cli import jsonlines
from qlinkgen.cli.boundary import FINE, WRONG
from qlinkgen.cli.capture_input import Capture
from qlinkgen.cli.capture_options import CaptureOptions, complain
from qlinkgen.cli.decoder import Decoder
from qlinkgen.cli.hearing import Teller
from qlinkgen.cli.stats_source import SLACK, Listening
from qlinkgen.cli.wire_options import counted
from qlinkgen.link.monitor import Unanswered
from qlinkgen.link.timing import Timing
from qlinkgen.link.transaction import Accepts
from qlinkgen.model.protocol import Protocol


def monitor_capture(
    protocol: Protocol,
    codec: ModuleType,
    name: str,
    *,
    as_json: bool,
    raw: bool,
    count: int | None,
    baud: int,
    slack: float | None,
    accepts: Mapping[str, Accepts] | None,
) -> int:
    """Print the traffic of a capture with its times, and a summary; return the exit code."""
    file = Capture(
        protocol, Decoder(protocol, codec, None, None, None, baud), CaptureOptions(None, None, baud)
    )
    timing = Timing.of(codec, host_slack=SLACK if slack is None else slack, baud=baud)
    listening = Listening(codec, timing, accepts)
    teller = Teller(protocol, codec, 0.0, raw=raw)
    frames = 0
    for heard in listening.heard(file.records(name)):
        text = jsonlines.line(teller.tell(heard).record) if as_json else teller.line(heard)
        sys.stdout.write(f"{text}\n")
        frames += not isinstance(heard, Unanswered)
        if frames == count:
            break
    complain(name, file.problems)
    skipped = listening.monitor.skipped
    click.echo(f"qlinkgen: {counted(frames, 'frame')}; {skipped} bytes outside frames", err=True)
    return FINE if frames else WRONG
