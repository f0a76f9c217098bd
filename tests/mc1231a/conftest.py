"""Chip sets for the behaviours: see `rig`."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from qlinkgen.protocols.mc1231a import UnconfirmedCommand
from tests.mc1231a.rig import SETTINGS, Rig, make_rig

#: Makes a rig; its options are those of `make_rig`.
MakeRig = Callable[..., Rig]


@pytest.fixture(params=SETTINGS, ids=lambda setting: setting.name)
def make(request: pytest.FixtureRequest) -> Iterator[MakeRig]:
    """Return a function that makes a rig: every client, every transport."""
    with contextlib.ExitStack() as stack:

        def make(**options: Any) -> Rig:
            return stack.enter_context(make_rig(request.param, **options))

        yield make


@pytest.fixture
def rig(make: MakeRig) -> Rig:
    """Return a rig: every client, every transport."""
    return make()


@pytest.fixture(autouse=True)
def _trusting() -> Iterator[None]:
    """Let unconfirmed commands pass; the tests of their warnings say so."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnconfirmedCommand)
        yield
