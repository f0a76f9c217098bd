"""``qlinkgen export``: the frames of captures as tables."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Literal
from typing import Protocol as TypingProtocol

import click

from qlinkgen.cli import jsonlines
from qlinkgen.cli.arguments import protocol_argument
from qlinkgen.cli.boundary import FINE, WRONG, Failure
from qlinkgen.cli.capture_input import Capture
from qlinkgen.cli.capture_options import CaptureOptions, capture_options, complain
from qlinkgen.cli.codec import load_codec
from qlinkgen.cli.common import load_protocol, version_option
from qlinkgen.cli.decode import frame_record
from qlinkgen.cli.decoder import Decoder
from qlinkgen.cli.filters import Filter, FilterOptions, Flagged, filter_options
from qlinkgen.model.fields import Record
from qlinkgen.model.message import Message
from qlinkgen.model.naming import record_key
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.values import Json

Form = Literal["csv", "jsonl"]
_FAULTS = ("time", "offset", "kind", "raw", "message")


@click.command("export")
@protocol_argument
@click.argument("files", metavar="FILE...", nargs=-1, required=True)
@click.option("-o", "--output", metavar="DIR", required=True, help="Folder of the tables; it is made.")
@click.option("--to", "form", type=click.Choice(["csv", "jsonl"]), default="csv", help="csv by default.")
@filter_options
@capture_options
@version_option
def command(  # noqa: PLR0917  # click passes them by name
    protocol: str,
    files: tuple[str, ...],
    output: str,
    form: Form,
    wanted: FilterOptions,
    capture: CaptureOptions,
    version: str | None,
) -> int:
    """Write the frames of captures as tables, for spreadsheets and programs.

    FILE is any capture that decode reads, or - for standard input. With csv, each message is a file with a
    column for each field, and faults.csv has the bad frames; enums and flags are names, lists are JSON. With
    jsonl, frames.jsonl has an object as of decode in each line.

    \b
    qlinkgen export qlink line.pcapng -o tables
    qlinkgen export qlink line.pcapng -o tables --to jsonl --where 'position > 1000'
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    loaded = load_protocol(protocol, None, version)
    codec = load_codec(loaded, plain=True)
    chosen, flagged = Filter(loaded, wanted), Flagged(loaded)
    count = 0
    with ExitStack() as ended:
        folder = _folder(output)
        tables: _Tables = _Csv(loaded, folder, ended) if form == "csv" else _Lines(folder, ended)
        for name in files:
            file = Capture(loaded, Decoder(loaded, codec, None, None, None, capture.baud), capture)
            for event, place in file.frames(name):
                record = frame_record(loaded, event, place)
                if len(files) > 1:
                    record["file"] = name
                if chosen.keeps(record):
                    tables.add(flagged.named(record))
                    count += 1
            complain(name, file.problems)
    click.echo(f"qlinkgen: wrote {count} rows to {', '.join(tables.names) or output}", err=True)
    return FINE if count else WRONG


def _folder(name: str) -> Path:
    folder = Path(name)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise Failure(f"-o {name}: it is not a folder; name one") from None
    return folder


class _Tables(TypingProtocol):
    """Takes objects as `decode` prints them."""

    names: list[str]

    def add(self, record: Mapping[str, Json]) -> None:
        """Append one."""


class _Lines:
    """One file of JSON lines."""

    def __init__(self, folder: Path, ended: ExitStack) -> None:
        self.names = [str(folder / "frames.jsonl")]
        file = Path(self.names[0]).open("w", encoding="utf-8", newline="\n")  # noqa: SIM115  # by the stack
        self._file = ended.enter_context(file)

    def add(self, record: Mapping[str, Json]) -> None:
        self._file.write(f"{jsonlines.line(record)}\n")


class _Csv:
    """A file for each message."""

    def __init__(self, protocol: Protocol, folder: Path, ended: ExitStack) -> None:
        self.names: list[str] = []
        self._protocol, self._folder, self._ended = protocol, folder, ended
        self._write: dict[str, Callable[[Mapping[str, Json]], None]] = {}

    def add(self, record: Mapping[str, Json]) -> None:
        name = record.get("message")
        key = name if isinstance(name, str) else ""
        if key not in self._write:
            self._write[key] = self._opened(key)
        self._write[key](record)

    def _opened(self, name: str) -> Callable[[Mapping[str, Json]], None]:
        path = self._folder / f"{name or 'faults'}.csv"
        self.names.append(str(path))
        file: IO[str] = self._ended.enter_context(path.open("w", encoding="utf-8", newline=""))
        rows = csv.writer(file)
        if not name:
            rows.writerow(_FAULTS)
            return lambda record: rows.writerow(_fault(record))
        message = self._protocol.by_name[name]
        address = record_key(self._protocol.address_name or "")
        beside = [record_key(each.name) for each in self._protocol.beside(message)]
        heads = ["time", "offset", *([address] if address else []), *beside, "refused"]
        columns = list(_columns(message))
        rows.writerow([*heads, *(".".join(path) for path in columns)])

        def write(record: Mapping[str, Json]) -> None:
            values = [record.get(each) for each in heads] + [_at(record["fields"], each) for each in columns]
            rows.writerow(map(_cell, values))

        return write


def _columns(message: Message) -> Iterator[tuple[str, ...]]:
    """Return the paths of the values of a message; those in records too."""
    for value in message.values:
        if isinstance(value.type, Record):
            yield from ((value.name, each.name) for each in value.type.layout.values)
        else:
            yield (value.name,)


def _at(found: Json, path: tuple[str, ...]) -> Json:
    for name in path:
        found = found.get(name) if isinstance(found, Mapping) else None
    return found


def _fault(record: Mapping[str, Json]) -> list[str]:
    error = record["error"]
    assert isinstance(error, Mapping)
    return [_cell({**error, "time": record.get("time")}.get(each)) for each in _FAULTS]


def _cell(found: Json) -> str:
    if found is None:
        return ""
    return found if isinstance(found, str) else jsonlines.line(found)
