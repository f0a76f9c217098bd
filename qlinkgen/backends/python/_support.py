"""Common parts of generated modules: errors, rules, messages.

Copied next to them unchanged. Imports only modules of the standard library that load quickly: `enum` would
cost 6 ms, `dataclasses` 30.
"""

from __future__ import annotations

from _operator import index  # built in; `operator` is loaded from a file
from struct import error as struct_error

TYPE_CHECKING = False  # as typing.TYPE_CHECKING; importing `typing` costs 5 ms
if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any, ClassVar, TypeVar

    AnyMessage = TypeVar("AnyMessage", bound="BaseMessage")

    #: A value of a field. Any: a rule rejects values of the wrong type by the TypeError that they raise.
    Value = Any
    #: Class of a message. Any: each has its own constructor.
    MessageClass = type[Any]
    #: Input of a decoder.
    BytesLike = bytes | bytearray | memoryview


# Errors -----------------------------------------------------------------------------------------------------


class CodecError(ValueError):
    """A value or a frame cannot be encoded or decoded."""


class EncodeError(CodecError):
    """A message holds a value that cannot be sent.

    Attributes:
        field: name of the field.
        value: its value.
    """

    def __init__(self, text: str, field: str = "", value: object = None) -> None:
        super().__init__(text)
        self.field = field
        self.value = value

    def __reduce__(self) -> tuple[type[EncodeError], tuple[str, str, object]]:
        """Pickle with every attribute."""
        return type(self), (str(self), self.field, self.value)


class DecodeError(CodecError):
    """Received bytes are not a valid message or frame.

    Attributes:
        kind: crc, stuffing, length, range, unknown, truncated, frame or illegal.
        field: name of the wrong field, "" for other errors.
        offset: offset of the error in `data`.
        data: the payload if a field is wrong, otherwise the frame.
    """

    def __init__(
        self, text: str, kind: str, field: str = "", offset: int = 0, data: bytes = b""
    ) -> None:
        super().__init__(text)
        self.kind = kind
        self.field = field
        self.offset = offset
        self.data = data

    def __reduce__(self) -> tuple[type[DecodeError], tuple[str, str, str, int, bytes]]:
        """Pickle with every attribute."""
        return type(self), (str(self), self.kind, self.field, self.offset, self.data)


class OutOfRange(ValueError):
    """Raised inside an encoder, which converts it to an EncodeError with the name of the field."""


class LayoutError(LookupError):
    """Raised inside a decoder if the bytes do not have the layout of the message."""


#: Exceptions inside an encoder for a value of the wrong type or out of range.
REFUSALS = (
    struct_error,
    TypeError,
    ValueError,
    ArithmeticError,
    AttributeError,
    LookupError,
)
#: Exceptions inside a decoder for an invalid message.
UNREAD = (struct_error, LookupError, CodecError)
#: Exceptions inside a decoder for arguments of any type.
UNREADABLE = (*UNREAD, TypeError, BufferError, NotImplementedError)


class Fault:
    """Invalid bytes in a stream.

    Attributes:
        kind: as in DecodeError.
        offset: offset of its first byte in the stream.
        raw: its bytes as received.
        message: error text.
    """

    __slots__ = ("kind", "message", "offset", "raw")

    def __init__(self, kind: str, offset: int, raw: bytes, message: str = "") -> None:
        self.kind = kind
        self.offset = offset
        self.raw = raw
        self.message = message

    def __eq__(self, other: object) -> bool:
        """Compare kind, offset and bytes, not the text."""
        if not isinstance(other, Fault):
            return NotImplemented
        return (self.kind, self.offset, self.raw) == (
            other.kind,
            other.offset,
            other.raw,
        )

    def __repr__(self) -> str:
        return f"Fault({self.kind!r}, offset={self.offset}, raw={self.raw.hex(' ')!r})"


class Counters:
    """Counters of a stream decoder.

    Attributes:
        frames: number of messages.
        faults: number of faults by kind.
        skipped: number of bytes outside of frames and faults.
    """

    __slots__ = ("faults", "frames", "skipped")

    def __init__(self) -> None:
        self.frames = 0
        self.faults: dict[str, int] = {}
        self.skipped = 0

    def __repr__(self) -> str:
        return f"Counters(frames={self.frames}, faults={self.faults}, skipped={self.skipped})"


# Rules for values, used after an encoder or decoder has failed ----------------------------------------------


def shown(value: object) -> str:
    """A value for an error text."""
    try:
        text = repr(value)
    except ValueError:  # an int of thousands of digits
        text = "a number of thousands of digits"
    return text if len(text) <= 60 else text[:57] + "..."


class Rule:
    """The legal values of a field, as text and as a check.

    Attributes:
        name: name of the field.
        legal: description of legal values, for error texts.
        settable: whether the field is an attribute of the message.
    """

    __slots__ = ("legal", "name")

    settable = True

    def __init__(self, name: str, legal: str) -> None:
        self.name = name
        self.legal = legal

    def allows(self, value: Value) -> bool:
        """Whether the value can be sent. May raise any of REFUSALS instead."""
        raise NotImplementedError

    def plain(self, value: Value) -> Value:
        """The value converted to the types that encoders accept, such as int."""
        return value

    def of(self, message: object) -> Rule:
        """The rule that applies to the value of a message."""
        return self

    def complaint(self, value: object) -> str:
        """The error text for a value, "" if it is legal."""
        try:
            allowed = self.allows(value)
        except REFUSALS:
            allowed = False
        return (
            ""
            if allowed
            else f"{self.name}: {shown(value)} cannot be sent; give {self.legal}"
        )


class IntRule(Rule):
    """A whole number in a range, or in one of several if more bounds are given."""

    __slots__ = ("ranges",)

    def __init__(
        self, name: str, low: int, high: int, *more: int, unit: str = ""
    ) -> None:
        bounds = (low, high, *more)
        self.ranges = tuple(zip(bounds[::2], bounds[1::2], strict=True))
        words = " or ".join(
            f"{first}..{last}" if first != last else str(first)
            for first, last in self.ranges
        )
        super().__init__(name, f"a whole number, {words}{unit and ' '}{unit}")

    def allows(self, value: Value) -> bool:
        """Whether the value is or converts to an integer in range."""
        number = index(value)
        return any(first <= number <= last for first, last in self.ranges)

    def plain(self, value: Value) -> int:
        """The value as an int."""
        return index(value)


class MaskRule(Rule):
    """Named bits; the others must be zero."""

    __slots__ = ("mask",)

    def __init__(self, name: str, mask: int) -> None:
        self.mask = mask
        super().__init__(name, f"bits of {mask:#x} only")

    def allows(self, value: Value) -> bool:
        """Whether all other bits are zero."""
        return index(value) & ~self.mask == 0

    def plain(self, value: Value) -> int:
        """The value as an int."""
        return index(value)


class ConstantRule(Rule):
    """A constant number; other received numbers are illegal, except the ``others``."""

    __slots__ = ()

    settable = False

    def __init__(self, name: str, value: int, *others: int) -> None:
        words = [f"{each:#x}" if each >= 0 else str(each) for each in (value, *others)]
        super().__init__(name, f"the constant {' or '.join(words)}")


class CountRule(Rule):
    """The size of another field."""

    __slots__ = ()

    settable = False

    def __init__(self, name: str, counted: str) -> None:
        super().__init__(name, f"the size of {counted}")


class ArrayRule(Rule):
    """A list of whole numbers."""

    __slots__ = ("fewest", "item", "most")

    def __init__(
        self, name: str, fewest: int, most: int, low: int, high: int, *, unit: str = ""
    ) -> None:
        self.fewest = fewest
        self.most = most
        self.item = IntRule(name, low, high, unit=unit)
        super().__init__(
            name, f"a list of {_span(fewest, most)} items, each {self.item.legal}"
        )

    def allows(self, value: Value) -> bool:
        """Whether the number of items is legal, and all items are in range."""
        return self.fewest <= len(value) <= self.most and all(
            self.item.allows(item) for item in value
        )

    def plain(self, value: Value) -> Value:
        """The value as a list of ints."""
        numbers = [index(item) for item in value]
        same = all(new is old for new, old in zip(numbers, value, strict=True))
        return value if same and value.__class__ is list else numbers


class BytesRule(Rule):
    """A byte string."""

    __slots__ = ("fewest", "most")

    def __init__(self, name: str, fewest: int, most: int) -> None:
        self.fewest = fewest
        self.most = most
        super().__init__(name, f"{_span(fewest, most)} bytes")

    def allows(self, value: Value) -> bool:
        """Whether the value is bytes-like and has a legal size."""
        return self.fewest <= memoryview(value).nbytes <= self.most


class TextRule(BytesRule):
    """Text of seven-bit characters."""

    __slots__ = ()

    def __init__(self, name: str, fewest: int, most: int) -> None:
        super().__init__(name, fewest, most)
        self.legal = f"text of {_span(fewest, most)} seven-bit characters"

    def allows(self, value: Value) -> bool:
        """Whether the value is seven-bit text of a legal length."""
        return (
            isinstance(value, str)
            and value.isascii()
            and self.fewest <= len(value) <= self.most
        )


def _span(fewest: int, most: int) -> str:
    return str(most) if fewest == most else f"{fewest}..{most}"


class Scale:
    """Conversion of a scaled value: value = (raw * factor + bias) / divisor, raw in low..high."""

    __slots__ = (
        "bias",
        "ceiling",
        "divisor",
        "factor",
        "floor",
        "high",
        "least",
        "low",
        "most",
        "offset",
        "ratio",
    )

    def __init__(
        self, low: int, high: int, *, factor: int = 1, bias: int = 0, divisor: int = 1
    ) -> None:
        self.low, self.high = low, high
        self.factor, self.bias, self.divisor = factor, bias, divisor
        first, last = sorted((low * factor + bias, high * factor + bias))
        # Whole numbers outside of all values that round to a legal step.
        self.floor = (first - abs(factor)) // divisor
        self.ceiling = -((-last - abs(factor)) // divisor)
        # Raw numbers that floats give with an error of less than a thousandth; none from 1 to 0.
        small = max(abs(low), abs(high), abs(factor), abs(bias), divisor) < 1 << 40
        self.least, self.most = (low, high) if small else (1, 0)
        self.ratio = divisor / factor if small else 1.0
        self.offset = bias / factor if small else 0.0

    def value(self, raw: int) -> Value:
        """The value of a raw number, correctly rounded."""
        value = raw * self.factor + self.bias
        return value if self.divisor == 1 else value / self.divisor

    def raw(self, value: Value) -> int:
        """The nearest raw number, computed exactly, ties to even. Raises OutOfRange."""
        if value.__class__ is float:
            steps = value * self.ratio - self.offset
            if self.least <= steps <= self.most:
                raw = round(steps)
                if -0.49 < steps - raw < 0.49:
                    return raw
        # Checked first, because infinity and NaN have no ratio, and that of 1E+999999 is too large.
        if not self.floor <= value <= self.ceiling or _too_fine(value):
            raise OutOfRange
        top, bottom = value.as_integer_ratio()
        raw = _nearest(top * self.divisor - self.bias * bottom, bottom * self.factor)
        if not self.low <= raw <= self.high:
            raise OutOfRange
        return raw


class DecimalScale(Scale):
    """Conversion to an exact Decimal, for values that a float cannot represent."""

    __slots__ = ()

    def value(self, raw: int) -> Value:
        """The exact value of a raw number."""
        # Imported here, so that only protocols with such values pay for it.
        from decimal import Context, Decimal

        number = Decimal(raw * self.factor + self.bias)
        return Context(prec=100).divide(number, Decimal(self.divisor))


class ScaledRule(Rule):
    """A scaled value, rounded to whole steps."""

    __slots__ = ("scale",)

    def __init__(self, name: str, scale: Scale, *, unit: str = "") -> None:
        self.scale = scale
        low, high = sorted((scale.value(scale.low), scale.value(scale.high)))
        super().__init__(name, f"a number, {low}..{high}{unit and ' '}{unit}")

    def allows(self, value: Value) -> bool:
        """Whether the nearest step is in range."""
        self.scale.raw(self.plain(value))
        return True

    def plain(self, value: Value) -> Value:
        """The value as a number with an exact ratio."""
        return value if hasattr(value, "as_integer_ratio") else index(value)


def _too_fine(value: Value) -> bool:
    """Whether a value is a Decimal like 1E-999999, whose exact ratio would exhaust memory."""
    return hasattr(value, "as_tuple") and bool(value.as_tuple().exponent < -400)


def _nearest(dividend: int, divisor: int) -> int:
    if divisor < 0:
        dividend, divisor = -dividend, -divisor
    quotient, remainder = divmod(dividend, divisor)
    return quotient + (
        2 * remainder > divisor or (2 * remainder == divisor and quotient & 1)
    )


# Messages ---------------------------------------------------------------------------------------------------


class BaseMessage:
    """Base class of messages.

    Attributes:
        NAME: name in the schema, like motion.request.
        ID: number of the message in the frame.
        MIN_SIZE: minimum size of the payload.
        MAX_SIZE: maximum size of the payload.
        MAX_WIRE_SIZE: maximum size on the wire, including frame and stuffing.
        FIELDS: names of the fields, in wire order.
        RULES: legal values of each field.
    """

    __slots__ = ()

    NAME: ClassVar[str] = ""
    ID: ClassVar[int] = 0
    MIN_SIZE: ClassVar[int] = 0
    MAX_SIZE: ClassVar[int] = 0
    MAX_WIRE_SIZE: ClassVar[int] = 0
    FIELDS: ClassVar[tuple[str, ...]] = ()
    RULES: ClassVar[tuple[Rule, ...]] = ()
    #: Name of the address, "" if the frame has none.
    ADDRESS: ClassVar[str] = ""
    #: Whether an empty payload means that every field has its default.
    EMPTY: ClassVar[bool] = False

    def to_bytes(self) -> bytes:
        """The payload. Raises EncodeError."""
        raise NotImplementedError

    def _attributes(self) -> tuple[str, ...]:
        return (self.ADDRESS, *self.FIELDS) if self.ADDRESS else self.FIELDS

    def __eq__(self, other: object) -> bool:
        """Compare class and values."""
        if type(other) is not type(self):
            return NotImplemented
        return all(
            getattr(self, name) == getattr(other, name) for name in self._attributes()
        )

    def __repr__(self) -> str:
        values = ", ".join(
            f"{name}={getattr(self, name, None)!r}" for name in self._attributes()
        )
        return f"{type(self).__name__}({values})"


def refused(message: BaseMessage) -> EncodeError:
    """The error for a message that could not be encoded, with the name of the wrong field."""
    for rule in message.RULES:
        if rule.settable:
            value = getattr(message, rule.name, None)
            if complaint := rule.of(message).complaint(value):
                return EncodeError(f"{message.NAME}: {complaint}", rule.name, value)
    return EncodeError(f"{message.NAME}: cannot be sent: {shown(message)}")


def settled(message: AnyMessage) -> AnyMessage:
    """A copy of a message that could not be encoded, with values converted to plain types.

    Raises EncodeError if a value is illegal, or if the conversion changes nothing.
    """
    same, plain = True, object.__new__(type(message))
    for rule in message.RULES:
        if rule.settable:
            value, own = getattr(message, rule.name, None), rule.of(message)
            if own.complaint(value):
                raise refused(message) from None
            setattr(plain, rule.name, own.plain(value))
            same = same and getattr(plain, rule.name) is value
    if same:
        raise refused(message) from None
    return plain


def wrong_size(message: type[BaseMessage], payload: bytes) -> DecodeError:
    """The error for a payload of the wrong size."""
    legal = _span(message.MIN_SIZE, message.MAX_SIZE)
    if message.MIN_SIZE <= len(payload) <= message.MAX_SIZE:
        text = f"{message.NAME}: {len(payload)} data bytes do not match its counts or items"
    else:
        text = f"{message.NAME}: {len(payload)} data bytes, expected {legal}"
    return DecodeError(text, "length", data=payload)


def illegal(
    message: type[BaseMessage], name: str, seen: object, offset: int, payload: bytes
) -> DecodeError:
    """The error for an illegal value of a field; a negative offset counts from the end."""
    legal = next(
        (rule.legal for rule in message.RULES if rule.name == name), "another value"
    )
    text = f"{message.NAME}: {name}: received {shown(seen)}, expected {legal}"
    return DecodeError(
        text, "range", name, offset if offset >= 0 else len(payload) + offset, payload
    )


def short_of(message: type[BaseMessage], packet: bytes, size: int) -> DecodeError:
    """The error for a packet that is too short."""
    text = f"{message.NAME}: {len(packet)} bytes, expected at least {size}"
    return DecodeError(text, "truncated", offset=len(packet), data=packet)


def as_bytes(data: BytesLike) -> bytes:
    """A bytes-like object as bytes. Raises TypeError for other objects, including numbers and text."""
    return data if type(data) is bytes else bytes(memoryview(data))


class OpenEnum(int):
    """A named number. Numbers without a name are decoded as plain ints."""

    #: Members by number.
    members: ClassVar[dict[int, OpenEnum]]

    def __init_subclass__(cls) -> None:
        """Turn the numbers in the class body into members."""
        cls.members = {}
        for name in cls.__annotations__:
            member = cls(getattr(cls, name))
            cls.members[int(member)] = member
            setattr(cls, name, member)

    @property
    def name(self) -> str:
        """Name of the member in the class, "" if it has none."""
        return next(
            (
                name
                for name in type(self).__annotations__
                if getattr(type(self), name) == self
            ),
            "",
        )

    def __repr__(self) -> str:
        return (
            f"{type(self).__name__}.{self.name}"
            if self.name
            else f"{type(self).__name__}({int(self)})"
        )


def named(number: int) -> Any:
    """Declare a member in the body of an OpenEnum."""
    # Any: the class replaces it by a member, as annotated there.
    return number


class Bus:
    """The line and its nodes, according to the schema.

    Attributes:
        kind: master_slave, link, ring or host.
        first_node: lowest address of a node, None if frames have no address.
        last_node: highest address of a node, None if frames have no address.
        broadcast: address of all nodes at once, None if there is none.
        baud: usual speed of the line in bit/s, None if the document does not state it.
        bits_per_byte: bits on the line per byte: start, data, parity and stop bits.
    """

    __slots__ = (
        "baud",
        "bits_per_byte",
        "broadcast",
        "first_node",
        "kind",
        "last_node",
    )

    def __init__(
        self,
        kind: str,
        *,
        first_node: int | None = None,
        last_node: int | None = None,
        broadcast: int | None = None,
        baud: int | None = None,
        bits_per_byte: int = 10,
    ) -> None:
        self.kind = kind
        self.first_node = first_node
        self.last_node = last_node
        self.broadcast = broadcast
        self.baud = baud
        self.bits_per_byte = bits_per_byte

    def __repr__(self) -> str:
        names = ("first_node", "last_node", "broadcast", "baud", "bits_per_byte")
        return f"Bus({self.kind!r}, {', '.join(f'{name}={getattr(self, name)}' for name in names)})"


class Resync:
    """How a host comes back in step with its device, and what its commands act on.

    Attributes:
        command: command without data or effect, whose answer shows that both are in step.
        fill: byte that ends a packet which the device has begun.
        fills: other bytes that end the packets of some commands.
        rejected: check value of an answer that rejects its command, empty if there is none.
        selected: what others act on, such as an axis; empty if nothing is selected.
        selects: commands that select it, by its number.
        lost_by: commands after which it is unknown what is selected.
    """

    __slots__ = (
        "command",
        "fill",
        "fills",
        "lost_by",
        "rejected",
        "selected",
        "selects",
    )

    def __init__(
        self,
        command: str,
        *,
        fill: int = 0,
        fills: Mapping[str, int] | None = None,
        rejected: bytes = b"",
        selected: str = "",
        selects: Mapping[int, str] | None = None,
        lost_by: tuple[str, ...] = (),
    ) -> None:
        self.command = command
        self.fill = fill
        self.fills: Mapping[str, int] = fills or {}
        self.rejected = rejected
        self.selected = selected
        self.selects: Mapping[int, str] = selects or {}
        self.lost_by = lost_by


class Marking:
    """The layout of header and end byte, for nodes that forward a message while receiving it.

    Attributes:
        marker: bit that is set only in the header and the end byte.
        address_shift: position of the address in both.
        address_mask: mask of the address after the shift.
        id_shift: position of the message number.
        id_mask: mask of the message number after the shift.
        end: the message number of an end byte.
        most: maximum number of bytes between header and end.
    """

    __slots__ = (
        "address_mask",
        "address_shift",
        "end",
        "id_mask",
        "id_shift",
        "marker",
        "most",
    )

    def __init__(
        self,
        *,
        marker: int,
        address_shift: int,
        address_mask: int,
        id_shift: int,
        id_mask: int,
        end: int,
        most: int,
    ) -> None:
        self.marker = marker
        self.address_shift = address_shift
        self.address_mask = address_mask
        self.id_shift = id_shift
        self.id_mask = id_mask
        self.end = end
        self.most = most


class Many:
    """The end of several answers to one request; one of its attributes states it.

    Attributes:
        count: number of answers, or the greatest one if a field of the request says it.
        counted_by: that field, "" if there is none.
        until: field of the last answer, and its first and last number; None otherwise.
        reply: class of the reply that follows the last answer, None if there is none.
        within: byte times and seconds in which all answers come, None otherwise.
    """

    __slots__ = ("count", "counted_by", "reply", "until", "within")

    def __init__(
        self,
        *,
        count: int = 0,
        counted_by: str = "",
        until: tuple[str, int, int] | None = None,
        reply: MessageClass | None = None,
        within: tuple[float, float] | None = None,
    ) -> None:
        self.count = count
        self.counted_by = counted_by
        self.until = until
        self.reply = reply
        self.within = within


class OtherReply:
    """An answer other than the response of a command.

    Attributes:
        message: class of the message.
        means: refused, again, pending or done, unless a case says otherwise.
        switch: field that decides, "" if nothing does.
        cases: first and last number of the field, and what they mean.
        within: byte times and seconds from the first pending reply to the answer, None: as for the response.
        after: byte times and seconds until the request is sent again.
        echoes: fields that repeat the request, and what: an attribute of it, or a number.
    """

    __slots__ = ("after", "cases", "echoes", "means", "message", "switch", "within")

    def __init__(
        self,
        message: MessageClass,
        means: str = "refused",
        *,
        switch: str = "",
        cases: tuple[tuple[int, int, str], ...] = (),
        within: tuple[float, float] | None = None,
        after: tuple[float, float] = (0, 0),
        echoes: Mapping[str, str | int] | None = None,
    ) -> None:
        self.message = message
        self.means = means
        self.switch = switch
        self.cases = cases
        self.within = within
        self.after = after
        self.echoes: Mapping[str, str | int] = echoes or {}

    def meaning(self, reply: Any) -> str:  # Any: a message of the class
        """What a reply means; the first case that has its number counts."""
        if self.switch:
            number = int(getattr(reply, self.switch))
            for first, last, means in self.cases:
                if first <= number <= last:
                    return means
        return self.means

    def __repr__(self) -> str:
        return f"OtherReply({self.message.__name__}, {self.means!r})"


class Command:
    """A transaction: request, response, timing and repetition.

    Attributes:
        name: name in the schema.
        id: number of the request in the frame; that of each message is in its class.
        request: class of the request.
        response: class of the response, None if it is not answered.
        addressing: node, broadcast, either, answered_broadcast or none.
        response_byte_times: response time limit, in byte times on the line ...
        response_seconds: ... plus seconds.
        repeat_safe: whether the request may be repeated after a missing response.
        repeat_counter: field that distinguishes a repeat from a new request, "" if there is none.
        echoes: fields of the response that repeat the request, and what: an attribute of it, or a number.
        many: end of several answers, None if there is one.
        sizes: fields of the response, those of an earlier frame with their number of items, and the bits of
            an item if the count of bytes does not tell that number, otherwise 0.
        sized_by: class of that frame, by default of the request.
        steps: frames of a dialogue after its request: who sends it (send: the master), its class, and its
            time limit in byte times and seconds, None without one.
        replies: answers other than the response, by class.
        in_flight: maximum number of outstanding requests.
        section: section of the source document.
        confirmed: False if the source is weak: check it on the device.
        attributes: protocol-specific attributes.
    """

    __slots__ = (
        "addressing", "attributes", "confirmed", "echoes", "id", "in_flight", "many", "name",
        "repeat_counter",
        "repeat_safe", "replies", "request", "response", "response_byte_times", "response_seconds", "section",
        "sized_by", "sizes", "steps",
    )  # fmt: skip

    def __init__(
        self,
        name: str,
        id: int,
        request: MessageClass,
        response: MessageClass | None,
        *,
        addressing: str = "none",
        response_byte_times: float = 0,
        response_seconds: float = 0,
        repeat_safe: bool = False,
        repeat_counter: str = "",
        echoes: Mapping[str, str | int] | None = None,
        many: Many | None = None,
        sizes: tuple[tuple[str, str, int], ...] = (),
        sized_by: MessageClass | None = None,
        steps: tuple[tuple[str, MessageClass, tuple[float, float] | None], ...] = (),
        replies: tuple[OtherReply, ...] = (),
        in_flight: int = 1,
        section: str = "",
        confirmed: bool = True,
        attributes: Mapping[str, str | int | bool] | None = None,
    ) -> None:
        self.name = name
        self.id = id
        self.request = request
        self.response = response
        self.addressing = addressing
        self.response_byte_times = response_byte_times
        self.response_seconds = response_seconds
        self.repeat_safe = repeat_safe
        self.repeat_counter = repeat_counter
        self.echoes: Mapping[str, str | int] = echoes or {}
        self.many = many
        self.sizes = sizes
        self.sized_by = sized_by or request
        self.steps = steps
        by_class = {each.message: each for each in replies}
        self.replies: Mapping[MessageClass, OtherReply] = by_class
        self.in_flight = in_flight
        self.section = section
        self.confirmed = confirmed
        self.attributes = attributes or {}

    def __repr__(self) -> str:
        return f"Command({self.name!r}, {self.id:#04x})"
