"""Options of the commands that read captures."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass

import click

from qlinkgen.captures.records import FORMATS, Format
from qlinkgen.cli.boundary import Failure


@dataclass(frozen=True, slots=True)
class CaptureOptions:
    """How the user says that a capture is read."""

    #: None: it is detected.
    format: Format | None
    line_regex: str | None
    #: Bits per second; None: as the schema states.
    baud: int | None


def capture_options(command: Callable[..., int]) -> Callable[..., int]:
    """Add the options of commands that read captures; the command gets them as `capture`."""

    @functools.wraps(command)
    def wrapped(
        *given: object,
        capture_format: Format | None,
        raw: bool,
        line_regex: str | None,
        capture_baud: int | None,
        **named: object,
    ) -> int:
        if raw and capture_format not in {None, "raw"}:
            raise Failure(f"--raw and --capture-format {capture_format} contradict each other; omit one")
        name: Format | None = "raw" if raw else capture_format
        if line_regex is not None and name is not None:
            raise Failure("--line-regex is a format of its own; omit --capture-format and --raw")
        return command(*given, capture=CaptureOptions(name, line_regex, capture_baud), **named)

    for option in reversed(_OPTIONS):
        option(wrapped)
    return wrapped


_OPTIONS = [
    click.option(
        "--capture-format",
        type=click.Choice(FORMATS),
        help="The format of the captures; detected by default.",
    ),
    click.option("--raw", is_flag=True, help="The same as --capture-format raw."),
    click.option(
        "--line-regex",
        metavar="REGEX",
        help="Read lines by a regular expression with (?P<hex>...) or (?P<text>...), and (?P<time>...) and "
        "(?P<direction>...) if they have them.",
    ),
    click.option(
        "--capture-baud",
        type=click.IntRange(1),
        metavar="BAUD",
        help="Bits per second, to find silences in captures of single bytes; by default those of the schema.",
    ),
]
