"""Second pass, message ids that are texts of several lengths: the beginnings of payloads.

The payload of each message begins with its id as a constant. So lengths and check values cover both, and a
receiver finds the message by the longest id that a payload begins with.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

from qlinkgen.model.fields import Field
from qlinkgen.model.frame import ATTRIBUTE, DelimitedFrame, Frame, Opening, Part
from qlinkgen.model.message import Message
from qlinkgen.model.types import Constant, Scalar
from qlinkgen.model.words import Words, cased
from qlinkgen.schema.file_frames import Codings, PartSpec
from qlinkgen.schema.notation import shown
from qlinkgen.schema.report import Reporter
from qlinkgen.schema.source import Path
from qlinkgen.schema.terminators import bytes_in

#: Maximum number of characters of an id.
MAX_CHARACTERS = 40
_RULE = "bad-text-id"
_RANGE = re.compile(r"text\s*\[\s*(0|[1-9][0-9]?)\s*\.\.\s*([1-9][0-9]?)\s*\]\Z", re.ASCII)
_WORD_BITS = 8


def bounds_of(spec: PartSpec) -> tuple[int, int] | None:
    """Minimum and maximum number of characters of an id such as ``text[1..8]``, None for other parts."""
    match = _RANGE.match(spec.type or "") if spec.told == "message" else None
    return (int(match[1]), int(match[2])) if match else None


def without_text_id(
    specs: Mapping[str, PartSpec], path: Path, report: Reporter
) -> tuple[Mapping[str, PartSpec], str]:
    """The parts without an id of several lengths, which the payload begins with, and its name or ""."""
    name = next((each for each, spec in specs.items() if bounds_of(spec)), "")
    payload = next((each for each, spec in specs.items() if spec.told == "payload"), "")
    if not name or not payload:
        return specs, ""
    _check_place(specs, name, payload, path, report)
    merged = {}
    for each, spec in specs.items():
        lists = {key: found for key in ("counts", "over") if (found := getattr(spec, key)) and name in found}
        for key, found in lists.items():
            if payload not in found:
                what = f"{each} covers {name} without {payload}, which begins with it"
                report.error(_RULE, (*path, each, key), what, f"name {payload} too, or not {name}")
        # In place of the id alone the payload is covered, so that no other error follows.
        fewer = {
            key: [part for part in found if part != name] if payload in found else [payload]
            for key, found in lists.items()
        }
        merged[each] = spec.model_copy(update=fewer)
    return {each: spec for each, spec in merged.items() if each != name}, name


def _check_place(
    specs: Mapping[str, PartSpec], name: str, payload: str, path: Path, report: Reporter
) -> None:
    names, (least, most) = list(specs), bounds_of(specs[name]) or (0, 0)
    others = [each for each, spec in specs.items() if spec.told == "message" and each != name]
    others += [
        bits.role
        for spec in specs.values()
        for bits in (spec.bits or {}).values()
        if bits.role in ("message", "direction")
    ]
    others += [each for each, spec in specs.items() if spec.told == "direction"]
    half = [
        each
        for each, spec in specs.items()
        if payload in (*(spec.counts or ()), *(spec.over or ()))
        and name not in (*(spec.counts or ()), *(spec.over or ()))
    ]
    ended = any(spec.told in ("length", "terminator") or spec.alone for spec in specs.values())
    spec = specs[name]
    wrong = [
        (least >= most or most > MAX_CHARACTERS, f"{name} has {least} to {most} characters",
         f"write text[1..8], at most {MAX_CHARACTERS}, or text[8] for ids of one length"),
        (path[0] == "frames", f"{name} has several lengths in one of several kinds of frame",
         "let the kind begin with the id as a constant, or give ids one length"),
        (bool(others), f"{name} has several lengths, and {', '.join(map(str, others))} is in the id too",
         "give ids one length, or remove the other piece"),
        (names.index(payload) != names.index(name) + 1, f"{payload} does not follow {name}",
         f"move {name} before {payload}, or give ids one length"),
        (not ended, f"nothing but the message tells the end of a frame whose {name} has several lengths",
         "give the frame a length or a terminator, or give ids one length"),
        (specs[payload].trim is not None, "zeros at the end of a text are not left out", "remove trim"),
        (spec.when is not None, f"{name} is in frames of one direction alone",
         'remove if; an answer without an id has id: ""'),
        (any(over.startswith(ATTRIBUTE) for each in specs.values() for over in each.over or ()),
         f"a check value covers an attribute of a message whose {name} has several lengths",
         "cover no attribute, or give ids one length"),
        (bool(half), f"{', '.join(half)} covers {payload} without {name}, which it begins with",
         f"name {name} too"),
    ]  # fmt: skip
    for is_wrong, what, hint in wrong:
        if is_wrong:
            report.error(_RULE, (*path, name), what, hint, of_key=True)
            return


def coding_without(given: Codings | None, name: str) -> Codings | None:
    """The coding of a frame whose payload begins with an id, which is coded where the payload is."""
    if not name or given is None:
        return given
    several = given if isinstance(given, list) else [given]
    found = [
        each.model_copy(update={"over": each.over and [part for part in each.over if part != name]})
        for each in several
    ]
    return found if isinstance(given, list) else found[0]


def with_text_id(parts: Sequence[Part], name: str, spec: PartSpec | None) -> tuple[Part, ...]:
    """The parts; the payload begins with an id of this name."""
    bounds = bounds_of(spec) if spec else None
    if bounds is None:
        return tuple(parts)
    least, most = bounds
    opening = Opening(name, least, most, folded=bool(spec and spec.ignore_case))
    return tuple(
        replace(part, opening=opening, min_size=part.min_size + least, max_size=part.max_size + most)
        if part.role == "payload"
        else part
        for part in parts
    )


class TextIds:
    """Numbers ids that are texts in their order in the file."""

    def __init__(self, opening: Opening, report: Reporter) -> None:
        """``opening`` is the id of the frame."""
        self.name = opening.name
        self._opening = opening
        self._report = report
        self._texts: list[str] = []

    def number(self, given: object, path: Path) -> int:
        """The number of an id as written."""
        name, least, most = self._opening.name, self._opening.least, self._opening.most
        what, hint = "", f"write {least} to {most} ASCII characters without blanks"
        if not isinstance(given, str):
            what, hint = f"{name} {shown(given)} is not text", f'quote it: "{given}"'
        elif not least <= len(given) <= most:
            what = f"{name} {shown(given)} has {len(given)} characters"
        elif " " in given:
            what = f"{name} {shown(given)} contains a blank"
        elif not given.isascii() or not given.isprintable():
            what = f"{name} {shown(given)} has characters that are not printable ASCII"
        if what:
            self._report.error("id-does-not-fit", path, what, hint, needs=(path, ("frame",)))
            self._texts.append("?" * most)
            return len(self._texts) - 1
        text, known = str(given), self._texts
        if self._opening.folded:
            text, known = text.upper(), [each.upper() for each in self._texts]
        if text not in known:
            self._texts.append(str(given))
            return len(self._texts) - 1
        return known.index(text)

    def text(self, number: int) -> bytes:
        """The id with a number."""
        return self._texts[number].encode("ascii", "replace")


class Opener:
    """Puts the id of a message at the beginning of its payload."""

    def __init__(self, frame: Frame | None, report: Reporter) -> None:
        """``frame`` is None if it could not be built."""
        payload = frame.payload if isinstance(frame, DelimitedFrame) else None
        self.name = payload.opening.name if payload and payload.opening else ""
        self._folded = bool(payload and payload.opening and payload.opening.folded)
        self._report = report

    def opened(self, message: Message, text: bytes, path: Path) -> Message:
        """A message whose payload begins with its id; ``path`` is that of its fields."""
        message = replace(message, text=text, folded=self._folded)
        if message.empty_is_default:
            what = f"an empty {message.name} has no {self.name}"
            place, needs = (*path[:-1], "empty_request"), (path, ("frame",))
            self._report.error(_RULE, place, what, "remove empty_request", of_key=True, needs=needs)
            message = replace(message, empty_is_default=False)
        if not text:
            return message
        if message.separator and message.separator in text:
            what = f"the id {shown(text.decode())} contains the separator of {message.name}"
            needs = (path, ("frame",))
            self._report.error(_RULE, (*path[:-1], "separator"), what, "use another separator", needs=needs)
        taken = {name for field in message.fields for name in (field.name, field.slot)}
        taken |= {value.name for value in message.values}
        name = self.name
        while name in taken:
            name += "_"
        # No enum is called so.
        words = Words(f"{message.id}_{self.name}", (text,), self._folded)
        constant = Scalar(bits=_WORD_BITS, chunks=(), text=words, minimum=0, maximum=0, role=Constant())
        field = Field(name, constant, "Message id")
        return replace(message, fields=(field, *message.fields), leading=False)


def check_text_ids(messages: Sequence[Message], places: Mapping[str, Path], report: Reporter) -> None:
    """Check that no id and payload can be taken for a longer id; ``places`` state the id of each message."""
    known = [
        (each, each.text.upper() if each.folded else each.text) for each in messages if each.text is not None
    ]
    for one, text in known:
        for other, longer in known:
            apart = {one.direction, other.direction} == {"request", "response"}
            if apart or text == longer or not longer.startswith(text):
                continue
            if _may_begin(one, longer[len(text) :]):
                what = f"{one.name} with the id {shown(text.decode())} can begin like {other.name}, "
                what += f"{shown(longer.decode())}"
                hint = "use another id, or a separator before the fields"
                needs = (places[one.name], places[other.name])
                report.error(_RULE, places[other.name], what, hint, needs=needs)


def _may_begin(message: Message, rest: bytes) -> bool:
    """Whether the payload of a message may have these bytes after its id."""
    if message.max_size - len(message.text or b"") < len(rest):
        return False
    fields = message.fields[bool(message.text) :]
    if message.separator and message.text:
        return message.separator in cased((rest[:1],), folded=message.folded)
    first: set[int] = {*message.separator} if message.separator else set()
    for field in fields:
        first |= bytes_in(field)
        if field.min_size:
            break
    return not first.isdisjoint(b"".join(cased((rest[:1],), folded=message.folded)))
