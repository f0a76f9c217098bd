"""Buses for the behaviours: see `behaviour_rig`."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from tests.qlink.behaviour_rig import CLEAN, ECHOES, FAULTS, Probe, Rig, Setting, make_rig

#: Makes a rig with these nodes.
MakeRig = Callable[..., Rig]


@pytest.fixture(params=[*CLEAN, *FAULTS, *ECHOES], ids=lambda setting: setting.name)
def make(request: pytest.FixtureRequest) -> Iterator[MakeRig]:
    """Return a function that makes a rig: every face, every transport, every fault."""
    with contextlib.ExitStack() as stack:
        yield _maker(stack, request.param)


@pytest.fixture(params=CLEAN, ids=lambda setting: setting.name)
def make_clean(request: pytest.FixtureRequest) -> Iterator[MakeRig]:
    """Return a function that makes a rig without faults: every face, every transport."""
    with contextlib.ExitStack() as stack:
        yield _maker(stack, request.param)


def _maker(stack: contextlib.ExitStack, setting: Setting) -> MakeRig:
    def make(*nodes: Probe, **options: Any) -> Rig:
        return stack.enter_context(make_rig(setting, *(nodes or (Probe(),)), **options))

    return make
