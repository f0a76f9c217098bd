"""``qlinkgen list``: print the protocols of the package."""

from __future__ import annotations

import click

from qlinkgen.cli.common import load_protocol
from qlinkgen.cli.tables import Table


@click.command("list")
def command() -> None:
    """List the protocols of qlinkgen; each name can be used as PROTOCOL.

    Those with engines come with generated code, masters and slaves in Python (`qlinkgen.codecs`); those of
    the library are descriptions of public protocols, to generate code from or to begin a schema with.
    """
    from qlinkgen.schema import library, shipped  # noqa: PLC0415  # pydantic is slow to import

    table = Table(["name", "title", "revision", "kind"])
    for kind, names in (("with engines", shipped()), ("library", library())):
        for name in names:
            protocol = load_protocol(name)
            table.add(name, protocol.title, protocol.revision, kind)
    table.show()
