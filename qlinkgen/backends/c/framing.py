"""Messages in frames: functions that make a whole frame, and checks of what a received one carries."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from qlinkgen.backends.c.extents import size_terms
from qlinkgen.backends.c.names import Names, unsigned, unsigned_type
from qlinkgen.model.frame import DelimitedFrame, MarkedFrame, PacketFrame
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.types import Array, Blob


@dataclass(frozen=True, slots=True)
class Address:
    """The address of a frame in C: its name and type, "" where there is none."""

    name: str
    bits: int

    @property
    def parameter(self) -> str:
        """The parameter of a function."""
        return f"{unsigned_type(self.bits)} {self.name}, " if self.name else ""

    @property
    def argument(self) -> str:
        """The argument of a call."""
        return f"{self.name}, " if self.name else ""


@dataclass(frozen=True, slots=True)
class AddressGroup:
    """Addresses that several messages have in common, as part of a name, as text and as a condition."""

    name: str
    text: str
    condition: str


def allowed(message: Message, value: str, bits: int) -> str:
    """A condition that holds where the message may carry the address, "" where it may carry any."""
    top, terms = (1 << bits) - 1, []
    for first, last in message.addresses:
        bounds = [f"{value} >= {unsigned(first, bits)}"] if first else []
        bounds += [f"{value} <= {unsigned(last, bits)}"] if last < top else []
        if first == last:
            bounds = [f"{value} == {unsigned(first, bits)}"]
        if not bounds:
            return ""
        terms.append(" && ".join(f"({bound})" for bound in bounds) if len(bounds) > 1 else bounds[0])
    return terms[0] if len(terms) == 1 else " || ".join(f"({term})" for term in terms)


def struct_parameter(names: Names, message: Message, *, const: bool) -> str:
    """The message as a parameter; one without values has no struct."""
    if not message.values:
        return ""
    return f"{'const ' if const else ''}{names.function(message)}_t *message, "


def address_group(message: Message, address: Address) -> AddressGroup | None:
    """The set of addresses that a message may have, None where it may have any."""
    condition = allowed(message, address.name, address.bits) if address.name and message.addresses else ""
    if not condition:
        return None
    ranges = [(str(first), str(last)) for first, last in message.addresses]
    name = "_".join(first if first == last else f"{first}_to_{last}" for first, last in ranges)
    text = ", ".join(first if first == last else f"{first}..{last}" for first, last in ranges)
    return AddressGroup(name, f"the {address.name} {text}", condition)


def to_frame(protocol: Protocol, names: Names, address: Address, message: Message) -> dict[str, Any]:
    """The function that makes the whole frame of a message."""
    struct = struct_parameter(names, message, const=True)
    if isinstance(protocol.frame, PacketFrame):
        return _packet_to_frame(protocol.frame, names, message, struct)
    lines, size = _payload_lines(names, message, bool(struct)) if message.fields else ([], "0")
    group = address_group(message, address)
    seal = f"{names.prefix}_seal_{group.name}_" if group else f"{names.prefix}_seal_"
    arguments = f"{names.constant(message)}_ID, {address.argument}wire, capacity, {size}"
    lines.append(f"return {seal}({arguments}{_checked(protocol, message)});")
    return {"parameters": struct + address.parameter, "lines": lines}


def _checked(protocol: Protocol, message: Message) -> str:
    """Whether a check value follows, where some messages have none."""
    if not isinstance(protocol.frame, MarkedFrame) or not protocol.frame.checksum:
        return ""
    return ", true" if message.checksum else ", false"


def _payload_lines(names: Names, message: Message, has_struct: bool) -> tuple[list[str], str]:
    """Write the payload where there is room; what does not fit is refused when the frame is completed."""
    p, call, constant = names.prefix, "message, " if has_struct else "", names.constant(message)
    size, fits = f"{constant}_MAX_SIZE", f"capacity >= {constant}_MAX_FRAME_SIZE"
    lines = []
    if message.variable:
        lines.append(f"const size_t payload_size = {size_terms(message, 'message->')};")
        size, fits = "payload_size", f"{p}_fits_(capacity, payload_size)"
    start = f"(int){size}"
    if message.variable and is_wide(message):
        start = f"(payload_size > {constant}_MAX_SIZE) ? (int){names.upper}_ERROR_LENGTH : {start}"
    encode = f"{names.function(message)}_encode({call}{p}_place_(wire, capacity, {size}), {size})"
    lines += [f"int size = {start};", "", f"if ({fits}) {{", f"    size = {encode};", "}"]
    return lines, "size"


def is_wide(message: Message) -> bool:
    """A count that is wrong can make a size which no int holds."""
    return any(
        isinstance(each.type, Array | Blob) and each.type.length.maximum > 0xFF for each in message.variable
    )


def _packet_to_frame(frame: PacketFrame, names: Names, message: Message, struct: str) -> dict[str, Any]:
    call = "message, " if struct else ""
    if message.direction == "response":
        return _packet_answer(frame, names, message, struct)
    lines = ["int size;", ""] if message.fields else []
    lines += ["if (capacity == 0U) {", f"    return {names.upper}_ERROR_CAPACITY;", "}"]
    lines.append(f"wire[0] = {names.constant(message)}_ID;")
    if message.fields:
        lines.append(f"size = {names.function(message)}_encode({call}&wire[1], capacity - 1U);")
    lines.append("return (size < 0) ? size : (size + 1);" if message.fields else "return 1;")
    return {"parameters": struct, "lines": lines}


def _packet_answer(frame: PacketFrame, names: Names, message: Message, struct: str) -> dict[str, Any]:
    """An answer is its payload, and a check value where there is one."""
    has_sum, size = frame.checksum is not None, "(size_t)size" if message.fields else "0U"
    whole = f"{names.prefix}_close_(request_sum, {size}, wire, capacity)" if has_sum else "size"
    if message.fields:
        encode = f"{names.function(message)}_encode({'message, ' if struct else ''}wire, capacity)"
        lines = [f"const int size = {encode};", f"return (size < 0) ? size : {whole};"]
    else:
        lines = [f"return {whole};"] if has_sum else ["(void)wire;", "(void)capacity;", "return 0;"]
    return {"parameters": struct + ("{sum_type} request_sum, " if has_sum else ""), "lines": lines}


def checks(names: Names, address: Address, messages: tuple[Message, ...]) -> list[dict[str, Any]]:
    """What a received frame of each message has to satisfy."""
    return [
        {
            "constant": names.constant(message),
            "function": names.function(message),
            "has_struct": bool(message.values),
            "has_bytes": bool(message.fields),
            "allowed": allowed(message, f"frame->{address.name}", address.bits)
            if address.name and message.addresses
            else "",
            "admits": allowed(message, address.name, address.bits)
            if address.name and message.addresses
            else "",
        }
        for message in messages
    ]


def address_of(protocol: Protocol, name: str) -> Address:
    """The address of a protocol's frames."""
    frame = protocol.frame
    if isinstance(frame, DelimitedFrame) and (part := frame.part("address")) and part.scalar:
        return Address(name, part.scalar.bits)
    return Address(name, 8) if isinstance(frame, MarkedFrame) else Address("", 8)
