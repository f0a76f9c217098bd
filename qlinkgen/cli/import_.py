"""``qlinkgen import``: write a schema from a file of another format."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal, TypeVar

import click

from qlinkgen.cli.boundary import FINE, WRONG, Failure, debug_option
from qlinkgen.importers.document import Document
from qlinkgen.importers.notes import Notes
from qlinkgen.importers.reading import Unreadable
from qlinkgen.model.texts import visible

F = TypeVar("F", bound=Callable[..., object])


@click.group("import")
def command() -> None:
    """Write a schema from a file of another format: a first version to complete by hand.

    What the schema cannot state is left out, with a note on standard error: file:line: note: reason. The
    schema passes `qlinkgen lint`, which warns of what the file does not state and had to be assumed.

    Exit code 1 if nothing could be imported, 2 if the file cannot be read.
    """


_output = click.option("-o", "--output", metavar="FILE", type=click.Path(), help="Write to a new file.")
_name = click.option(
    "--name", default="", metavar="NAME", help="Name of the protocol; default: that of the file."
)


def _common(function: F) -> F:
    """Add the options of every format."""
    return _name(_output(function))


@command.command("header")
@click.argument("file", metavar="FILE.h", type=click.Path())
@click.option(
    "--byteorder",
    type=click.Choice(["little", "big"]),
    default="little",
    show_default=True,
    help="Byte order of the machine.",
)
@click.option(
    "--struct",
    "structs",
    metavar="NAME",
    multiple=True,
    help="Structure that is a message, repeatable; default: all that no other one contains.",
)
@_common
def header(
    file: str, byteorder: Literal["big", "little"], structs: tuple[str, ...], name: str, output: str | None
) -> int:
    """Import the structures and enums of a C header.

    Structures become messages, or types where other structures contain them; ids are numbered and to be
    replaced. Padding becomes reserved fields. Comments become descriptions.

    Nothing is preprocessed but conditions on names, constants without arguments and #pragma pack; for other
    headers, run the preprocessor first: gcc -E -P.

    \b
    qlinkgen import header telemetry.h -o telemetry.yaml
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    from qlinkgen.importers.header import read_header  # noqa: PLC0415  # each format pays for its own package

    return _written(
        file, output, lambda notes: read_header(file, notes, name=name, byteorder=byteorder, structs=structs)
    )


def _columns(context: click.Context, parameter: click.Parameter, given: tuple[str, ...]) -> dict[str, str]:  # noqa: ARG001
    from qlinkgen.importers.table import KEYS  # noqa: PLC0415

    found: dict[str, str] = {}
    for each in given:
        heading, _, key = each.rpartition("=")
        if not heading or (key and key not in KEYS):
            raise Failure(
                f"--map {each}: write COLUMN=KEY with a KEY of {', '.join(KEYS)}, or COLUMN= to ignore it"
            )
        found[heading] = key
    return found


def _for_tables(function: F) -> F:
    """Add the options of tables."""
    order = click.option(
        "--byteorder",
        type=click.Choice(["big", "little"]),
        default="big",
        show_default=True,
        help="Byte order where the table states none.",
    )
    columns = click.option(
        "--map",
        "columns",
        metavar="COLUMN=KEY",
        multiple=True,
        callback=_columns,
        help="What a column states, repeatable; without KEY it is ignored.",
    )
    return _common(order(columns(function)))


@command.command("csv")
@click.argument("file", metavar="FILE.csv", type=click.Path())
@_for_tables
def csv(
    file: str, byteorder: Literal["big", "little"], columns: dict[str, str], name: str, output: str | None
) -> int:
    """Import a table of fields, with a row for each field.

    The keys of columns are message, id, direction, offset, bit, name, type, size, count, scale, bias (the
    value of raw 0), unit, min, max, range, default, const, values (0=off, 1=on), doc, section and byteorder.
    Their usual headings are known; --map names others. An empty message repeats the one above it.

    \b
    qlinkgen import csv fields.csv -o bus.yaml
    qlinkgen import csv fields.csv --map "Len (B)=size" --map Owner=
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    from qlinkgen.importers.table import Options, read_csv  # noqa: PLC0415

    options = Options(name, byteorder, columns)
    return _written(file, output, lambda notes: read_csv(file, notes, options))


@command.command("xlsx")
@click.argument("file", metavar="FILE.xlsx", type=click.Path())
@_for_tables
def xlsx(
    file: str, byteorder: Literal["big", "little"], columns: dict[str, str], name: str, output: str | None
) -> int:
    """Import the tables of a workbook: every sheet is read like a CSV file.

    In a sheet without a column for the message, all rows are one message with the name of the sheet.

    \b
    qlinkgen import xlsx protocol.xlsx -o bus.yaml
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    from qlinkgen.importers.table import Options, read_xlsx  # noqa: PLC0415

    options = Options(name, byteorder, columns)
    return _written(file, output, lambda notes: read_xlsx(file, notes, options))


@command.command("mavlink")
@click.argument("file", metavar="FILE.xml", type=click.Path())
@click.option(
    "--version", type=click.Choice(["1", "2"]), default="2", show_default=True, help="Version of the frame."
)
@click.option("--only", metavar="NAME", multiple=True, help="Import only this message; repeatable.")
@_common
def mavlink(file: str, version: str, only: tuple[str, ...], name: str, output: str | None) -> int:
    """Import a dialect of MAVLink with the files that it includes from its folder.

    Fields are in their order on the wire, each message has the checksum of its definition, and enums that
    fields have are taken with their descriptions.

    \b
    qlinkgen import mavlink common.xml -o mavlink.yaml
    qlinkgen import mavlink common.xml --only HEARTBEAT --only ATTITUDE
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    from qlinkgen.importers.mavlink import read_mavlink  # noqa: PLC0415

    number: Literal[1, 2] = 1 if version == "1" else 2
    return _written(
        file, output, lambda notes: read_mavlink(file, notes, name=name, version=number, only=only)
    )


@command.command("ksy")
@click.argument("file", metavar="FILE.ksy", type=click.Path())
@_common
def ksy(file: str, name: str, output: str | None) -> int:
    """Import a Kaitai Struct file.

    A payload whose type is chosen by an earlier field makes the parts around it the frame, and each case a
    message; without one, the file is one message. Types become records.

    Computed instances, processes, positions and expressions other than fields, numbers and comparisons
    cannot be taken.

    \b
    qlinkgen import ksy sensor.ksy -o sensor.yaml
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    from qlinkgen.importers.ksy import read_ksy  # noqa: PLC0415

    return _written(file, output, lambda notes: read_ksy(file, notes, name=name))


for _each in command.commands.values():
    _each.params.append(debug_option(hidden=True))


def _written(file: str, output: str | None, read: Callable[[Notes], Document]) -> int:
    """Read a file, and write the schema and the notes."""
    from qlinkgen.importers.checking import written  # noqa: PLC0415  # pydantic is slow to import

    if output is not None and Path(output).exists():
        raise Failure(f"{output} exists; remove it, or write to another file", WRONG)
    notes = Notes(file)
    try:
        text = written(read(notes), notes, output or "schema.yaml")
    except Unreadable as error:
        raise Failure(str(error)) from None
    finally:
        for each in sorted(notes.found):
            click.echo(visible(str(each)), err=True)
    if output is None:
        click.echo(text, nl=False)
    else:
        Path(output).write_text(text, encoding="utf-8", newline="\n")
        click.echo(f"{output}: {len(notes.found)} note{'' if len(notes.found) == 1 else 's'}", err=True)
    return FINE
