"""Buses for the behaviours: see `behaviour_rig`."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from tests.firmware.fixtures import FirmwareLines, build_firmware, firmware_line
from tests.firmware.node import FirmwareNode
from tests.qlink.behaviour_rig import (
    CLEAN,
    ECHOES,
    FAULTS,
    FIRMWARE_FAULTS,
    FIRMWARES,
    Node,
    Probe,
    Rig,
    Setting,
    Slave,
    make_rig,
)
from tests.support.needs import decided_by_parameter

__all__ = ["build_firmware", "firmware_line"]

#: Makes a rig with these nodes.
MakeRig = Callable[..., Rig]


@pytest.fixture(
    params=[*CLEAN, *FAULTS, *ECHOES, *FIRMWARES, *FIRMWARE_FAULTS], ids=lambda setting: setting.name
)
def make(request: pytest.FixtureRequest) -> Iterator[MakeRig]:
    """Return a function that makes a rig: every client, every transport, every fault, every firmware."""
    yield from _maker(request)


@pytest.fixture(params=[*CLEAN, *FIRMWARES], ids=lambda setting: setting.name)
def make_clean(request: pytest.FixtureRequest) -> Iterator[MakeRig]:
    """Return a function that makes a rig without faults: every client, every transport, every firmware."""
    yield from _maker(request)


@pytest.fixture(params=CLEAN, ids=lambda setting: setting.name)
def make_simulated(request: pytest.FixtureRequest) -> Iterator[MakeRig]:
    """Return the same without firmware, for state that firmware does not show; tests state the reason."""
    yield from _maker(request)


def _maker(request: pytest.FixtureRequest) -> Iterator[MakeRig]:
    setting: Setting = request.param
    with contextlib.ExitStack() as stack:

        def make(*slaves: Slave, **options: Any) -> Rig:
            nodes = _nodes(setting, slaves or (Slave(),), request, stack)
            return stack.enter_context(make_rig(setting, *nodes, **options))

        yield make


@decided_by_parameter
def _nodes(
    setting: Setting, slaves: tuple[Slave, ...], request: pytest.FixtureRequest, stack: contextlib.ExitStack
) -> list[Node]:
    """Return simulated nodes, the first one a firmware in those settings."""
    nodes: list[Node] = [Probe(each.number, **each.settings) for each in slaves[bool(setting.firmware) :]]
    if setting.firmware:
        line_to: FirmwareLines = request.getfixturevalue("firmware_line")
        node = FirmwareNode(line_to(setting.firmware), slaves[0].number, **slaves[0].settings)
        stack.callback(node.check)
        nodes.insert(0, node)
    return nodes
