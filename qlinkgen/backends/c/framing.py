"""Messages in frames: functions that make a whole frame, and checks of what a received one carries."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from qlinkgen.backends.c.encode import size_terms
from qlinkgen.backends.c.names import Names, unsigned, unsigned_type
from qlinkgen.model.frame import DelimitedFrame, MarkedFrame, PacketFrame
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol


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


def allowed(message: Message, value: str, bits: int) -> str:
    """A condition that holds where the message may carry the address, "" where it may carry any."""
    top, terms = (1 << bits) - 1, []
    for first, last in message.addresses:
        low = [f"{value} >= {unsigned(first, bits)}"] if first else []
        high = [f"{value} <= {unsigned(last, bits)}"] if last < top else []
        if first == last:
            low, high = [f"{value} == {unsigned(first, bits)}"], []
        if not low and not high:
            return ""
        terms.append(" && ".join(low + high))
    return terms[0] if len(terms) == 1 else " || ".join(f"({term})" for term in terms)


def struct_parameter(names: Names, message: Message, *, const: bool) -> str:
    """The message as a parameter; one without values has no struct."""
    if not message.values:
        return ""
    return f"{'const ' if const else ''}{names.function(message)}_t *message, "


def to_frame(protocol: Protocol, names: Names, address: Address, message: Message) -> dict[str, Any]:
    """The function that makes the whole frame of a message."""
    struct = struct_parameter(names, message, const=True)
    lines: list[str] = []
    condition = allowed(message, address.name, address.bits) if address.name and message.addresses else ""
    if condition:
        refused = f"!({condition})"
        lines += [f"if ({refused}) {{", f"    return {names.upper}_ERROR_RANGE;", "}"]
    if isinstance(protocol.frame, PacketFrame):
        return _packet_to_frame(protocol.frame, names, message, struct)
    id_constant = f"{names.constant(message)}_ID"
    arguments = f"{id_constant}, {address.argument}"
    trailer = (
        ", true"
        if isinstance(protocol.frame, MarkedFrame) and message.checksum and protocol.frame.checksum
        else ""
    )
    if isinstance(protocol.frame, MarkedFrame) and protocol.frame.checksum and not trailer:
        trailer = ", false"
    if not message.fields:
        lines.append(f"return {names.prefix}_seal_({arguments}0u, wire, capacity{trailer});")
    else:
        lines = _declared(names, message, bool(struct), lines)
        seal = f"{names.prefix}_seal_({arguments}(size_t)size, wire, capacity{trailer})"
        lines.append(f"return (size < 0) ? size : {seal};")
    return {"parameters": struct + address.parameter, "lines": lines}


def _declared(names: Names, message: Message, has_struct: bool, lines: list[str]) -> list[str]:
    p, call = names.prefix, "message, " if has_struct else ""
    encode = f"{names.function(message)}_encode({call}{p}_place_(wire, capacity, payload_size), "
    if message.variable:
        size = [f"const size_t payload_size = {size_terms(message)};"]
        return [*size, "int size;", "", *lines, f"size = {encode}{p}_room_(capacity));"]
    constant = names.constant(message)
    encode = encode.replace("payload_size", f"{constant}_MAX_SIZE")
    room = [f"if (capacity < {constant}_MAX_FRAME_SIZE) {{", f"    return {names.upper}_ERROR_CAPACITY;", "}"]
    return ["int size;", "", *lines, *room, f"size = {encode}{constant}_MAX_SIZE);"]


def _packet_to_frame(frame: PacketFrame, names: Names, message: Message, struct: str) -> dict[str, Any]:
    p, has_sum = names.prefix, frame.checksum is not None
    call = "message, " if struct else ""
    if message.direction == "response":
        encode = f"{names.function(message)}_encode({call}wire, capacity)" if message.fields else "0"
        tail = f"{p}_close_(request_sum, (size_t)size, wire, capacity)" if has_sum else "size"
        parameters = struct + ("uint16_t request_sum, " if has_sum else "")
        lines = [f"const int size = {encode};", f"return (size < 0) ? size : {tail};"]
        return {"parameters": parameters.replace("uint16_t", "{sum_type}"), "lines": lines}
    lines = ["int size = 0;", "if (capacity == 0u) {", f"    return {names.upper}_ERROR_CAPACITY;", "}"]
    lines.append(f"wire[0] = {names.constant(message)}_ID;")
    if message.fields:
        lines.append(f"size = {names.function(message)}_encode({call}wire + 1, capacity - 1u);")
    lines.append("return (size < 0) ? size : size + 1;")
    return {"parameters": struct, "lines": lines}


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
