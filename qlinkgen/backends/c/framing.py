"""Messages in frames: functions that encode a whole frame, and checks of received frames."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.c.checks import condition, refused_when_received
from qlinkgen.backends.c.names import Names, storage, unsigned, unsigned_type
from qlinkgen.backends.c.separated import constant_size
from qlinkgen.backends.c.settled import differing
from qlinkgen.backends.c.sizes import size_terms
from qlinkgen.model.message import Direction, Message
from qlinkgen.model.naming import member
from qlinkgen.plan.ends import ByMark
from qlinkgen.plan.expr import OneOf
from qlinkgen.plan.framing import FramePlan
from qlinkgen.plan.payload import Member, PayloadPlan
from qlinkgen.plan.tree import MessagePlan, Plan


@dataclass(frozen=True, slots=True)
class Address:
    """The address of a frame in C: its name, "" if there is none, and its bits; and the values of the frame.

    Attributes:
        values_type: type of the values of the frame, "" if there are none.
        refused: conditions that hold if a value of ``frame`` is out of range.
        values: the values of frames by name.
    """

    name: str
    bits: int
    values_type: str = ""
    refused: tuple[str, ...] = ()
    values: Mapping[str, Member] = field(default_factory=dict)

    @property
    def parameter(self) -> str:
        """Both as parameters of a function."""
        parts = f"const {self.values_type} *parts, " if self.values_type else ""
        return (f"{unsigned_type(self.bits)} {self.name}, " if self.name else "") + parts

    @property
    def argument(self) -> str:
        """Both as arguments of a call."""
        return (f"{self.name}, " if self.name else "") + ("parts, " if self.values_type else "")


@dataclass(frozen=True, slots=True)
class AddressGroup:
    """Legal addresses shared by several messages, as part of a name, as text and as a condition."""

    name: str
    text: str
    condition: str


@dataclass(frozen=True, slots=True)
class Function:
    """A function that encodes or decodes a whole frame: its specific parameters, and its statements."""

    parameters: str
    lines: list[str]


@dataclass(frozen=True, slots=True)
class Expected:
    """Conditions on a received frame of a message.

    Attributes:
        received: the arguments of the function that decodes the payload in ``frame`` to a struct ``message``.
        allowed: condition on the address in ``frame``, "" if every address is legal.
        address_allowed: the condition on the address in a parameter.
    """

    constant: str
    function: str
    has_struct: bool
    has_bytes: bool
    received: str
    allowed: str
    address_allowed: str


def allowed(addresses: OneOf | None, value: str, bits: int) -> str:
    """The condition for a legal address, "" if every address is legal."""
    top, terms = (1 << bits) - 1, []
    for each in addresses.ranges if addresses and value else ():
        bounds = [f"{value} >= {unsigned(each.low, bits)}"] if each.low else []
        bounds += [f"{value} <= {unsigned(each.high, bits)}"] if each.high < top else []
        if each.low == each.high:
            bounds = [f"{value} == {unsigned(each.low, bits)}"]
        if not bounds:
            return ""
        terms.append(" && ".join(f"({bound})" for bound in bounds) if len(bounds) > 1 else bounds[0])
    return " || ".join(f"({term})" for term in terms) if len(terms) > 1 else "".join(terms)


def struct_parameter(names: Names, message: Message, *, const: bool) -> str:
    """The message as a parameter; "" for a message without values."""
    if not message.values:
        return ""
    return f"{'const ' if const else ''}{names.function(message)}_t *message, "


def payload_parameters(names: Names, message: Message, *, const: bool) -> str:
    """What functions of the payload take: the message, and the values of its frame that decide about it."""
    parts = f"const {names.prefix}_parts_t *parts, " if message.decided_by else ""
    return struct_parameter(names, message, const=const) + parts


def payload_arguments(message: Message, struct: str = "message", parts: str = "parts") -> str:
    """The arguments for `payload_parameters`, followed by a comma."""
    given = [*([struct] if message.values else []), *([parts] if message.decided_by else [])]
    return "".join(f"{each}, " for each in given)


def address_group(message: MessagePlan, address: Address) -> AddressGroup | None:
    """The legal addresses of a message, None if every value of the C type is legal."""
    condition = allowed(message.allowed, address.name, storage(address.bits))
    if not condition or message.allowed is None:
        return None
    ranges = [(str(each.low), str(each.high)) for each in message.allowed.ranges]
    name = "_".join(first if first == last else f"{first}_to_{last}" for first, last in ranges)
    text = ", ".join(first if first == last else f"{first}..{last}" for first, last in ranges)
    return AddressGroup(name, f"{address.name} {text}", condition)


def to_frame(frame: FramePlan, names: Names, own: str, address: Address, message: MessagePlan) -> Function:
    """The function that encodes the whole frame of a message; ``own`` begins the names of what it calls."""
    stated = message.message
    struct = struct_parameter(names, stated, const=True)
    wrong = [
        line
        for test in differing(stated, address.values, "parts->")
        for line in (f"if ({test}) {{", f"    return {names.upper}_ERROR_RANGE;", "}")
    ]
    lines, size = _payload_lines(names, own, message) if stated.fields else ([], "0")
    group = address_group(message, address)
    wrap = f"{own}_wrap_{group.name}_" if group else f"{own}_wrap_"
    arguments = f"{names.constant(stated)}_ID, {address.argument}wire, capacity, {size}"
    lines.append(f"return {wrap}({arguments}{_checked(frame, message)});")
    return Function(struct + address.parameter, [*wrong, *lines])


def _checked(frame: FramePlan, message: MessagePlan) -> str:
    """The argument for a check value, if only some messages have one."""
    if not isinstance(frame.end, ByMark) or not frame.check:
        return ""
    return ", true" if message.checked else ", false"


def _payload_lines(names: Names, own: str, plan: MessagePlan) -> tuple[list[str], str]:
    """Statements that encode the payload if it fits; otherwise wrapping fails."""
    call, message = payload_arguments(plan.message), plan.message
    constant = names.constant(message)
    if is_trimmed(plan.payload):
        return _trimmed_lines(names, own, plan, call), "size"
    size, fits = f"{constant}_MAX_SIZE", f"capacity >= {constant}_MAX_FRAME_SIZE"
    if any(each.envelope.conditional for each in plan.frames):
        fits = f"{own}_fits_(capacity, {size})"
    lines = []
    if message.variable:
        size = size_terms(message, "message->")
        if plan.payload.walked:
            size = (
                f"{names.function(message)}_size_({call.removesuffix(', ')})"
                if call
                else f"{constant_size(plan.payload)}U"
            )
        lines.append(f"const size_t payload_size = {size};")
        size, fits = "payload_size", f"{own}_fits_(capacity, payload_size)"
    start = f"(int){size}"
    if message.variable and is_wide(plan):
        start = f"(payload_size > {constant}_MAX_SIZE) ? (int){names.upper}_ERROR_LENGTH : {start}"
    encode = f"{names.function(message)}_encode({call}{own}_place_(wire, capacity, {size}), {size})"
    lines += [f"int size = {start};", "", f"if ({fits}) {{", f"    size = {encode};", "}"]
    return lines, "size"


def _trimmed_lines(names: Names, own: str, plan: MessagePlan, call: str) -> list[str]:
    """As `_payload_lines`: the size of what is sent is known only after the whole payload is encoded."""
    p = names.prefix
    return [
        f"uint8_t payload[{names.constant(plan.message)}_MAX_SIZE];",
        f"const int size = {names.function(plan.message)}_encode({call}payload, sizeof payload);",
        "",
        f"if ((size > 0) && {own}_fits_(capacity, (size_t)size)) {{",
        f"    {p}_copy_({own}_place_(wire, capacity, (size_t)size), payload, (size_t)size);",
        "}",
    ]


def is_trimmed(payload: PayloadPlan) -> bool:
    """Whether zeros at the end may not be sent."""
    return payload.trim is not None and payload.least < payload.most


def is_wide(message: MessagePlan) -> bool:
    """Whether a wrong count can result in a size that exceeds an int."""
    payload = message.payload
    varied = any(segment.records for segment in payload.segments)
    return varied or any(run.length.maximum > 0xFF for run in payload.runs)


def expected(names: Names, address: Address, message: MessagePlan) -> Expected:
    """The conditions on a received frame of a message."""
    refused = [*address.refused, *differing(message.message, address.values, "frame->parts.")]
    return Expected(
        constant=names.constant(message.message),
        function=names.function(message.message),
        has_struct=bool(message.message.values),
        has_bytes=bool(message.message.fields),
        received=payload_arguments(message.message, "&message", "&frame->parts")
        + "frame->payload, frame->size",
        allowed=_both(
            allowed(message.allowed, address.name and f"frame->{address.name}", address.bits),
            f"!({condition(refused)})" if refused else "",
        ),
        address_allowed=allowed(message.allowed, address.name, address.bits),
    )


def _both(first: str, second: str) -> str:
    return f"({first}) && {second}" if first and second else first or second


def address_of(plan: Plan, name: str, direction: Direction = "response") -> Address:
    """The address of the frames of a direction; one that shares a byte has the type of a byte."""
    frame = plan.around(direction)
    values = frame.values
    refused = [
        test
        for each in values.values()
        for test in refused_when_received(each.number, f"frame->parts.{member(each.name)}")
    ]
    kind = f"{plan.protocol.name}_parts_t" if values else ""
    sizes = [bits.bits for each in frame.every for bits in each.envelope.address[:1]]
    return Address(name, sizes[0] if sizes else 8, kind, tuple(refused), values)
