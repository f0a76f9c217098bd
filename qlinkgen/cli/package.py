"""``--package``: the name of the Python package to write."""

from __future__ import annotations

import keyword
import re
import sys

import click

from qlinkgen.cli.boundary import Failure
from qlinkgen.model.naming import WINDOWS_DEVICES

_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


def _folder(context: click.Context, parameter: click.Parameter, name: str | None) -> str | None:  # noqa: ARG001
    """Return the folder of a package, below the output folder."""
    if name is None:
        return None
    parts = name.split(".")
    for part in parts:
        if why := _refused(part):
            raise Failure(f"--package {name}: {why}; a name is like my.wire")
    if parts[0] in sys.stdlib_module_names:
        raise Failure(f"--package {name}: {parts[0]} is a module of Python; choose another name")
    return "/".join(parts)


def _refused(part: str) -> str:
    if not _IDENTIFIER.fullmatch(part):
        return f"{part!r} is not a Python name of letters, digits and _"
    if keyword.iskeyword(part):
        return f"{part} is a keyword of Python"
    if part.lower() in WINDOWS_DEVICES:
        return f"{part} is a device of Windows"
    if part.lower() == "qlinkgen":
        return f"{part} is the package of the generator itself"
    return ""


#: ``--package NAME``; the command gets its folder, such as ``my/wire``, as ``package``.
package_option = click.option(
    "--package",
    metavar="NAME",
    callback=_folder,
    help="Python package to write, such as my.wire, to the folder my/wire of the output.",
)
