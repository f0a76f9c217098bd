"""Where a message's code stands: names in the module, and the frame around the payload."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from qlinkgen.backends.python.scalars import Names
from qlinkgen.model.frame import DelimitedFrame, Part
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.types import Length

#: Longest line of generated code.
WIDTH = 110


@dataclass(frozen=True)
class Place:
    """Everything that the code of a message needs to know of its module.

    Attributes:
        names: byte order and classes of the module.
        frame: the frame if its codec handles whole frames; None where it handles payloads alone.
        address: attribute that holds the address, "" if there is none.
        unique: the preamble is added by the encoder's last step and checked by the receiver.
        texts: defaults that are text are spelt as text, not as numbers.
    """

    names: Names
    frame: DelimitedFrame | None
    address: str = ""
    unique: bool = False
    texts: bool = True

    @property
    def header(self) -> int:
        """Bytes in front of the payload in what a decoder reads: the frame, or all behind its preamble."""
        if self.frame is None:
            return 0
        return self.frame.header_size - (len(self.frame.preamble) if self.unique else 0)

    @property
    def trailer(self) -> int:
        """Bytes behind the payload."""
        return self.frame.overhead - self.frame.header_size if self.frame else 0

    @property
    def overhead(self) -> int:
        """Bytes beside the payload in what a decoder reads."""
        return self.header + self.trailer

    @property
    def front(self) -> tuple[Part, ...]:
        """Parts that the encoder packs in front of the payload."""
        if self.frame is None:
            return ()
        names = [part.role for part in self.frame.parts]
        return self.frame.parts[1 if self.unique else 0 : names.index("payload")]

    @property
    def back(self) -> tuple[Part, ...]:
        """Parts that the encoder packs behind the payload; a checksum at the very end is added later."""
        if self.frame is None:
            return ()
        names = [part.role for part in self.frame.parts]
        parts = self.frame.parts[names.index("payload") + 1 :]
        return parts[:-1] if parts and parts[-1].role == "checksum" else parts

    @property
    def data(self) -> str:
        """Name of what a decoder reads."""
        if self.frame is None:
            return "payload"
        return "body" if self.unique else "frame"

    @property
    def payload(self) -> str:
        """Expression for the payload, for error texts."""
        return f"_payload({self.data})" if self.frame else "payload"


def in_ranges(number: str, ranges: Iterable[tuple[int, int]]) -> str:
    """The condition that a number is in one of several ranges."""
    terms = [f"{number} == {low}" if low == high else f"{low} <= {number} <= {high}" for low, high in ranges]
    return f"({' or '.join(terms)})" if len(terms) > 1 else terms[0]


def wrapped(head: str, items: Iterable[str], tail: str, indent: int) -> list[str]:
    """``head item, item tail`` on as many lines as it takes; indent is that of the first one."""
    listed = list(items)
    line = f"{head}{', '.join(listed)}{tail}"
    if indent + len(line) <= WIDTH:
        return [line]
    lines, current = [head], "   "
    for item in listed:
        if indent + len(current) + len(item) + 2 > WIDTH and current.strip():
            lines.append(current)
            current = "   "
        current += f" {item},"
    return [*lines, current, tail]


def folded(
    head: str, terms: Sequence[str], operator: str, tail: str = "", *, always: bool = False
) -> list[str]:
    """``head term operator term tail``, in parentheses (``always`` or) where it takes several lines."""
    joined = operator.join(terms)
    line = f"{head}({joined}){tail}" if always and len(terms) > 1 else f"{head}{joined}{tail}"
    if len(line) <= WIDTH - 16:
        return [line]
    rest = [f"{operator.lstrip()}{term}" for term in terms[1:]]
    return [f"{head}(", *indented([terms[0], *rest]), f"){tail}"]


def indented(lines: Iterable[str], levels: int = 1) -> list[str]:
    """Lines moved to the right."""
    return ["    " * levels + line if line else line for line in lines]


def in_hex(number: int, size: int = 1) -> str:
    """A number in hex digits."""
    return f"0x{number:0{2 * size}X}"


def literal(data: bytes) -> str:
    """Bytes as source text."""
    text = repr(data)[2:-1].replace('"', r"\x22").replace(r"\'", "'")
    return f'b"{text}"'


def joined_format(codes: Iterable[str]) -> str:
    """Formats in a row, pad bytes that follow one another as one."""
    text, pads = "", 0
    for code in codes:
        if code.endswith("x"):
            pads += int(code[:-1] or 1)
            continue
        text += (f"{pads}x" if pads else "") + code
        pads = 0
    return text + (f"{pads}x" if pads else "")


def place_of(protocol: Protocol, enums: Mapping[str, str], *, unique: bool) -> Place:
    """The place of a protocol's messages."""
    names = Names(">" if protocol.byteorder == "big" else "<", enums)
    frame = protocol.frame if isinstance(protocol.frame, DelimitedFrame) else None
    return Place(names, frame, protocol.address_name or "", unique, protocol.texts)


def items_span(length: Length) -> str:
    """The numbers of items that a field may have, as a range."""
    first = f"{length.minimum}, " if length.minimum else ""
    return f"range({first}{length.maximum + 1})"


def constant_name(message: Message) -> str:
    """Name of a message in the names of constants."""
    return message.name.replace(".", "_").upper()
