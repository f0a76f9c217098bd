"""The frame of a schema whose source describes messages alone."""

from __future__ import annotations

from qlinkgen.importers.document import Block, Commented, Value, between

#: The reason of `confirmed: false`, for the reader of the schema.
UNKNOWN = (
    "{source} does not describe the frame. These parts are an assumption: replace them by those of the "
    "protocol, then remove `confirmed: false`."
)


def assumed(source: str, largest: int, messages: int) -> Value:
    """A frame of number, length and payload, which lint reports as unconfirmed.

    Args:
        source: What does not describe the frame, for the comment.
        largest: Size of the largest payload in bytes.
        messages: The greatest number of a message.
    """
    parts: dict[str, Value] = {
        "number": {"role": "message", "type": "u8" if messages <= 0xFF else "u16"},
        "length": {"type": "u8" if largest <= 0xFF else "u16", "counts": ["data"]},
        "data": {"role": "payload", "size": between(0, largest)},
    }
    return Commented(UNKNOWN.format(source=source), Block({"confirmed": False, "parts": Block(parts)}))
