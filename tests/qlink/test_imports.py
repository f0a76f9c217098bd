"""Unused parts of the package are not imported."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.cli.test_boundary import ENVIRONMENT


@pytest.mark.parametrize(
    "module",
    ["qlinkgen.protocols.qlink", "qlinkgen.protocols.mc1231a", "qlinkgen.transport.serving"],
)
def test_blocking_programs_do_without_asyncio(module: str) -> None:
    code = f"import sys, {module}; print('asyncio' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], env=ENVIRONMENT, capture_output=True, text=True, check=True
    )
    assert done.stdout == "False\n"


@pytest.mark.parametrize(
    ("protocol", "names"),
    [
        ("qlink", ["AsyncBus", "AsyncNode"]),
        ("mc1231a", ["AsyncAxis", "AsyncHost"]),
        ("trio", ["AsyncMembraneKeypad", "AsyncMotionCoordinator"]),
    ],
)
def test_the_face_for_asyncio_is_there_when_it_is_asked_for(protocol: str, names: list[str]) -> None:
    package = __import__(f"qlinkgen.protocols.{protocol}", fromlist=["aio"])
    for name in names:
        assert getattr(package, name).__name__ == name
    with pytest.raises(AttributeError, match="AsyncNothing"):
        package.AsyncNothing  # noqa: B018
