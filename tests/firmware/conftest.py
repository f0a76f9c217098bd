"""Firmware for all tests in this folder: see `fixtures`."""

from __future__ import annotations

from tests.firmware.fixtures import build_firmware, firmware_line

__all__ = ["build_firmware", "firmware_line"]
