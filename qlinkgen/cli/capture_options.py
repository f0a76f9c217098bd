"""Options of the commands that read captures."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import click

from qlinkgen._dataclass import dataclass
from qlinkgen.captures.records import FORMATS, Format, Problems
from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.common import is_hex, parse_hex, warn


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


def given_bytes(words: Sequence[str], *, raw: bool = False) -> bytes | None:
    """Return the bytes of arguments that are HEX, None if they are files, or none for standard input.

    Raises:
        Failure: they are neither, or both.
    """
    files = [each for each in words if not is_hex(each) and (each == "-" or _is_file(each))]
    if words and not files:
        if raw:
            raise Failure("raw bytes are those of a file or of standard input; omit HEX, --raw and raw")
        return parse_hex(" ".join(words))
    for each in words:
        if each not in files:
            raise Failure(f"'{each}' is not a file; write either HEX or the names of files")
    if words.count("-") > 1:
        raise Failure("- is standard input, which is read once; name it once")
    if not words and sys.stdin.isatty():
        raise Failure("nothing to decode; give HEX or FILE, or - to read standard input")
    return None


def _is_file(name: str) -> bool:
    try:
        return Path(name).exists()
    except (OSError, ValueError):  # too long for a name, or with a zero
        return False


def complain(file: str, problems: Problems) -> None:
    """Say what could not be read of a file."""
    name = "standard input" if file == "-" else file
    for each in problems.kept:
        where = f"line {each.line}" if each.line else f"offset {each.offset}"
        warn(f"{name}, {where}: {each.text}")
    if more := problems.count - len(problems.kept):
        warn(f"{name}: {more} further places could not be read")


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
