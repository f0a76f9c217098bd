"""What every kind of frame has in common for the templates, and which templates it takes."""

from __future__ import annotations

from typing import Any

from qlinkgen.backends.python.frames_delimited import delimited_model, unique_model
from qlinkgen.backends.python.frames_other import marked_model, packet_model
from qlinkgen.model.frame import Checksum, DelimitedFrame, MarkedFrame
from qlinkgen.model.protocol import Protocol


def kind_of(protocol: Protocol, *, unique: bool) -> str:
    """Name of the templates for the protocol's kind of frame."""
    return "unique" if unique else protocol.frame.kind


def checksum_of(protocol: Protocol) -> Checksum | None:
    """The checksum of the protocol's frames."""
    if isinstance(protocol.frame, DelimitedFrame):
        part = protocol.frame.part("checksum")
        return part.checksum if part else None
    return protocol.frame.checksum


def measured(protocol: Protocol, *, unique: bool) -> bool:
    """The end of a message follows from its own fields."""
    frame = protocol.frame
    if isinstance(frame, DelimitedFrame):
        return not unique and frame.part("length") is None
    return not isinstance(frame, MarkedFrame)


def encoder_model(protocol: Protocol, *, unique: bool) -> dict[str, str]:
    """Name and parameters of the two methods that every class has of its own."""
    if isinstance(protocol.frame, DelimitedFrame):
        doc = "The whole frame as it is on the wire. Raises EncodeError."
        return {
            "encoder": "to_frame",
            "encoder_doc": doc,
            "parameters": "body: bytes" if unique else "frame: bytes",
        }
    doc = "The payload alone. Raises EncodeError."
    return {"encoder": "to_bytes", "encoder_doc": doc, "parameters": "payload: bytes"}


def directions(protocol: Protocol, wanted: tuple[str, ...]) -> list[dict[str, str]]:
    """Functions and tables for each direction that is decoded."""
    if protocol.directions == ("message",):
        return [
            {
                "function": "decode",
                "words": "",
                "name": "message",
                "classes": "_MESSAGES",
                "readers": "_READERS",
            }
        ]
    return [
        {
            "function": f"decode_{name}", "words": f"{name} ", "name": name,
            "classes": f"_{name.upper()}S", "readers": f"_{name.upper()}_READERS",
        }
        for name in protocol.directions
        if name in wanted
    ]  # fmt: skip


def direction_model(names: list[str]) -> dict[str, str]:
    """Annotation and default of a stream decoder's direction."""
    quoted = [f'"{name}"' for name in names]
    default = f" = {quoted[0]}" if len(names) == 1 else ""
    return {"direction_type": f"Literal[{', '.join(quoted)}]", "direction_default": default}


def model_of(
    protocol: Protocol, sizes: list[int], prefix: str, rows: dict[str, list[dict[str, str]]], *, unique: bool
) -> dict[str, Any]:
    """Everything that the templates of the protocol's kind of frame need."""
    if unique:
        return unique_model(protocol, sizes, prefix)
    if isinstance(protocol.frame, DelimitedFrame):
        return delimited_model(protocol)
    if isinstance(protocol.frame, MarkedFrame):
        return marked_model(protocol)
    return packet_model(protocol, rows)
