"""First pass, proofs of a kind of frame: a check value over the request with which its responses end.

Written as a part of the kind, beside its payload, it is the last field of each of these responses.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from qlinkgen.schema.file_commands import CommandSpec, StepMessageSpec, StepSpec
from qlinkgen.schema.file_fields import Fields, FieldSpec
from qlinkgen.schema.file_frames import PartSpec
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.kind_names import response_kind, step_kind
from qlinkgen.schema.notation import REPEATED

#: Keys of the part that the field has.
_KEYS = ("type", "byteorder", "algorithm", "init", "as_", "doc", "section", "confirmed")
_WIDTH = re.compile(r"u([0-9]{1,3})\Z", re.ASCII)


@dataclass(frozen=True, slots=True)
class _Shared:
    """The check value of a kind: its name, the part, and the name of the payload that it may cover."""

    name: str
    part: PartSpec
    payload: str

    def added(self, fields: Fields) -> Fields:
        """The fields of a response with the check value."""
        own = list(dict.fromkeys(each.case.slot if each.case else name for name, each in fields.items()))
        over = [part for each in self.part.over or () for part in (own if each == self.payload else [each])]
        given = {key: getattr(self.part, key) for key in _KEYS if key in self.part.model_fields_set}
        return {**fields, self.name: FieldSpec.model_construct({*given, "over"}, **given, over=over)}


def with_shared_proofs(file: SchemaFile) -> SchemaFile:
    """The file, where a check value over the request is a field of responses, not a part of their kind."""
    found = {name: shared for name, kind in file.frames.items() if (shared := _shared(kind.parts or {}))}
    if not found:
        return file
    frames = dict(file.frames)
    for name, shared in found.items():
        parts = {key: part for key, part in frames[name].parts.items() if key != shared.name}
        parts[shared.payload] = _longer(parts[shared.payload], shared.part)
        frames[name] = frames[name].model_copy(update={"parts": parts})
    commands = {name: _command(file, spec, found) for name, spec in file.commands.items()}
    return file.model_copy(update={"frames": frames, "commands": commands})


def _shared(parts: Mapping[str, PartSpec]) -> _Shared | None:
    """The check value of a kind that consists of it and the payload before it."""
    if len(parts) != 2:  # the payload and the check value
        return None
    (payload, first), (name, last) = parts.items()
    covers = last.algorithm is not None and any(map(REPEATED.match, last.over or ()))
    return _Shared(name, last, payload) if first.role == "payload" and covers else None


def _longer(payload: PartSpec, check: PartSpec) -> PartSpec:
    """The payload with room for the check value."""
    width, size = _WIDTH.match(check.type or ""), payload.size
    if width is None or size is None:
        return payload
    more = int(width[1]) // 8
    return payload.model_copy(update={"size": (size[0] + more, size[1] + more)})


def _command(file: SchemaFile, spec: CommandSpec, found: Mapping[str, _Shared]) -> CommandSpec:
    """A command, the responses of which have the check value of their kind."""
    if spec.steps is not None:
        return spec.model_copy(update={"steps": [_step(file, spec, each, found) for each in spec.steps]})
    own, common = spec.response, file.defaults.response
    given = common if own is None else own
    shared = found.get(response_kind(file, spec) or "")
    if shared is None or given is None or isinstance(given, str):
        return spec
    if isinstance(given, dict):
        return spec.model_copy(update={"response": shared.added(given)})
    if given.fields is None:
        return spec
    return spec.model_copy(
        update={"response": given.model_copy(update={"fields": shared.added(given.fields)})}
    )


def _step(file: SchemaFile, command: CommandSpec, step: StepSpec, found: Mapping[str, _Shared]) -> StepSpec:
    """A step, which has the check value of the kind that it receives."""
    given = step.receive
    if given is None or isinstance(given, str):
        return step
    own = given.frame if isinstance(given, StepMessageSpec) else None
    shared = found.get(step_kind(file, own, command) or "")
    if shared is None:
        return step
    if isinstance(given, StepMessageSpec):
        received: object = given.model_copy(update={"fields": shared.added(given.fields)})
    else:
        received = shared.added(given)
    return step.model_copy(update={"receive": received})
