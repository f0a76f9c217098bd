"""Message ids of several lengths: the beginnings of payloads."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from tests.support.whole.reference.layouts import Message, Number, Slot
from tests.support.whole.reference.notation import Doc, part_doc, whole_span


def opened(document: Doc) -> None:
    """Let the payload of frames have room for the id, and lengths and check values cover both together."""
    frame = document.get("frame", {})
    parts: Doc = frame.get("parts", {})
    specs = {name: part_doc(spec) for name, spec in parts.items()}
    name = next((name for name, spec in specs.items() if _is_opening(spec)), "")
    if not name:
        return
    low, high = whole_span(specs[name]["type"][5:-1])
    frame["opening"], frame["texts"] = name, []
    frame["any_case"] = specs[name].get("ignore_case", False)
    for each, spec in specs.items():
        if spec["role"] == "payload":
            least, most = whole_span(spec["size"])
            parts[each] = {**spec, "size": f"{least + low}..{most + high}"}
            frame["stated"] = most
        for key in {"over", "counts"} & spec.keys():
            given = [spec[key]] if isinstance(spec[key], str) else spec[key]
            parts[each] = {**spec, key: [part for part in given if part != name]}
    del parts[name]


def _is_opening(spec: Doc) -> bool:
    varies = re.fullmatch(r"text\[\d+\.\.\d+\]", str(spec.get("type"))) is not None
    return varies and spec["role"] == "message"


def number_of(frame: Doc, given: Any) -> int:
    """The number of an id: its place among those read before."""
    text = given[frame["opening"]] if isinstance(given, dict) else given
    if text not in frame["texts"]:
        frame["texts"].append(text)
    return int(frame["texts"].index(text))


def begun(document: Doc, message: Message) -> Message:
    """A message whose payload begins with its id."""
    frame = document["frame"]
    if "opening" not in frame:
        return message
    text, name = frame["texts"][message.number].encode(), frame["opening"]
    if not text:
        return message
    taken = {slot.name for slot in message.slots}
    while name in taken:
        name += "_"
    pieces, any_case = ((0, 8),) * len(text), frame["any_case"]
    number = Number(8, False, pieces, 0, 0, words=(text,), any_case=any_case)
    slot = Slot(name, number, "constant")
    return replace(message, slots=(slot, *message.slots), leading=False)


def texts_of(document: Doc, messages: Iterable[Message]) -> dict[bytes, int]:
    """The numbers of the ids of messages."""
    texts = document["frame"].get("texts", [])
    return {texts[each.number].encode(): each.number for each in messages} if texts else {}


def longest(texts: dict[bytes, int], payload: bytes, *, any_case: bool) -> int:
    """The number of the longest id that a payload begins with, -1 if it has none."""
    begun = [
        text
        for text in texts
        if payload.startswith(text) or (any_case and payload.lower().startswith(text.lower()))
    ]
    return texts[max(begun, key=len)] if begun else -1
