"""Second pass: the reply of a slave to a request with a number that it does not know."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from qlinkgen.model.frame import DelimitedFrame, Frame
from qlinkgen.model.message import Message
from qlinkgen.model.transaction import Command, Unknown
from qlinkgen.model.types import Enum, Scalar
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.kinds import NumberOrName
from qlinkgen.schema.notation import AnswerId, shown
from qlinkgen.schema.report import Reporter, did_you_mean, listed
from qlinkgen.schema.source import Path

_RULE = "bad-reply"
_PATH: Path = ("to_unknown",)


class UnknownBuilder:
    """Builds the reply of one file."""

    def __init__(
        self, file: SchemaFile, report: Reporter, frame: Frame | None, commands: Sequence[Command]
    ) -> None:
        """``frame`` is None if it could not be built; checks that depend on it are skipped."""
        self._file = file
        self._report = report
        self._frame = frame
        self._commands = commands

    def build(self) -> Unknown | None:
        """The reply, None if the file states none or a wrong one."""
        given = self._file.to_unknown
        if not given:
            return None
        if len(given) != 1:
            self._error(_PATH, f"{len(given)} replies answer an unknown request", "name one of the replies")
            return None
        [(name, values)] = given.items()
        spec = self._file.replies.get(name)
        if spec is None:
            hint = did_you_mean(name, self._file.replies, "name one of the replies of the whole file")
            self._error((*_PATH, name), f"the file has no reply {shown(name)}", hint)
            return None
        found = [each for command in self._commands for each in command.replies if each.name == name]
        common = [each for each in found if each.message.name in (name, f"{each.message.command}.{name}")]
        if not common:
            self._error((*_PATH, name), f"no command has the reply {name}", "remove it, or name another one")
            return None
        message, number = common[0].message, spec.id if spec.id is not None else AnswerId(0, relative=True)
        if not self._tells(name) or not self._holds(message, name):
            return None
        raws = self._raws(message, values, (*_PATH, name))
        added = number.number if number.relative and isinstance(number.number, int) else None
        return Unknown(message, added, raws)

    def _error(self, path: Path, what: str, hint: str) -> None:
        self._report.error(_RULE, path, what, hint, of_key=True, needs=(path, ("frame",), ("replies",)))

    def _tells(self, name: str) -> bool:
        """Whether a receiver can tell an unknown request, and reply to it."""
        frame = self._frame
        if not isinstance(frame, DelimitedFrame):
            self._error((*_PATH, name), "only a frame of parts has replies", "remove it")
            return False
        numbers = [part for part in frame.parts if part.role == "message"]
        derived = {part.derivation.of for part in frame.parts if part.derivation is not None}
        if len(frame.id_bits) != 1 or len(numbers) != 1 or numbers[0].name in derived:
            what = "the message id of the frame is not one part of its own"
            self._error((*_PATH, name), what, "remove it; the program refuses unknown requests itself")
            return False
        if frame.attributes or not any(part.checksum for part in frame.parts):
            why = "its check value depends on the message" if frame.attributes else "it has no check value"
            what = f"a receiver cannot tell an unknown request from a damaged one: {why}"
            self._error((*_PATH, name), what, "remove it; such a request is not answered")
            return False
        ended = frame.tells_end
        if not (ended and frame.preamble) and (frame.idle is None or frame.idle.broken):
            what = f"{'where an unknown request begins' if ended else 'the end of one'} is not known"
            hint = "add a part with role: idle, if a silence ends frames, or remove it"
            self._error((*_PATH, name), what, hint)
            return False
        return True

    def _holds(self, message: Message, name: str) -> bool:
        if message.settled:
            what = f"{message.name} has a fixed {message.settled[0][0]}"
            self._error((*_PATH, name), what, "name a reply without one")
        if message.echoes:
            what = f"{message.echoes[0]} repeats the request, which is not known"
            self._error((*_PATH, name), what, "name a reply without an echo")
        return not message.echoes

    def _raws(
        self, message: Message, values: Mapping[str, NumberOrName], path: Path
    ) -> tuple[tuple[str, int], ...]:
        """The raw numbers of the values that are stated; the others have their defaults."""
        known = {value.name: value for value in message.values}
        found = []
        for name, given in values.items():
            place = (*path, name)
            value = known.get(name)
            if value is None:
                hint = did_you_mean(name, known, f"its fields are {listed(known)}")
                self._error(place, f"{message.name} has no field {shown(name)}", hint)
                continue
            raw = _raw(value.type, given) if isinstance(value.type, Scalar) else None
            if raw is None or value.field.conditional:
                what = f"{shown(given)} is not a number of {name}"
                self._error(place, what, "write a whole number in its range, or a name of its enum")
                continue
            found.append((name, raw))
        for name, value in known.items():
            if value.required and name not in values:
                self._error(path, f"{name} has no default", f"add {name}: its value")
        return tuple(found)


def _raw(kind: Scalar, given: NumberOrName) -> int | None:
    """The raw number of a value as written, None if it has none."""
    if kind.scaling is not None or not (kind.meaning is None or isinstance(kind.meaning, Enum)):
        return None
    if isinstance(kind.meaning, Enum) and isinstance(given, str):
        return next((each.value for each in kind.meaning.members if each.name == given), None)
    if isinstance(given, int) and not isinstance(given, bool) and kind.minimum <= given <= kind.maximum:
        return int(given)
    return None
