"""Names, types and literals of C."""

from __future__ import annotations

from functools import cache

from qlinkgen.model.message import Message
from qlinkgen.model.naming import address_member, snake, stem
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.transaction import Command
from qlinkgen.model.types import Characters, Enum, Flags, Scalar

_WIDTHS = (8, 16, 32, 64, 128)


@cache
def storage(bits: int) -> int:
    """Bits of the smallest C integer with at least ``bits`` bits."""
    return next(width for width in _WIDTHS if width >= bits)


def unsigned_type(bits: int) -> str:
    """The unsigned C type with at least ``bits`` bits."""
    return f"uint{storage(bits)}_t"


def integer_type(bits: int, *, signed: bool) -> str:
    """The C type of an integer with ``bits`` bits."""
    return f"int{storage(bits)}_t" if signed else unsigned_type(bits)


def is_wide(scalar: Scalar) -> bool:
    """Whether no integer of C holds the number, so that it is a struct of two."""
    return scalar.bits > 64


def halves(value: int) -> tuple[str, str]:
    """The upper and the lower 64 bits of a wide number in two's complement."""
    pattern = value & (1 << 128) - 1
    return unsigned(pattern >> 64, 64, hexadecimal=True), unsigned(
        pattern & (1 << 64) - 1, 64, hexadecimal=True
    )


def scalar_type(scalar: Scalar) -> str:
    """The C type of a struct member."""
    return "bool" if scalar.meaning == "bool" else integer_type(scalar.bits, signed=scalar.signed)


def count_type(most: int) -> str:
    """The C type of a number of items or bytes."""
    return unsigned_type(max(8, most.bit_length()))


def unsigned(value: int, bits: int, *, hexadecimal: bool = False) -> str:
    """A constant of an unsigned type; int may have 16 bits, so the suffix follows the width."""
    suffix = {8: "U", 16: "U", 32: "UL", 64: "ULL"}[storage(bits)]
    return (f"0x{value:0{storage(bits) // 4}X}" if hexadecimal else str(value)) + suffix


def literal(value: int, bits: int, *, signed: bool) -> str:
    """A constant of any type; the minimum of a signed type has no literal."""
    if not signed:
        return unsigned(value, bits)
    width = storage(bits)
    if value == -(1 << (width - 1)):
        return f"INT{width}_MIN"
    return str(value) + {8: "", 16: "", 32: "L", 64: "LL"}[width]


def scalar_literal(scalar: Scalar, value: int) -> str:
    """A constant of a scalar's type."""
    if isinstance(text := scalar.meaning, Characters):
        letters = value.to_bytes(text.number, "big")
        return f"{{{', '.join(unsigned(each, 8, hexadecimal=True) for each in letters)}}}"
    if scalar.meaning == "bool":
        return "true" if value else "false"
    if is_wide(scalar):
        return "{{{}, {}}}".format(*halves(value))
    return literal(value, scalar.bits, signed=scalar.signed)


def bracketed(number: str) -> str:
    """A number as the text of a macro: in parentheses if it has a sign."""
    return f"({number})" if number.startswith("-") else number


def grouped(expression: str) -> str:
    """An expression as an operand: in parentheses unless it is one word or a call."""
    return f"({expression})" if " " in expression else expression


class Names:
    """Names of one header, which begin with the name of the protocol."""

    def __init__(self, protocol: Protocol) -> None:
        """Collect the names of enums and flags."""
        self.prefix = protocol.name
        self.upper = protocol.name.upper()
        self.address = address_member(protocol.address_name or "")
        self._constants = {
            **{each.name: stem(self.prefix, each.name, "enum") for each in protocol.enums},
            **{each.name: stem(self.prefix, each.name, "flags") for each in protocol.flags},
        }
        self._messages = protocol.messages
        self._commands = {
            message.name: command
            for command in protocol.commands
            for message in (command.request, command.response)
            if message is not None and message.command == command.name
        }

    def type_stem(self, name: str) -> str:
        """A named type as part of a name; a suffix avoids clashes with other names of the header."""
        name = stem(self.prefix, name, "type")
        taken = {*self._constants.values()}
        for message in self._messages:
            own = self.stem(message)
            taken |= {own, *(f"{own}_{value.name}" for value in message.values)}
        while name in taken:
            name += "_type"
        return name

    def record(self, name: str) -> str:
        """Prefix of the functions and the struct of a record."""
        return f"{self.prefix}_{self.type_stem(name)}"

    def command_of(self, message: Message) -> Command | None:
        """The transaction of a message."""
        return self._commands.get(message.name)

    def stem(self, message: Message) -> str:
        """``motion.request`` as part of a name; a suffix avoids clashes with enums and flags."""
        name = stem(self.prefix, snake(message.name), "message")
        return f"{name}_message" if name in self._constants else name

    def constants(self, each: Enum | Flags) -> str:
        """An enum or flags as part of a name; a suffix avoids clashes with other names of the header."""
        return self._constants[each.name]

    def function(self, message: Message) -> str:
        """Prefix of the functions and the struct of a message."""
        return f"{self.prefix}_{self.stem(message)}"

    def constant(self, message: Message) -> str:
        """Prefix of the macros of a message."""
        return self.function(message).upper()
