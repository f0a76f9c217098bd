"""Answers that only their request tells apart, and the message that carries all of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tests.support.whole.reference.document import before_end, long_form
from tests.support.whole.reference.fields import Fields
from tests.support.whole.reference.layouts import Message
from tests.support.whole.reference.notation import Doc
from tests.support.whole.reference.text_ids import begun, texts_of

CARRIER = "unasked"


@dataclass(frozen=True, slots=True)
class Asked:
    """The answers to each request in the order of trial, by its name; and what carries them."""

    answers: Mapping[str, Sequence[Message]]
    carrier: Message
    #: The id that all of them begin with, b"" if other parts hold it.
    text: bytes = b""

    @property
    def names(self) -> set[str]:
        """The names of all answers."""
        return {each.name for answers in self.answers.values() for each in answers}

    def payload(self, values: Mapping[str, Any]) -> bytes:
        """The payload that the carrier carries."""
        return self.text + bytes(values.get("data", b""))


def asked(document: Doc, fields: Fields, messages: Sequence[Message]) -> Asked | None:
    """The answers with the number that the defaults state, or in a frame without numbers."""
    free = set(document.get("messages", {}))
    free |= {name for name, spec in document.get("commands", {}).items() if "steps" in spec}
    answers = [m for m in messages if m.direction == "response" and m.name.partition(".")[0] not in free]
    parts = document["frame"].get("parts", {})
    if not parts:
        return None
    numbers = {each.number for each in answers if _states(document, each)}
    found = [each for each in answers if each.number in numbers]
    if len(found) < 2:
        return None
    by_request = {
        f"{name}.request": [each for each in found if each.name in _names(document, name)]
        for name in document.get("commands", {})
    }
    ordered = {
        request: sorted(each, key=lambda answer: not answer.name.endswith(".response"))
        for request, each in by_request.items()
        if each
    }
    low, high = min(each.sizes[0] for each in found), max(each.sizes[1] for each in found)
    text = next(iter(texts_of(document, found[:1])), b"")
    low, high = low - len(text), high - len(text)
    ended = any(isinstance(spec, dict) and spec.get("role") == "terminator" for spec in parts.values())
    kind = "text" if ended and "coding" not in document["frame"] else "bytes"
    slots = fields.build(
        {"data": f"{kind}[{low}..{high}]" if low < high else f"{kind}[{high}]"} if high else {}
    )
    first = found[0]
    carrier = Message(CARRIER, first.number, "response", slots, first.addresses, first.default_address)
    return Asked(ordered, begun(document, before_end(carrier, document)), text)


def _states(document: Doc, answer: Message) -> bool:
    """Whether the number of an answer is that of the defaults."""
    common = document.get("defaults", {}).get("response")
    if not isinstance(common, dict) or "id" not in common or str(common["id"]).startswith("request"):
        return False
    name, _, part = answer.name.partition(".")
    own = document.get("commands", {}).get(name, {}).get("response")
    return part == "response" and "id" not in long_form({} if own is None else own)


def _names(document: Doc, command: str) -> set[str]:
    """The names that the answers to a command may have."""
    own = document.get("commands", {})[command].get("replies", {})
    common = [name for name in document.get("replies", {}) if name not in own]
    return {f"{command}.response", *common, *(f"{command}.{name}" for name in (*common, *own))}
