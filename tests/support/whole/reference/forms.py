"""Replies that a value picks: the fields of another form of a response."""

from __future__ import annotations

from typing import Any

from tests.support.whole.reference.document import long_form
from tests.support.whole.reference.notation import Doc


def with_forms(data: Doc) -> Doc:
    """A file whose responses have the fields of both forms, each with its condition."""
    commands = {name: _joined(spec, data) for name, spec in data.get("commands", {}).items()}
    return {**data, "commands": commands} if "commands" in data else data


def _joined(spec: Doc, data: Doc) -> Doc:
    response: Any = spec.get("response")
    ways = [name for name, part in data.get("frame", {}).get("parts", {}).items() if "direction" in str(part)]
    forms = {
        name: reply
        for name, reply in spec.get("replies", {}).items()
        if "if" in reply and not {*reply["if"]} & {"way", *ways} and isinstance(response, dict)
    }
    for name, reply in forms.items():
        ((value, wanted),) = reply["if"].items()
        stated = long_form(response)
        fields: Doc = stated["fields"]
        own = {each: _with(kind, {value: _reverse(wanted)}) for each, kind in fields.items()}
        other = {each: _with(kind, {value: wanted}) for each, kind in reply["fields"].items()}
        both = {**own, **other}
        response = {**stated, "fields": both}
        spec = {**spec, "replies": {key: each for key, each in spec["replies"].items() if key != name}}
    return {**spec, "response": response} if forms else spec


def _with(kind: Any, test: Doc) -> Doc:
    return {**(kind if isinstance(kind, dict) else {"type": kind}), "if": test}


def _reverse(wanted: object) -> object:
    text = str(wanted)
    return text.removeprefix("not ") if text.startswith("not ") else f"not {text}"
