"""``qlinkgen lint``: report every error of schema files."""

from __future__ import annotations

import dataclasses
import json
import os
import re
from pathlib import Path

import click

from qlinkgen.cli.boundary import FINE, USAGE, WRONG, Failure
from qlinkgen.cli.common import find_schema, on_terminal, version_option
from qlinkgen.errors import Fault
from qlinkgen.model.texts import visible

#: The key that identifies a schema.
_MARK = re.compile(r"""^\{?\s*["']?qlinkgen["']?\s*:""", re.MULTILINE)


@click.command("lint")
@click.argument("schemas", metavar="SCHEMA|DIR...", nargs=-1, required=True)
@click.option(
    "--format", "form", type=click.Choice(["text", "json"]), default="text", help="json: one list of objects."
)
@version_option
def command(schemas: tuple[str, ...], form: str, version: str | None) -> int:
    """Check schema files and report every error: file:line:col: error[RULE]: description; hint.

    Without --protocol-version every version is checked that the file names in since and until.

    In a folder, every .yaml and .yml file in it and below with a key "qlinkgen" is checked and listed.

    Exit code 1 if there is an error, 2 if a file cannot be read; warnings do not count. docs/rules.md
    explains the rules.
    """
    files = [file for schema in schemas for file in _files(schema)]
    faults = [fault for file in files for fault in _faults(file, version)]
    if form == "json":
        click.echo(json.dumps([dataclasses.asdict(fault) for fault in faults], indent=2))
    else:
        for fault in faults:
            click.echo(_coloured(fault) if on_terminal() else visible(str(fault)))
        _summary(len(files), faults)
    if any(fault.rule == "file-unreadable" for fault in faults):
        return USAGE
    return WRONG if any(fault.severity == "error" for fault in faults) else FINE


def _files(schema: str) -> list[Path]:
    """Return a file, or the schemas in a folder."""
    path = Path(schema)
    if not path.is_dir():
        return [find_schema(schema)]
    found: list[Path] = []
    others: list[Path] = []
    for folder, folders, names in os.walk(path):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        for name in sorted(names):
            if name.endswith((".yaml", ".yml")):
                file = Path(folder, name)
                (found if _is_schema(file) else others).append(file)
    if not found:
        raise Failure(f"no schema in {schema}: none of its .yaml and .yml files has a key 'qlinkgen'")
    click.echo(f"{schema}: {', '.join(str(each.relative_to(path)) for each in found)}", err=True)
    if others:
        left = ", ".join(str(each.relative_to(path)) for each in others)
        click.echo(f"{schema}: not checked, without a key 'qlinkgen': {left}", err=True)
    return found


def _is_schema(file: Path) -> bool:
    """Whether a file has the key of a schema, or cannot be read, which is reported later."""
    from qlinkgen.schema.reading import read_regular  # noqa: PLC0415  # pydantic is slow to import

    try:
        return bool(_MARK.search(read_regular(file)))
    except (OSError, UnicodeDecodeError):
        return True


def _faults(file: Path, version: str | None) -> list[Fault]:
    from qlinkgen.schema import lint  # noqa: PLC0415  # pydantic is slow to import

    return lint(file, version=version)


def _coloured(fault: Fault) -> str:
    colour = "red" if fault.severity == "error" else "yellow"
    mark = f"{fault.severity}[{fault.rule}]"
    return visible(str(fault)).replace(mark, click.style(mark, fg=colour, bold=True), 1)


def _summary(files: int, faults: list[Fault]) -> None:
    errors = sum(fault.severity == "error" for fault in faults)
    counts = [(files, "schema"), (errors, "error"), (len(faults) - errors, "warning")]
    click.echo(", ".join(f"{number} {word}{'' if number == 1 else 's'}" for number, word in counts), err=True)
