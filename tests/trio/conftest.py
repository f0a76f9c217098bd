"""Rings for the behaviours: see `behaviour_rig`."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from tests.trio.behaviour_rig import SETTINGS, Rig, make_rig

#: Makes a rig of these kinds of nodes.
MakeRig = Callable[..., Rig]


@pytest.fixture(params=SETTINGS, ids=lambda setting: setting.name)
def make(request: pytest.FixtureRequest) -> Iterator[MakeRig]:
    """Return a function that makes a rig: every client, every transport."""
    with contextlib.ExitStack() as stack:

        def make(ring: str, **options: Any) -> Rig:
            return stack.enter_context(make_rig(request.param, ring, **options))

        yield make
