"""``qlinkgen lint``: every fault of schema files."""

from __future__ import annotations

import dataclasses
import json

import click

from qlinkgen.cli.boundary import FINE, USAGE, WRONG
from qlinkgen.cli.common import find_schema, on_terminal
from qlinkgen.errors import Fault
from qlinkgen.model.texts import visible


@click.command("lint")
@click.argument("schemas", metavar="SCHEMA...", nargs=-1, required=True)
@click.option(
    "--format", "form", type=click.Choice(["text", "json"]), default="text", help="json: a list of objects."
)
def command(schemas: tuple[str, ...], form: str) -> int:
    """Check schema files and report every fault of each: file:line:col: error[RULE]: what is wrong; hint.

    Exit code 1 if there is an error, 2 if a file cannot be read; warnings do not count. docs/rules.md
    explains the rules.
    """
    faults = [fault for schema in schemas for fault in _faults(schema)]
    if form == "json":
        click.echo(json.dumps([dataclasses.asdict(fault) for fault in faults], indent=2))
    else:
        for fault in faults:
            click.echo(_coloured(fault) if on_terminal() else visible(str(fault)))
        _summary(len(schemas), faults)
    if any(fault.rule == "file-unreadable" for fault in faults):
        return USAGE
    return WRONG if any(fault.severity == "error" for fault in faults) else FINE


def _faults(schema: str) -> list[Fault]:
    from qlinkgen.schema import lint  # noqa: PLC0415  # pydantic takes a while

    return lint(find_schema(schema))


def _coloured(fault: Fault) -> str:
    colour = "red" if fault.severity == "error" else "yellow"
    mark = f"{fault.severity}[{fault.rule}]"
    return visible(str(fault)).replace(mark, click.style(mark, fg=colour, bold=True), 1)


def _summary(files: int, faults: list[Fault]) -> None:
    errors = sum(fault.severity == "error" for fault in faults)
    counts = [(files, "schema"), (errors, "error"), (len(faults) - errors, "warning")]
    click.echo(", ".join(f"{number} {word}{'' if number == 1 else 's'}" for number, word in counts), err=True)
