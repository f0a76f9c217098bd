"""The generated header is close to code written by hand for one message, on both chips."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from benchmarks.firmware_build import CORTEX_M0, TARGETS, Target, Workshop
from benchmarks.firmware_floor import RATIOS, SIDES, ratios, work


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
def test_the_floor_is_near(target: Target, tmp_path: Path, require_tool: Callable[..., str]) -> None:
    require_tool(f"{target.prefix}-gcc", package=target.package)
    if target is CORTEX_M0:
        require_tool("qemu-system-arm", package="qemu-system-arm")
    done = {side: work(Workshop(tmp_path), target, side) for side in SIDES}
    assert all(each.encode > 200 and each.receive > each.longest > 50 for each in done.values())
    for found, limit in zip(ratios(done["floor"], done["generated"]), RATIOS[target.name], strict=True):
        assert found < limit + 0.01, done
