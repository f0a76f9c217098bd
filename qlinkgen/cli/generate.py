"""``qlinkgen generate``: write the outputs, or check that they are up to date."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import click

from qlinkgen._resources import schemas_dir
from qlinkgen.backends.base import OWN, SHIPPED, Options
from qlinkgen.cli import hand_vectors, reconcile
from qlinkgen.cli.boundary import FINE, WRONG, Failure
from qlinkgen.cli.common import (
    crc_option,
    did_you_mean,
    find_schema,
    load_protocol,
    on_terminal,
    version_option,
)
from qlinkgen.cli.depfile import Depfile
from qlinkgen.cli.drift import Folder
from qlinkgen.cli.manifest import schema_of, ships
from qlinkgen.cli.package import package_option
from qlinkgen.cli.targets import DEFAULT, TARGETS, Generate, reference_outputs
from qlinkgen.cli.worlds import generators, layout_option
from qlinkgen.errors import Fault, SchemaError
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.replacement import Replacement

Role = Literal["both", "master", "slave"]


@click.command("generate")
@click.argument("schemas", metavar="[SCHEMA]...", nargs=-1)
@click.option(
    "--target",
    "targets",
    multiple=True,
    type=click.Choice([*TARGETS]),
    help=f"Output to generate, repeatable; default {', '.join(DEFAULT)}.",
)
@click.option("-o", "--output", default="generated", show_default=True, help="Output folder.")
@click.option(
    "--check", is_flag=True, help="Write nothing; show differences and exit with 1 if there are any."
)
@crc_option
@version_option
@click.option(
    "--role", type=click.Choice(["both", "master", "slave"]), default="both", help="Generate only this side."
)
@click.option(
    "--only", multiple=True, metavar="NAME", help="Generate only this command or message; repeatable."
)
@package_option
@layout_option
@click.option(
    "--list-outputs", is_flag=True, help="Print the paths of all outputs, one per line; write nothing."
)
@click.option("--dry-run", is_flag=True, help="Print what would be written and removed; write nothing.")
@click.option(
    "--depfile", metavar="FILE", help="Also write a make rule with the dependencies of the outputs."
)
def command(  # noqa: PLR0917  # click passes them by name
    schemas: tuple[str, ...],
    targets: tuple[str, ...],
    output: str,
    check: bool,
    crc: Replacement | None,
    version: str | None,
    role: Role,
    only: tuple[str, ...],
    package: str | None,
    layout: str | None,
    list_outputs: bool,
    dry_run: bool,
    depfile: str | None,
) -> int:
    """Generate the outputs of the SCHEMAs, by default of all shipped ones.

    Only changed files are written, and outdated outputs are removed. Files not written by qlinkgen are
    neither overwritten nor removed: if one is in the way, nothing is written. The Python package of a schema
    is python/wire, or the one given with --package; that of a shipped schema is python/codecs.

    In the repository of qlinkgen, a run without SCHEMA and -o also writes the generated parts of docs/.

    \b
    qlinkgen generate                        all shipped schemas, to generated/
    qlinkgen generate bus.yaml --target c    one header
    qlinkgen generate bus.yaml --package my.wire --target python --target bus -o src
    qlinkgen generate bus.yaml --layout zephyr -o lib
    qlinkgen generate --check                for CI: 1 and a diff if anything is out of date
    qlinkgen generate qlink --set crc=crc-16/xmodem --role slave --only motion
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    from qlinkgen.schema import shipped  # noqa: PLC0415  # pydantic is slow to import

    protocols = _load(schemas or shipped(), crc, version)
    if mismatches := _mismatches(protocols) if crc is None and version is None else []:
        click.echo("\n".join(mismatches), err=True)
        return WRONG
    options = Options(role=role, only=_kept(only, list(protocols.values())))
    folder = Folder(Path(output))
    _fill(folder, protocols, generators(targets, layout), options, package)
    folders = [folder]
    if not (schemas or targets or layout) and output == "generated" and schemas_dir().parent == Path.cwd():
        folders.append(_reference())
    if list_outputs:
        return reconcile.list_outputs(folders)
    if check:
        return reconcile.check(folders)
    if dry_run:
        return reconcile.show(folders)
    inputs = _inputs(protocols, targets)
    made = reconcile.outputs(folders)
    rule = Depfile(Path(depfile), made, inputs, reconcile.manifests(folders)) if depfile else None
    reconcile.update(folders)
    if rule:
        rule.write()
    return FINE


def _load(schemas: Sequence[str], crc: Replacement | None, version: str | None) -> dict[str, Protocol]:
    """Load every protocol, by its schema as given; the faults of all files are reported together."""
    protocols: dict[str, Protocol] = {}
    faults: list[Fault] = []
    for schema in schemas:
        try:
            protocols[schema] = load_protocol(schema, crc, version)
        except SchemaError as error:
            faults += error.faults
    if faults:
        raise SchemaError(faults)
    names = [protocol.name for protocol in protocols.values()]
    for name in names:
        if names.count(name) > 1:
            raise Failure(f"two schemas describe a protocol '{name}'; rename one under protocol: name")
    return protocols


def _mismatches(protocols: Mapping[str, Protocol]) -> list[str]:
    """Return the hand-written vectors that shipped schemas no longer match, one line each."""
    return [
        mismatch
        for schema, protocol in protocols.items()
        if ships(schema)
        for mismatch in hand_vectors.mismatches(protocol)
    ]


def _inputs(protocols: Mapping[str, Protocol], targets: Sequence[str]) -> list[Path]:
    """Return the files that the outputs depend on: the schemas, and the vectors in a kit."""
    files = [find_schema(schema) for schema in protocols]
    files += [
        file.parent / each.includes
        for file, each in zip(files, protocols.values(), strict=True)
        if each.includes
    ]
    if "conformance" in targets:
        files += [hand_vectors.file_of(each) for schema, each in protocols.items() if ships(schema)]
    return [file for file in files if file.is_file()]


def _kept(only: Sequence[str], protocols: Sequence[Protocol]) -> tuple[str, ...]:
    known = {
        name
        for protocol in protocols
        for message in protocol.messages
        for name in (message.name, message.command)
    }
    for name in only:
        if name not in known:
            hint = did_you_mean(name, sorted(known)) or f"{_show_hint(protocols)} lists them"
            raise Failure(f"--only {name}: unknown command or message; {hint}")
    return tuple(only)


def _show_hint(protocols: Sequence[Protocol]) -> str:
    return f"`qlinkgen show {protocols[0].name if len(protocols) == 1 else 'PROTOCOL'}`"


def _fill(
    folder: Folder,
    protocols: Mapping[str, Protocol],
    targets: Mapping[str, Generate],
    options: Options,
    package: str | None,
) -> None:
    with _progress(len(targets) * len(protocols)) as step:
        for target, generate in targets.items():
            for schema, protocol in protocols.items():
                step(f"{target} {protocol.name}")
                source = schema_of(protocol, schema, folder.root)
                chosen = replace(options, package=package or (SHIPPED if ships(schema) else OWN))
                kept = _keeps(protocol, options)
                outputs = dict(generate(protocol, chosen)) if kept else {}
                folder.want(protocol.name, source, target, outputs)


def _keeps(protocol: Protocol, options: Options) -> bool:
    """Whether a protocol still has messages after --only."""
    names = {name for message in protocol.messages for name in (message.name, message.command)}
    return not options.only or not names.isdisjoint(options.only)


def _reference() -> Folder:
    folder = Folder(schemas_dir().parent, listed=False)
    folder.want("", "", "reference", dict(reference_outputs()))
    return folder


def _no_step(what: str) -> None:
    """Show nothing."""


@contextlib.contextmanager
def _progress(total: int) -> Iterator[Callable[[str], None]]:
    """Show a progress bar on a terminal; the function takes the name of the next step."""
    if not on_terminal(sys.stderr):
        yield _no_step
        return
    from rich.console import Console  # noqa: PLC0415  # only a terminal needs it
    from rich.progress import Progress  # noqa: PLC0415

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("generating", total=total)
        yield lambda what: bar.update(task, advance=1, description=what)
