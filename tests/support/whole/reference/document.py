"""The messages of a schema file."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from tests.support.whole.reference import text_ids
from tests.support.whole.reference.fields import Fields, bits_of
from tests.support.whole.reference.layouts import Message, Number, Run, Slot
from tests.support.whole.reference.notation import Direction, Doc, as_doc, octets, of_way, whole_span


def numbered(document: Doc, given: Any, direction: str) -> int:
    """The number of a message: the direction or another value of its part, then the pieces of its id."""
    number = 0
    parts = document["frame"].get("parts", {})
    if not parts:
        return int(given)
    if "opening" in document["frame"]:
        return text_ids.number_of(document["frame"], given)
    own = {name: as_doc(of_way(spec, direction)) for name, spec in parts.items()}
    pieces = [(name, each) for name, spec in own.items() for each in bits_of(spec)]
    for wanted in ("direction", "message"):
        for part, (inner, role, _, bits, spec) in pieces:
            if role == wanted:
                name = inner or part
                values = spec.get("values", {}).get(direction) if role == "direction" else given
                alone = 0 if "if" in spec else values  # one that only one direction has may be left out
                value = values.get(name, 0) if isinstance(values, dict) else alone
                value = int.from_bytes(value.encode("ascii"), "big") if isinstance(value, str) else value
                number = number << bits | value
    return number


def settled(document: Doc, message: Message) -> Mapping[str, int]:
    """The values of its frame that a message states beside its id."""
    command, _, part = message.name.partition(".")
    spec: Doc = document.get("commands", {}).get(command, {})
    replies = {**document.get("replies", {}), **spec.get("replies", {})}
    given: Any = None
    if part == "request":
        given = spec.get("id")
    elif part == "response":
        defaults = document.get("defaults", {})
        given = answer(spec.get("response"), defaults.get("response")).get("id")
    elif part in replies or (not part and command in replies and not spec):
        given = replies[part or command].get("id")
    elif not part:
        given = document.get("messages", {}).get(command, {}).get("id")
    pieces = [
        (name, each) for name, part in document["frame"].get("parts", {}).items() for each in bits_of(part)
    ]
    ids = {inner or name for name, (inner, role, *_) in pieces if role in ("message", "direction")}
    ids.add(document["frame"].get("opening"))
    return {name: each for name, each in given.items() if name not in ids} if isinstance(given, dict) else {}


def seeds(document: Doc, message: str) -> Mapping[str, bytes]:
    """The bytes of the numeric attributes of a message."""
    name = message.partition(".")[0]
    given = dict(document.get("defaults", {}).get("attributes", {}))
    given |= document.get("commands", {}).get(name, {}).get("attributes", {})
    if name in document.get("messages", {}):
        given = document["messages"][name].get("attributes", {})
    found = {}
    for each, spec in document.get("attributes", {}).items():
        if "type" in spec and each in given:
            order = document.get("byteorder", "big")
            found[f"attribute.{each}"] = given[each].to_bytes(int(spec["type"][1:]) // 8, order)
    return found


def messages(document: Doc, fields: Fields, addressed: bool) -> tuple[Message, ...]:
    """All messages of a file, in order."""
    found = (with_separator(each, document) for each in _messages(document, fields, addressed))
    return tuple(text_ids.begun(document, each) for each in found)


def with_separator(message: Message, document: Doc) -> Message:
    """A message with the text that its schema puts between its values."""
    name, _, reply = message.name.partition(".")
    usual = document.get("defaults", {}).get("separator")
    places = [document.get("messages", {}).get(name), document.get("commands", {}).get(name)]
    if reply not in ("", "request", "response"):
        own = document["commands"][name].get("replies", {})
        found = own.get(reply) or document.get("replies", {}).get(reply)
        places = [found or _step(document["commands"][name], reply) or document["commands"][name]]
    elif not any(places):
        places = [document["replies"][name]]
    spec = next(each for each in places if each)
    chosen = spec.get("separator", usual)
    if reply == "response":
        common = long_form(document.get("defaults", {}).get("response") or {})
        own = long_form(spec.get("response") or {})
        chosen = own.get("separator", spec.get("separator", common.get("separator", usual)))
    if chosen in (None, "none") or not message.slots:
        return before_end(message, document)
    leading = isinstance(chosen, dict)
    chosen = chosen["before"] if isinstance(chosen, dict) else chosen
    ends = [each for each in document["frame"]["parts"].values() if isinstance(each, dict)]
    ends = [each for each in ends if each.get("role") == "terminator"]
    end = b"".join(each["text"].encode() if "text" in each else octets(each["value"]) for each in ends)
    barred = chosen.encode() + end
    slots = tuple(_filled(slot, barred) for slot in message.slots)
    return replace(message, slots=slots, separator=chosen.encode(), leading=leading, barred=barred)


def _step(command: Doc, name: str) -> Doc | None:
    """The frame of a step with a separator of its own; others have that of their command."""
    for index, step in enumerate(command.get("steps", []), 1):
        given = step.get("send", step.get("receive"))
        if step.get("name", f"step_{index}") == name and isinstance(given, dict) and "separator" in given:
            return given
    return None


def before_end(message: Message, document: Doc) -> Message:
    """A message whose texts do not have the bytes that end the frame, unless a coding hides them."""
    parts = document["frame"].get("parts", {})
    ends = [each for each in parts.values() if isinstance(each, dict) and each.get("role") == "terminator"]
    end = b"".join(each["text"].encode() if "text" in each else octets(each["value"]) for each in ends)
    if "coding" in document["frame"] or not end.isascii():
        return message
    return replace(message, slots=tuple(_filled(slot, end) for slot in message.slots), barred=end)


def _filled(slot: Slot, barred: bytes) -> Slot:
    """A text that needs a value, which is made up of a legal character."""
    kind = slot.kind
    if not isinstance(kind, Run) or kind.default != (ord(" "),) * kind.low:
        return slot
    fill = next(each for each in b" 0x_" if each not in barred)
    return replace(slot, kind=replace(kind, default=(fill,) * kind.low))


def _messages(document: Doc, fields: Fields, addressed: bool) -> tuple[Message, ...]:
    found: list[Message] = []
    for name, spec in document.get("commands", {}).items():
        defaults = document.get("defaults", {})
        merged = {**defaults, **spec, "response": answer(spec.get("response"), defaults.get("response"))}
        found += of_command(name, merged, document, fields, addressed)
        found += steps(name, merged, lambda _kind: (document, fields, addressed))
        found += _replies(name, merged, document, fields, {each.name for each in found}, addressed=addressed)
    for name, spec in document.get("messages", {}).items():
        found.append(single(name, spec, document, fields, addressed))
    return tuple(replace(each, limit=fields.most) for each in found)


def single(name: str, spec: Doc, document: Doc, fields: Fields, addressed: bool) -> Message:
    """A message that is not part of a command."""
    nodes = _nodes(document) if addressed else None
    direction = _sent(document, spec)
    return Message(
        name,
        numbered(document, spec.get("id"), direction),
        direction,
        fields.build(spec["fields"]),
        (nodes,) if nodes else (),
        nodes[0] if nodes else 0,
        checked=_checked(document, name),
    )


def _sent(document: Doc, spec: Doc) -> Direction:
    """The direction of a message outside of commands."""
    direction: Direction = spec.get("direction", "message")
    if "from" in spec:
        direction = "response" if document["bus"]["sides"].index(spec["from"]) else "request"
    return direction


def of_command(  # noqa: PLR0917  # what the reference reads
    name: str,
    spec: Doc,
    document: Doc,
    fields: Fields,
    addressed: bool,
    directions: tuple[Direction, ...] = ("request", "response"),
) -> Iterator[Message]:
    """The messages of a command in some directions."""
    for direction in directions:
        if isinstance(spec[direction], str):  # none, or the name of a message
            continue
        if direction == "response" and not _responds(spec):
            continue
        ranges, default = (
            _addresses(spec.get("addressing", "node"), direction, document) if addressed else ((), 0)
        )
        empty = direction == "request" and spec.get("empty_request") == "defaults"
        number, written = spec.get("id"), spec[direction]
        if direction == "response":
            number, written = _number(document, written.get("id"), number), written["fields"]
        else:
            number = numbered(document, number, direction)
        asked = {value: number for slot in fields.build(spec["request"]) for value, number in _numbers(slot)}
        slots = fields.build({key: _sized_by(each, "request", asked) for key, each in written.items()})
        slots = tuple(_whole(slot, slots) for slot in slots)
        yield Message(
            f"{name}.{direction}",
            number,
            direction,
            slots,
            ranges,
            default,
            empty,
            _checked(document, name),
        )


def _responds(spec: Doc) -> bool:
    """Whether a command has a response of its own; a dialogue has one if a step names it."""
    return "steps" not in spec or any(step.get("receive") == "response" for step in spec["steps"])


def steps(name: str, spec: Doc, place: Callable[[str | None], tuple[Doc, Fields, bool]]) -> Iterator[Message]:
    """The messages of a dialogue that steps describe; `place` tells where those of a kind are built."""
    listed = spec.get("steps", [])
    last = max((index for index, step in enumerate(listed) if "receive" in step), default=None)
    for index, step in enumerate(listed):
        key = "send" if "send" in step else "receive"
        if isinstance(step[key], str):
            continue
        direction: Direction = "request" if key == "send" else "response"
        written = long_form(step[key])
        document, fields, addressed = place(written.get("frame"))
        nodes = (_nodes(document),) if addressed else ()
        number = _number(document, written.get("id"), spec.get("id"), direction)
        given = written["fields"]
        if index == last:
            frames = {"request": spec["request"]} | {
                each.get("name", f"step_{at + 1}"): long_form(each["send"])["fields"]
                for at, each in enumerate(listed[:index])
                if isinstance(each.get("send"), dict)
            }
            for frame, said in frames.items():
                asked = {value: each for slot in fields.build(said) for value, each in _numbers(slot)}
                given = {each: _sized_by(kind, frame, asked) for each, kind in given.items()}
        slots = fields.build(given)
        slots = tuple(_whole(slot, slots) for slot in slots) if index == last else slots
        full = f"{name}.{step.get('name', f'step_{index + 1}')}"
        default = nodes[0][0] if nodes else 0
        yield Message(full, number, direction, slots, nodes, default, checked=_checked(document, name))


def _numbers(slot: Slot) -> Iterator[tuple[str, Number]]:
    if isinstance(slot.kind, Number):
        yield slot.name, slot.kind


def _sized_by(spec: Any, frame: str, asked: Mapping[str, Number]) -> Any:
    """A field with the range of the field of an earlier frame that has its number of items."""
    text = spec.get("type", "") if isinstance(spec, dict) else spec
    if not (match := re.search(rf"\[{frame}\.(\w+)\]", text)):
        return spec
    number = asked[match[1]]
    low, high = (int(number.native(end)) for end in (number.low, number.high))
    text = text.replace(match[0], f"[{low}..{high}]")
    return {**spec, "type": text} if isinstance(spec, dict) else text


def _whole(slot: Slot, slots: Sequence[Slot]) -> Slot:
    """A row of bits whose bytes alone are counted has as many items as fit them."""
    kind = slot.kind
    counted = any(each.counts == slot.name and each.counts_in == "items" for each in slots)
    if not isinstance(kind, Run) or not kind.packed or kind.low == kind.most or counted:
        return slot
    return replace(slot, kind=replace(kind, high=kind.items_in(kind.bytes_of(kind.most))))


def answer(own: Any, common: Any) -> Any:
    """A response in its long form, or "none"."""
    given = common if own is None else own
    if isinstance(given, str):
        return given
    return {**long_form(common or {}), **({} if own is None else long_form(own))}


def long_form(given: Any) -> Doc:
    """A response in its long form, without any fields for a word."""
    if isinstance(given, str):
        return {}
    is_long = given.keys() <= {"id", "fields", "means", "frame", "separator"} and (
        isinstance(given.get("fields"), dict)
        or given.get("id") == ""
        or ("fields" not in given and re.match(r"[^a-z{]|request|{'\w+': \d", str(given.get("id", ""))))
    )
    return dict(given) if is_long else {"fields": given}


def _number(document: Doc, given: Any, asked: Any, direction: str = "response") -> int:
    """The number of an answer or a step; `given` is None if it is that of the request."""
    if given is not None and not str(given).startswith("request"):
        return numbered(document, given, direction)
    offset = str(given or "").replace(" ", "").removeprefix("request.id")
    return numbered(document, asked, direction) + int(offset or "0", 0)


def _relative(number: Any) -> bool:
    """Whether the id of an answer depends on that of the request."""
    return number is None or (isinstance(number, str) and number.startswith("request.id"))


def _replies(
    name: str, spec: Doc, document: Doc, fields: Fields, known: set[str], *, addressed: bool
) -> Iterator[Message]:
    """Answers other than the response; one with a number for all commands is one message."""
    own = spec.get("replies", {})
    common = {key: each for key, each in document.get("replies", {}).items() if key not in own}
    if spec["response"] == "none" and "steps" not in spec:
        return
    for key, reply in (*common.items(), *own.items()):
        shared = key in common and not _relative(reply.get("id"))
        full = key if shared else f"{name}.{key}"
        if full in known:
            continue
        nodes = (_nodes(document),) if addressed else ()
        way = next(iter(reply.get("if", {"": "response"}).values()))
        number = _number(document, reply.get("id"), spec.get("id"), way)
        slots = fields.build(reply["fields"])
        checked = _checked(document, key if shared else name)
        default = nodes[0][0] if nodes else 0
        yield Message(full, number, "response", slots, nodes, default, checked=checked)


def _checked(document: Doc, name: str) -> bool:
    only = (document["frame"].get("marked") or {}).get("checksum", {}).get("only")
    return only is None or name in only


def _nodes(document: Doc) -> tuple[int, int]:
    return whole_span(document["bus"]["nodes"])


def _addresses(
    addressing: str, direction: Direction, document: Doc
) -> tuple[tuple[tuple[int, int], ...], int]:
    nodes, everybody = _nodes(document), document["bus"].get("broadcast")
    if direction == "response" or addressing == "node":
        return (nodes,), nodes[0]
    if addressing == "broadcast":
        return ((everybody, everybody),), everybody
    return (nodes, (everybody, everybody)), nodes[0]
