"""``qlinkgen coverage``: which messages and values of a protocol captures have exercised."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from decimal import Decimal
from typing import Literal, TypeAlias

import click

from qlinkgen.cli.arguments import protocol_argument
from qlinkgen.cli.boundary import FINE, WRONG
from qlinkgen.cli.capture_input import Capture
from qlinkgen.cli.capture_options import CaptureOptions, capture_options, complain
from qlinkgen.cli.codec import load_codec
from qlinkgen.cli.common import load_protocol, version_option
from qlinkgen.cli.decode import frame_record
from qlinkgen.cli.decoder import Decoder
from qlinkgen.cli.filters import Filter, FilterOptions, Flagged, filter_options
from qlinkgen.cli.tables import Table
from qlinkgen.model.fields import Record, Records, Value
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.values import Json

Form = Literal["text", "json"]
#: Names from a message down to a value, through records.
Path: TypeAlias = tuple[str, ...]


class Seen:
    """What was seen of a value.

    Attributes:
        count: how often it was there; items of a list are not counted.
        names: its names of an enum, its flags, or true and false.
        others: a number without a name, or a bit.
        least: smallest number, None without any.
        most: largest number.
    """

    def __init__(self, known: tuple[str, ...]) -> None:
        """`known`: all names that it can have."""
        self.known = known
        self.count = 0
        self.names = set[str]()
        self.others = False
        self.least: int | float | Decimal | None = None
        self.most: int | float | Decimal | None = None

    def take(self, found: Json) -> None:
        """Count a value, as `decode` prints it with names of flags."""
        if isinstance(found, list | tuple):
            for each in found:
                self.take(each)
        elif isinstance(found, bool):
            self.names.add(str(found).lower())
        elif self.known:
            self.names.update({found} & set(self.known) if isinstance(found, str) else ())
            self.others = self.others or found not in self.known
        elif isinstance(found, int | float | Decimal):
            self.least = found if self.least is None else min(self.least, found)
            self.most = found if self.most is None else max(self.most, found)

    @property
    def missing(self) -> list[str]:
        """Names that were not seen."""
        return [each for each in self.known if each not in self.names]


@click.command("coverage")
@protocol_argument
@click.argument("files", metavar="FILE...", nargs=-1, required=True)
@click.option("--format", "form", type=click.Choice(["text", "json"]), default="text")
@click.option("--missing", is_flag=True, help="Only what was not seen. Exit code 1 if there is anything.")
@filter_options
@capture_options
@version_option
def command(  # noqa: PLR0917  # click passes them by name
    protocol: str,
    files: tuple[str, ...],
    form: Form,
    missing: bool,
    wanted: FilterOptions,
    capture: CaptureOptions,
    version: str | None,
) -> int:
    """Print which messages of a protocol captures have, and which values of their fields.

    FILE is any capture that decode reads, or - for standard input; those of a test run show what it has not
    exercised. Of enums, flags and booleans, the values are counted; of numbers, the smallest and the largest
    are beside the range that they can have.

    \b
    qlinkgen coverage qlink line.pcapng
    qlinkgen coverage qlink tests/*.pcapng --missing
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    loaded = load_protocol(protocol, None, version)
    codec = load_codec(loaded, plain=True)
    chosen, flagged = Filter(loaded, wanted), Flagged(loaded)
    covered = Coverage(loaded)
    for name in files:
        file = Capture(loaded, Decoder(loaded, codec, None, None, None, capture.baud), capture)
        for event, place in file.frames(name):
            record = frame_record(loaded, event, place)
            if "message" in record and chosen.keeps(record):
                covered.take(flagged.named(record))
        complain(name, file.problems)
    if form == "json":
        click.echo(json.dumps(covered.record(), indent=2, default=float))
    else:
        covered.show(only_missing=missing)
    if missing:
        return WRONG if covered.gaps else FINE
    return FINE if any(covered.frames.values()) else WRONG


class Coverage:
    """What was seen of each message and value of a protocol.

    Attributes:
        frames: how often, by message.
    """

    def __init__(self, protocol: Protocol) -> None:
        self.frames = {each.name: 0 for each in protocol.messages}
        self._values = {
            message.name: [
                (".".join(path), path, value, Seen(value.members)) for path, value in _paths(message.values)
            ]
            for message in protocol.messages
        }

    def take(self, record: Mapping[str, Json]) -> None:
        """Count an object as `decode` prints it with names of flags."""
        name = str(record["message"])
        self.frames[name] += 1
        for _, path, _, seen in self._values[name]:
            for found in _found(record["fields"], path):
                seen.count += 1
                seen.take(found)

    @property
    def gaps(self) -> int:
        """Number of messages and names that were not seen."""
        of_seen = (values for name, values in self._values.items() if self.frames[name])
        names = sum(len(seen.missing) for values in of_seen for *_, seen in values)
        return names + sum(not count for count in self.frames.values())

    def record(self) -> dict[str, Json]:
        """Return what was seen for JSON."""
        return {
            "messages": dict(self.frames),
            "values": [
                {
                    "message": message,
                    "field": field,
                    "count": seen.count,
                    "seen": sorted(seen.names),
                    "missing": list[Json](seen.missing),
                    "least": seen.least,
                    "most": seen.most,
                }
                for message, values in self._values.items()
                for field, _, _, seen in values
            ],
        }

    def show(self, *, only_missing: bool) -> None:
        """Print the messages, and the values of those that were seen."""
        total = len(self.frames)
        seen = sum(map(bool, self.frames.values()))
        click.echo(f"{seen} of {total} messages were seen\n")
        table = Table(["message", "field", "count", "seen", "of", "not seen"], right=frozenset({"count"}))
        for name, count in self.frames.items():
            if not (count and only_missing):
                table.add(name, "", count, "", "", "" if count else "the message")
            for field, _, value, found in self._values[name] if count else ():
                if found.missing or not only_missing:
                    table.add("", field, found.count, *_row(value, found))
        table.show()


def _row(value: Value, seen: Seen) -> tuple[str, str, str]:
    if seen.known:
        return f"{len(seen.names)} values", str(len(seen.known)), ", ".join(seen.missing)
    if seen.least is None:
        return "", "", ""
    span = f"{seen.least}" if seen.least == seen.most else f"{seen.least}..{seen.most}"
    number = value.number
    plain = number is not None and number.scaling is None and number.meaning is None
    return span, f"{number.minimum}..{number.maximum}" if number is not None and plain else "", ""


def _paths(values: Iterable[Value], before: Path = ()) -> Iterator[tuple[Path, Value]]:
    for value in values:
        if isinstance(value.type, Record | Records):
            yield from _paths(value.type.layout.values, (*before, value.name))
        else:
            yield (*before, value.name), value


def _found(of: Json, path: Path) -> Iterator[Json]:
    """Return the values at a path; of records in a list, those of all."""
    if isinstance(of, list | tuple) and path:
        for each in of:
            yield from _found(each, path)
    elif not path:
        if of is not None:
            yield of
    elif isinstance(of, Mapping) and path[0] in of:
        yield from _found(of[path[0]], path[1:])
