"""Pelco D by pyptzcontroller, which builds commands and reads the two answers that it asks for."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

from ptz_control_lib import ptz_controller

from qlinkgen.model.message import Direction
from tests.library.protocols import Record

_NAMES = {
    **{each: each for each in ("stop", "right", "left", "up", "down", "aux_on", "aux_off")},
    **{each: each for each in ("set_preset", "clear_preset", "go_to_preset")},
    **{each: each for each in ("move_to_pan", "move_to_tilt", "move_to_zoom")},
    **{each: each for each in ("query_pan", "query_tilt", "query_zoom")},
    "remote_reset": "reboot",
}
_ARGUMENTS = {"pan": "speed", "tilt": "speed", "preset": "preset_id", "output": "switch_id"}
#: It moves one axis at a time and leaves the lens alone.
UNKNOWN = frozenset(
    {
        *(f"{each}.request" for each in ("up_right", "up_left", "down_right", "down_left")),
        *(f"{each}.request" for each in ("zoom_tele", "zoom_wide", "focus_far", "focus_near")),
        *(f"{each}.request" for each in ("iris_open", "iris_close")),
        "query_zoom.response",
    }
)
ptz_controller.time = SimpleNamespace(sleep=lambda seconds: None)  # between its questions


def _given(fields: Mapping[str, Any]) -> Mapping[str, int]:
    if "angle" in fields or "position" in fields:
        number = fields["position"] if "position" in fields else round(fields["angle"] * 100)
        return {"d1": number >> 8, "d2": number & 0xFF}
    return {_ARGUMENTS[each]: value for each, value in fields.items()}


def _controller(node: int) -> Any:
    with contextlib.redirect_stdout(io.StringIO()):
        return ptz_controller.PtzControl("", node)


def build(record: Record) -> bytes | None:
    name = record["message"].removesuffix(".request")
    if name not in _NAMES:
        return None
    return bytes(_controller(record["node"])._create_command(_NAMES[name], **_given(record["fields"])))


def read(wire: bytes, direction: Direction) -> Record | None:
    if direction == "request" or wire[3] == 0x5D:
        return None
    controller = _controller(wire[1])
    controller._send_command = lambda command, read_response_bytes: wire
    pan, tilt = controller.get_position()
    if pan is not None:
        return {"message": "query_pan.response", "fields": {"angle": pan}}
    # It takes angles above 180 degrees for positive ones.
    angle = -tilt if tilt <= 0 else 360 - tilt
    return {"message": "query_tilt.response", "fields": {"angle": round(angle, 2)}}
