"""Commands of VISCA by pyvisca, which builds them for the first camera."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from pyvisca.visca import PTZ

from qlinkgen.model.message import Direction
from tests.library.protocols import Record

#: Its speed of the axis that stands still.
_OTHER = 0x15
#: It computes positions of its own scale, and has no manual exposure.
UNKNOWN = frozenset({"move_to.request", "auto_focus.request"})


def _call(name: str, fields: Any) -> tuple[str, tuple[Any, ...]] | None:  # noqa: C901
    """The method for a message, and its arguments."""
    match name, fields:
        case (("power" | "backlight" | "freeze"), {"state": "on" | "off" as state}):
            return name, (state == "on",)
        case (("iris" | "gain" | "bright" | "aperture"), {"change": str(change)}):
            return f"{name}_{change}", ()
        case (("zoom" | "focus"), {"motion": 0}):
            return f"{name}_stop", ()
        case "zoom", {"motion": motion} if motion >= 0x20 and motion & 0xF <= 7:
            return ("zoom_in", "zoom_out")[motion >= 0x30], (motion & 0xF,)
        case "white_balance", {"mode": str(mode)}:
            return f"white_balance_{mode}", ()
        case "exposure", {"mode": "full_auto"}:
            return "exposure_full_auto", ()
        case "effect", {"effect": str(effect)}:
            return f"picture_effect_{'b_w' if effect == 'black_white' else effect}", ()
        case "memory", {"action": "set" | "recall" as action, "number": number}:
            return f"preset_{action}", (number,)
        case "drive", {"pan": str(pan), "tilt": str(tilt)}:
            return _drive(fields, pan, tilt)
        case (("home" | "reset" | "cancel"), _):
            return name, ()
    return None


def _drive(fields: Any, pan: str, tilt: str) -> tuple[str, tuple[Any, ...]] | None:
    speeds = (fields["pan_speed"], fields["tilt_speed"])
    if "stop" not in {pan, tilt}:
        return f"{pan}_{tilt}", speeds
    if pan == tilt == "stop":
        return ("stop", ()) if speeds == (_OTHER, _OTHER) else None
    moving, standing = speeds if tilt == "stop" else speeds[::-1]
    return (pan if tilt == "stop" else tilt, (moving,)) if standing == _OTHER else None


def build(record: Record) -> bytes | None:
    call = _call(record["message"].removesuffix(".request"), record["fields"])
    if call is None:
        return None
    sent = bytearray()
    camera = PTZ.__new__(PTZ)
    camera._output = SimpleNamespace(write=sent.extend)
    getattr(camera, call[0])(*call[1])
    assert sent[0] == 0x81
    return bytes((0x80 | record["master"] << 4 | record["node"],)) + sent[1:]


def read(wire: bytes, direction: Direction) -> Record | None:
    return None
