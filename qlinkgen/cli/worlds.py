"""``--layout``: the C header as a library of a world that builds firmware."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import click

from qlinkgen.backends.c.worlds import WORLDS
from qlinkgen.backends.c.worlds import generate as library
from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.targets import DEFAULT, TARGETS, Generate

#: ``--layout WORLD``; the command gets it as ``layout``.
layout_option = click.option(
    "--layout",
    type=click.Choice(WORLDS),
    help="Write the C header as a library, with manifest and example, in a folder of its name.",
)


def generators(targets: Sequence[str], layout: str | None) -> Mapping[str, Generate]:
    """Return what generates, by the name of the target or of the layout, which replaces the targets."""
    if layout is None:
        return {name: TARGETS[name].load() for name in dict.fromkeys(targets or DEFAULT)}
    if targets:
        raise Failure(f"--layout {layout} writes a library of the C header; leave out --target {targets[0]}")
    return {layout: partial(library, world=layout)}
