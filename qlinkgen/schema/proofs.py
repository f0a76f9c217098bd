"""Third pass, proofs: check values of answers that cover parts of the frame of their request, too."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

from qlinkgen.model.fields import Field
from qlinkgen.model.frame import DelimitedFrame, Frame, FrameKinds, Part
from qlinkgen.model.message import Message
from qlinkgen.model.transaction import Command, Echo, Proof
from qlinkgen.model.types import Scalar
from qlinkgen.schema.algorithms import AlgorithmBuilder
from qlinkgen.schema.file_fields import FieldSpec
from qlinkgen.schema.notation import REPEATED, shown
from qlinkgen.schema.report import Reporter, did_you_mean, listed
from qlinkgen.schema.source import Path

_RULE = "bad-proof"
#: Error and fix.
Wrong = tuple[str, str]


class ProofBuilder:
    """Connects check values of responses with the parts of the request that they cover."""

    def __init__(self, frame: Frame | None, report: Reporter) -> None:
        """``frame`` is None if it could not be built."""
        self._frame = frame
        self._report = report

    def build(
        self, command: Command, answer: Message, field: Field, spec: FieldSpec, place: Path
    ) -> Iterator[Echo]:
        """The proof of a field at a place, nothing after an error."""
        assert spec.algorithm is not None
        algorithm = AlgorithmBuilder(self._report).build(spec.algorithm, spec.init, place)
        over = list(spec.over or ())
        own = [each for each in over if not REPEATED.match(each)]
        fault = self._misplaced(command, answer, field) or _order(over, len(field.proves))
        fault = fault or _own(answer, field, own) or self._covered(command, field)
        if fault is not None:
            needs = (place, ("frames",), ("frame",), ("commands", command.name))
            self._report.error(_RULE, (*place, "over"), *fault, of_key=True, needs=needs)
        elif algorithm is not None and isinstance(field.type, Scalar):
            if field.type.bits != algorithm.width:
                what = f"{algorithm.name} has {algorithm.width} bits, {field.name} {field.type.bits}"
                hint = "use a type as wide as the algorithm"
                self._report.error("checksum-does-not-fit", place, what, hint, of_key=True)
            before = itertools.takewhile(lambda each: _name(each) not in (*own, field.name), answer.fields)
            begin = sum(each.max_size for each in before)
            yield Echo(answer.name, field.name, Proof(algorithm, field.proves, begin, field.max_size))

    def _misplaced(self, command: Command, answer: Message, field: Field) -> Wrong | None:
        """Error and fix for an answer that cannot have such a check value."""
        name, frame = field.name, self._frame
        if answer is not command.response or answer.command != command.name:
            return f"{name} of {answer.name} covers a request", "only a response of one command can do that"
        if any(step.sent for step in command.steps):
            what = f"{name} of {answer.name} covers the request of a dialogue, which other frames follow"
            return what, "only a response to the request itself can do that"
        if not isinstance(frame, FrameKinds) or not frame.is_turned(answer.id):
            what = f"{name} of {answer.name} covers a request, which a receiver of its frames does not know"
            return what, "give the response a kind of frame that is its payload alone"
        kind = field.type
        if not isinstance(kind, Scalar) or kind.scaling is not None or kind.meaning is not None:
            return f"{name} is a check value, but not a whole number", "give it the type of the check value"
        return None

    def _covered(self, command: Command, field: Field) -> Wrong | None:
        """Error and fix for what is covered of the request."""
        frame, request = self._frame, command.request
        assert isinstance(frame, FrameKinds)
        kinds = frame.carrying(request.id)
        own = kinds[0].frame
        if len(kinds) > 1 or own.coding or own.conditional:
            what = f"the bytes of {request.name} that {field.name} covers are not at constant places"
            return what, "give the request one kind of frame, without a coding or parts with a condition"
        found = _parts(own)
        for name in field.proves:
            if name not in found:
                hint = did_you_mean(name, found, f"name constants, id, address or payload: {listed(found)}")
                return f"the frame of {request.name} has no part {shown(name)} to cover", hint
        return None


def _parts(frame: DelimitedFrame) -> dict[str, Part]:
    """The parts of the frame of a request that a receiver gives back whole."""
    roles = ("constant", "message", "address", "payload")
    return {part.name: part for part in frame.parts if part.role in roles}


def _name(field: Field) -> str:
    """The name by which a check value covers a field."""
    return field.slot or field.name


def _order(over: Sequence[str], number: int) -> Wrong | None:
    """Error and fix if own fields precede pieces of the request."""
    if all(map(REPEATED.match, over[:number])):
        return None
    own = [each for each in over if not REPEATED.match(each)]
    theirs = [each for each in over if REPEATED.match(each)]
    return "the check value covers the request after fields", f"write over: [{', '.join(theirs + own)}]"


def _own(answer: Message, field: Field, own: Sequence[str]) -> Wrong | None:
    """Error and fix for the fields of the answer that are covered."""
    names = list(dict.fromkeys(map(_name, answer.fields)))
    if names[-1] != field.name:
        return f"{field.name} is not the last field of {answer.name}", "move it to the end"
    before = names[:-1]
    right = before[len(before) - len(own) :]
    if unknown := next((each for each in own if each not in before), None):
        hint = did_you_mean(unknown, before, f"earlier fields: {listed(before)}")
        return f"{shown(unknown)} is not a field before {field.name}", hint
    if list(own) != right:
        return f"{field.name} does not cover the fields directly before it", "name them in their order"
    free = before[: len(before) - len(own)]
    varied = next((each for each in answer.fields if _name(each) in free and not each.fixed), None)
    if varied is not None:
        what = f"the size of {varied.name}, which {field.name} does not cover, varies"
        return what, f"cover it, or give {varied.name} a constant size"
    return None
