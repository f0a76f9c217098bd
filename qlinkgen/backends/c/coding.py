"""Views of codings in C: each is a pair of functions, one that codes a byte and one that decodes the next."""

from __future__ import annotations

from collections.abc import Sequence
from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.c.places import in_hex
from qlinkgen.plan.coding import Add, Cobs, Digits, Escaping, Insertion, Pair, Stage


@dataclass(frozen=True, slots=True)
class StageView:
    """A coding.

    Attributes:
        kind: the name of its template.
        index: its position; functions of the next one have the next index, those of the wire the last.
        codes: bytes that are replaced, and the second bytes that they are sent as.
        number: the escape byte, the inserted byte, or the number added.
        mask: XORed with an escaped byte, "" if only some second bytes are legal.
        pattern: bytes after which one is inserted.
    """

    kind: str
    index: int
    codes: list[tuple[str, str]]
    number: str = ""
    mask: str = ""
    pattern: str = ""
    pattern_mask: str = ""
    pattern_size: int = 0

    @property
    def template(self) -> str:
        """The template of its functions."""
        return f"templates/coding_{self.kind}.h.j2"


@dataclass(frozen=True, slots=True, kw_only=True)
class EndedView:
    """A frame that a terminator or a silence ends, or one that is decoded as it is read.

    Attributes:
        stages: its codings; the first is applied first.
        size: size of the terminator, 0 if a silence ends the frame.
        closing: size of the terminator and what follows it.
        limit: maximum size of a frame up to its terminator.
        matches: condition for the terminator at offset ``stop``; at ``first`` of a receiver.
        last: its last byte.
        lines: a frame begins only after a terminator.
        partial: condition for bytes of a receiver that may begin it.
        step: number of bytes to the next place where it may be.
        kept: number of its bytes that may begin the next frame.
        head_checks: statements that check a header of which ``at`` bytes are decoded; [] if its end is known.
        flag: its size if it also begins frames, otherwise 0.
        splits: uncoded bytes are not only the first constant and the terminator.
    """

    stages: list[StageView]
    lead: int
    lead_checks: list[tuple[str, int]]
    size: int
    closing: int
    limit: int
    matches: str
    matches_first: str
    last: str
    lines: bool
    partial: str
    step: str
    kept: int
    flag: int
    front: int
    back: int
    splits: bool
    header: int
    tail: int
    least: int
    most: int
    checks: list[str]
    update_sent: list[str]
    update_received: list[str]
    put_header: list[str]
    put_trailer: list[str]
    put_check: list[str]
    fills: list[str]
    head_checks: Sequence[str] = ()

    @property
    def headed(self) -> bool:
        """Whether a statement that completes a frame names its header."""
        return any("head" in line for line in (*self.put_header, *self.put_trailer, *self.fills))

    @property
    def writes_trailer(self) -> bool:
        """Whether bytes after the payload are written."""
        return any("trailer" in line for line in (*self.put_trailer, *self.put_check, *self.fills))

    @property
    def cobs(self) -> bool:
        """Whether the last coding needs to be begun and finished."""
        return bool(self.stages) and self.stages[-1].kind == "cobs"

    @property
    def inserts(self) -> bool:
        """Whether a coding needs the last bytes."""
        return any(stage.kind == "insert" for stage in self.stages)


def stage_views(stages: tuple[Stage, ...]) -> list[StageView]:
    """The views of codings that apply one after the other."""
    return [_view(stage, index) for index, stage in enumerate(stages, 1)]


def _view(stage: Stage, index: int) -> StageView:
    match stage:
        case Escaping():
            codes = [(in_hex(byte), in_hex(second)) for byte, second in stage.codes]
            mask = in_hex(stage.mask) if stage.mask else ""
            return StageView("escape", index, codes, in_hex(stage.escape), mask)
        case Insertion():
            size = len(stage.after)
            pattern = f"0x{stage.after.hex().upper()}U"
            mask = f"0x{'FF' * size}U"
            return StageView("insert", index, [], in_hex(stage.insert), "", pattern, mask, size)
        case Cobs():
            return StageView("cobs", index, [])
        case Digits():
            return StageView("digits", index, [])
        case Pair():
            return StageView("pair", index, [])
        case Add():
            return StageView("add", index, [], in_hex(stage.number))
        case _:
            assert_never(stage)
