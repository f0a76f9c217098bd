"""Check values of frames for the templates."""

from __future__ import annotations

from qlinkgen._dataclass import dataclass


@dataclass(frozen=True)
class CheckView:
    """The check value of a frame.

    Attributes:
        definition: statement that defines the algorithm.
        size: size on the wire.
        order: byte order of a value that is sent whole, "" if bits are omitted.
        bytes: expression for the bytes of the number ``crc``.
        selectable: another algorithm of the catalogue can replace it.
        maker: function of the support module that the definition calls.
    """

    definition: list[str]
    size: int
    order: str
    bytes: str
    selectable: bool
    maker: str


@dataclass(frozen=True)
class PlacedCheck:
    """A check value, its offsets in the frame, and the expression for the bytes that it covers.

    Attributes:
        ahead: the same in a method of the message for ``body``, the bytes before it; "" unless it is last.
        mark: what the names of its functions end with, "" for the main one.
        seeded: it covers attributes of the message.
        main: another algorithm can replace it.
        early: it is verified before the payload.
        result: statement that computes the value of a whole frame with `message` and `checksum`.
        wrong: condition for another value in the frame.
        case: the call that makes received digits upper case, "" if there are none.
    """

    name: str
    view: CheckView
    start: str
    end: str
    covered: str
    ahead: str
    otherwise: int | None
    mark: str
    seeded: bool
    main: bool
    early: bool
    result: str
    wrong: str
    case: str
