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
