"""Second pass, values of the frame that conditions of fields may test."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

from qlinkgen.model.fields import Value
from qlinkgen.model.frame import DelimitedFrame, OneFrame
from qlinkgen.model.message import Direction


@dataclass(frozen=True, slots=True)
class FrameValues:
    """Values of the frame of a message, by name.

    Attributes:
        known: those that a condition may test.
        barred: why it may not test others, and the fix.
    """

    known: Mapping[str, Value] = field(default_factory=dict)
    barred: Mapping[str, tuple[str, str]] = field(default_factory=dict)


def frame_values(
    frame: OneFrame | None,
    direction: Direction,
    settled: Collection[str],
    *,
    several: bool,
    separated: bool,
) -> FrameValues:
    """The values of the frame of a message, which fixes those ``settled``.

    ``several``: there are several kinds of frame; ``separated``: the message has separators.
    """
    if not isinstance(frame, DelimitedFrame):
        return FrameValues()
    own = frame.towards(direction)
    deciding = {value.name: value for value in own.deciding}
    barred: dict[str, tuple[str, str]] = {}
    for value in own.values:
        name = value.name
        if several:
            barred[name] = f"{name} is a value of several kinds of frame", "test a field of the message"
        elif separated:
            barred[name] = f"separators, not {name}, tell which fields are present", "write optional: true"
        elif name in settled:
            barred[name] = f"the id of the message fixes {name}", "remove the condition"
        elif not own.tells_end:
            why = f"{name} is a value of the frame, which has neither a length nor a terminator"
            barred[name] = why, "give it one, or test a field of the message"
        elif name not in deciding:
            why = f"{name} is a value that the runtime fills, or that only some frames have"
            barred[name] = why, "test another value, or a field of the message"
    return FrameValues({name: each for name, each in deciding.items() if name not in barred}, barred)
