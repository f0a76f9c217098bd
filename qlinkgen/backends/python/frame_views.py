"""Views of frames for the templates: names, numbers and expressions, one for each kind of receiver."""

from __future__ import annotations

from collections.abc import Sequence

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.python.check_views import CheckView, PlacedCheck
from qlinkgen.backends.python.coding import CodingView
from qlinkgen.backends.python.conditional import AfterView, ConditionalView


@dataclass(frozen=True)
class AddressView:
    """The address of a frame.

    Attributes:
        name: attribute of the messages.
        parameter: name of the parameter of ``from_bytes``.
        bytes: expression for the bytes of the part with ``number``, "" if the address shares a marked byte.
        default: the default address.
        limit: the greatest address, "" if the bytes hold no greater one.
    """

    name: str
    parameter: str
    bytes: str
    default: int
    limit: str = ""


@dataclass(frozen=True)
class UniqueView:
    """A frame with a preamble that occurs nowhere else."""

    title: str
    idle: tuple[float, float] | None
    broken: bool
    check: CheckView
    address: AddressView | None
    preamble: str
    mark: str
    insert: str
    header: int
    overhead: int
    length_end: int
    uncounted: int
    min_length: int
    max_length: int
    body_start: int
    payload_of_body: str
    id_at: int
    blank_header: str
    trailer: int
    whole_sizes: Sequence[int]
    prefix: str
    check_letter: str

    template = "unique"


@dataclass(frozen=True)
class HeadCheck:
    """A condition for bytes that do not begin a frame, in wire order, and the result of ``_split``.

    Attributes:
        fault: "number", "address" or "constant" if only a decoder of one whole frame reports it.
        whole: the same for a header at ``start`` in ``buf``, "" if decoding its message finds it; at the end
            of the buffer it holds or raises an IndexError.
    """

    test: str
    found: str
    fault: str = ""
    whole: str = ""


@dataclass(frozen=True)
class LengthView:
    """The length of a frame: bounds, offsets, its value in ``head`` and the bytes of ``number``.

    Attributes:
        lead: the bytes before it, "" unless they are constant.
        quick: the same value at ``start`` in ``buf``; raises an IndexError at its end, unless ``sliced``.
        sliced: at the end of the buffer ``quick`` is a wrong number.
        bounded: its part holds numbers beyond the bounds.
        last: the last number that the first of two lengths states, None if there is one length.
    """

    bias: int
    least: int
    most: int
    start: int
    end: int
    lead: str
    value: str
    quick: str
    sliced: bool
    bytes: str
    scale: int
    bounded: bool
    last: int | None = None

    @property
    def inline(self) -> str:
        """Its value as a term."""
        return f"({self.value})" if any(each in self.value for each in (" | ", " if ")) else self.value


@dataclass(frozen=True)
class StuffingView:
    """Stuffing of ``whole`` frames except their first and last bytes, or of payloads only.

    Attributes:
        last: the byte before an inserted one.
        coding: in place of the stuffing, None if bytes are inserted.
        reveals: the byte after which the next one can be wrong; "" if any can, or none.
        steady: no byte can be wrong.
    """

    whole: bool
    after: str
    insert: str
    front: int
    back: int
    last: str = ""
    coding: CodingView | None = None
    reveals: str = ""
    steady: bool = False


@dataclass(frozen=True)
class EndedView:
    """A terminator, or a silence, and the coding of the bytes before it.

    Attributes:
        terminator: "" if a silence ends a frame.
        last: its last byte.
        pair: its first byte if that also begins pairs of coded bytes, otherwise "".
        kept: number of its bytes that may begin the next frame.
        closing: size of the terminator and what follows it.
        after: size of what follows it.
        limit: maximum size of a frame up to its terminator.
        lead: size of the constant at the beginning.
        front: number of uncoded bytes at the beginning.
        back: number of uncoded bytes at the end.
        splits: uncoded bytes are not only the first constant and the terminator.
        least: minimum size of a payload.
        lines: a frame begins only after a terminator.
        flag: the terminator is also the beginning of a frame.
        checks: conditions for wrong bytes, and the kind of fault.
        coding: None if bytes are sent as they are.
    """

    terminator: str
    last: str
    pair: str
    kept: int
    closing: int
    after: int
    limit: int
    lead: int
    front: int
    back: int
    splits: bool
    least: int
    lines: bool
    flag: bool
    checks: Sequence[tuple[str, str]]
    coding: CodingView | None

    @property
    def plain(self) -> bool:
        """Whether the terminator follows bytes that are sent as they are, and belongs to one frame only."""
        shared = self.kept or self.lines or self.flag
        return bool(self.terminator) and self.coding is None and not shared


@dataclass(frozen=True)
class BlocksView:
    """The check values of the blocks of a payload."""

    every: int
    view: CheckView


@dataclass(frozen=True)
class OfKind:
    """What code is the same for each kind of frame.

    Attributes:
        result: expression for the ``message`` of a ``payload`` in a ``frame``.
        begun: the message ids that it begins with, and the beginnings of these.
        passes: functions take an algorithm that replaces that of the schema, or None.
    """

    result: str
    begun: Sequence[str]
    passes: bool


@dataclass(frozen=True)
class PartsView:
    """Any other delimited frame.

    Attributes:
        checks: the check values in wire order.
        filling: the same in the order in which they are computed.
        seeds: attributes of message classes that check values cover.
        blank: the zeros of the check value at the end of the frame, "" if something else is there.
        trim: bytes of a payload that are sent even if they are zeros at its end, None if all are.
        before: parts before the payload that only some frames have; code works on frames with them.
        after: parts at the end that only some frames have; code works on frames without them.
        kind: it is one of several kinds, None if it is the only one.
    """

    title: str
    checks: Sequence[PlacedCheck]
    filling: Sequence[PlacedCheck]
    blank: str
    trim: int | None
    seeds: Sequence[str]
    blocks: BlocksView | None
    address: AddressView | None
    length: LengthView | None
    stuffing: StuffingView | None
    ended: EndedView | None
    idle: tuple[float, float] | None
    broken: bool
    preamble: str
    begins_with: str
    header: int
    trailer: int
    max_frame: int
    max_payload: int
    blank_header: str
    blank_trailer: str
    id_start: str
    id_of: str
    id_of_buffer: str
    id_of_frame: str
    address_of: str
    bare: bool
    verified: bool
    head_checks: Sequence[HeadCheck]
    values: Sequence[str]
    counter: str
    #: It counts some messages, but not all.
    counts_some: bool
    #: It begins anew after some commands.
    restarts: bool
    #: Attribute with the number of the master, and its default, as a tuple; "" if there is none.
    master: str
    tail_tests: Sequence[str]
    before: ConditionalView | None = None
    after: AfterView | None = None
    kind: OfKind | None = None
    #: The tables of ids that payloads begin with, [] if parts hold ids.
    texts: Sequence[str] = ()
    #: Letters of either case are received in them.
    folded: bool = False

    template = "delimited"

    @property
    def passes(self) -> bool:
        """Whether functions of one of several kinds take another algorithm."""
        return self.kind is not None and self.kind.passes

    @property
    def extra(self) -> int:
        """Bytes of the header that only some frames have."""
        return self.before.size if self.before else 0

    @property
    def direct(self) -> bool:
        """Whether an encoder computes the only check value of a frame where it adds it."""
        check = self.main
        alone = check is not None and len(self.filling) == 1 and check.otherwise is None
        return alone and self.quick and not self.before and self.kind is None

    @property
    def last(self) -> bool:
        """Whether that ends the frame: then an encoder handles the bytes ahead of it."""
        return self.direct and self.main is not None and bool(self.main.ahead)

    @property
    def tail(self) -> int:
        """Bytes after the payload in what an encoder handles."""
        return self.trailer - (self.main.view.size if self.last and self.main else 0)

    @property
    def before_check(self) -> tuple[str, str] | None:
        """The condition and the function that changes a frame ahead of its check value; None without."""
        data = "body" if self.last else "frame"
        if self.stuffing and not self.stuffing.whole and not self.stuffing.coding:
            return f"{self.stuffing.last} in {data}[_HEADER:]", "_stuffed"
        return (f"not {data}[{-self.tail - 1}]", "_trimmed") if self.trim is not None else None

    @property
    def main(self) -> PlacedCheck | None:
        """The main check value, None if there is none."""
        return next((each for each in self.checks if each.main), None)

    @property
    def check(self) -> CheckView | None:
        """The algorithm of the main check value, None if there is none."""
        return self.main.view if self.main else None

    @property
    def coding(self) -> CodingView | None:
        """The coding of its bytes; None if they are stuffed or not coded, or only the payload is."""
        way = self.ended or (self.stuffing if self.stuffing and self.stuffing.whole else None)
        return way.coding if way else None

    @property
    def limited(self) -> bool:
        """Whether a receiver counts the bytes up to the longest frame."""
        return self.bare or self.silent

    @property
    def silent(self) -> bool:
        """Whether only a silence ends a frame."""
        return self.ended is not None and not self.ended.terminator

    @property
    def decoder(self) -> str:
        """The template of the decoder of a stream."""
        return "gap" if self.silent else self.template

    @property
    def quick(self) -> bool:
        """Whether a whole frame can be cut out at once: its end and its bytes are not coded."""
        changed = self.stuffing is not None and (self.stuffing.whole or self.stuffing.coding is not None)
        return not (self.blocks or changed) and (self.ended is None or (self.ended.plain and not self.bare))

    @property
    def announced(self) -> bool:
        """Whether a header with the right constants makes the decoder wait for the end of its frame."""
        early = any(each.early for each in self.checks)
        others = any(each.fault and not each.whole for each in self.head_checks)
        ending = self.length is not None or self.ended is not None
        return self.quick and ending and not early and not others

    @property
    def no_frame(self) -> Sequence[HeadCheck]:
        """The conditions for bytes that do not begin a frame."""
        return [each for each in self.head_checks if each.fault]


@dataclass(frozen=True)
class MarkedView:
    """A frame whose header and end have a marker bit."""

    title: str
    check: CheckView | None
    address: AddressView
    marker: str
    address_shift: int
    address_mask: str
    id_shift: int
    id_mask: str
    end: int
    most: int
    checked_default: bool

    template = "marked"


@dataclass(frozen=True)
class PacketView:
    """Packets, which have no delimiter."""

    title: str
    requests: str
    responses: str
    check_size: int = 0
    check_bytes: str = ""
    check_mask: str = ""
    word: int = 1
    total: str = ""
    rejected: str = ""

    template = "packet"


FrameView = UniqueView | PartsView | MarkedView | PacketView
