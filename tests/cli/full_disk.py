"""A disk without room, where the system has one."""

from __future__ import annotations

from pathlib import Path

import pytest

FULL_DISK = pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full here")
