"""Second pass, answers that only their request tells apart: they have one number, or none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from qlinkgen.model.coding import ALL_BYTES
from qlinkgen.model.frame import DelimitedFrame, Frame
from qlinkgen.model.message import CARRIER, Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.schema.fields import FieldBuilder
from qlinkgen.schema.file_commands import AnswerSpec
from qlinkgen.schema.file_fields import FieldSpec
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.part_texts import fields_without_end
from qlinkgen.schema.report import Reporter
from qlinkgen.schema.source import Path
from qlinkgen.schema.terminators import bytes_in

#: The place of the number of all answers.
NUMBER: Path = ("defaults", "response", "id")
_FRAME: Path = ("frame",)
_RULE = "overlapping-id"
_DOC = "An answer whose message only its request tells."


class AskedBuilder:
    """Finds the answers that only their request tells apart, and builds the message that carries them."""

    def __init__(self, file: SchemaFile, report: Reporter, fields: FieldBuilder, frame: Frame | None) -> None:
        """``frame`` is None if it could not be built; then there are none."""
        self._file = file
        self._report = report
        self._fields = fields
        self._frame = frame.towards("response") if isinstance(frame, DelimitedFrame) else frame

    def of(self, answers: Sequence[Message], places: Mapping[str, Path]) -> tuple[Message, ...]:
        """Those of the answers of commands that share a number; ``places`` state the number of each."""
        if not isinstance(self._frame, DelimitedFrame):
            return ()
        common = self._file.defaults.response
        opened = self._frame.payload.opening is not None
        numbered = opened or any(bits.role == "message" for bits in self._frame.id_bits)
        stated = isinstance(common, AnswerSpec) and common.id is not None and not common.id.relative
        if numbered and not stated:
            return ()
        numbers = {each.id for each in answers if not numbered or places[each.name] == NUMBER}
        found = tuple(each for each in answers if each.id in numbers)
        return found if len(found) > 1 else ()

    def carrier(self, answers: Sequence[Message], path: Path) -> Message:
        """The message that a receiver takes for all of them, stated at a path."""
        self._check(answers, path)
        for each in answers:
            if each.settled:
                what = (
                    f"{each.name} has a fixed {each.settled[0][0]}, but only the request tells it from others"
                )
                self._report.error("bad-fixed", path, what, "let the program set it", needs=(path, _FRAME))
        first = answers[0]
        least = min(0 if each.empty_is_default else each.min_size for each in answers)
        most = max(each.max_size for each in answers)
        if first.text:  # the carrier begins with it, too
            least, most = least - len(first.text), most - len(first.text)
        fields = self._fields.build({"data": self._data(answers, least, most)} if most else {}, path)
        fields = fields_without_end(fields, self._frame, path, self._report)
        return Message(
            name=CARRIER,
            command=CARRIER,
            direction="response",
            id=first.id,
            fields=fields,
            doc=_DOC,
            addresses=first.addresses,
            default_address=first.default_address,
            echoed=first.echoed,
            seeds=first.seeds,
            carries=True,
        )

    def _data(self, answers: Sequence[Message], least: int, most: int) -> FieldSpec:
        """The payload; where a terminator is sent as it is, of the bytes that can be in it."""
        size = f"{least}..{most}" if least < most else f"{most}"
        assert isinstance(self._frame, DelimitedFrame)
        spec, doc = {"type": f"bytes[{size}]"}, "Its payload"
        if self._frame.part("terminator") is not None and not self._frame.coding:
            found = frozenset[int]().union(*(bytes_in(field) for each in answers for field in each.fields))
            if max(found) < 0x80:
                spec = {"type": f"text[{size}]"}
            elif found != ALL_BYTES and self._file.groups is None:
                spec = {"type": f"u8[{size}]", "range": f"{min(found)}..{max(found)}"}
        return FieldSpec.model_validate({**spec, "doc": doc})

    def _check(self, answers: Sequence[Message], path: Path) -> None:
        """Check that a receiver can take each of them without knowing which one it is."""
        frame = self._frame
        assert isinstance(frame, DelimitedFrame)
        first, *others = answers
        ended = frame.tells_end
        for each in others:
            if not ended and not (first.fixed and each.fixed and first.max_size == each.max_size):
                what = f"only the request tells {each.name} from {first.name}, but they differ in size"
                self._error(path, what, "give them one constant size, or the frame a length or terminator")
                return
        if frame.payload.trim is not None and len({each.max_size for each in answers}) > 1:
            what = "only the request tells the answers apart, so the zeros that were not sent are not known"
            self._error(path, what, "remove trim from the payload, or give the answers one size")

    def _error(self, path: Path, what: str, hint: str) -> None:
        self._report.error(_RULE, path, what, hint, of_key=True, needs=(path, _FRAME))

    def check_name(self) -> None:
        """Report what is called like the message that carries the answers."""
        groups = ("commands", "messages", "replies")
        for group in groups:
            if CARRIER in getattr(self._file, group):
                what = f"{CARRIER} is what receivers call an answer whose request they do not know"
                self._report.error("name-clash", (group, CARRIER), what, "rename it", of_key=True)


def check_told(protocol: Protocol, places: Mapping[str, Path], report: Reporter) -> None:
    """Check that the answers to a request can be told apart; ``places`` state the number of each."""
    if protocol.carrier is None:
        return
    # Few files have such answers, and lint starts sooner without the plan.
    from qlinkgen.plan import plan_of  # noqa: PLC0415
    from qlinkgen.plan.content import BadContent, Unsendable, defaults, pack, unpack  # noqa: PLC0415

    for answers in plan_of(protocol).asked.values():
        for number, later in enumerate(answers[1:], 1):
            for earlier in answers[:number]:
                try:
                    unpack(earlier.payload, pack(later.payload, defaults(later.payload)))
                except BadContent:
                    continue
                except Unsendable as error:
                    what, hint = f"{later.name} has no default {error.field}", "give it a default"
                else:
                    what = f"{later.name} with its defaults is taken for {earlier.name}"
                    hint = "let a constant, a range or their sizes differ, also in the defaults"
                report.error(_RULE, places[later.name], what, hint, of_key=True, needs=(places[later.name],))
                return
