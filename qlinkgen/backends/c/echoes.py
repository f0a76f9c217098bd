"""Statements with which a slave gives an answer what it repeats of its request."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import assert_never

from qlinkgen.backends.c.names import count_type, integer_type, literal, scalar_type, unsigned
from qlinkgen.model.fields import Record, Records, Value
from qlinkgen.model.frame import Frame, PartBits, id_pieces
from qlinkgen.model.message import Message
from qlinkgen.model.naming import member
from qlinkgen.model.transaction import Command, Proof, Repeated
from qlinkgen.model.types import Array, Blob, Scalar


def of_response(command: Command, sent: Message, answer: Message, address: str) -> list[str]:
    """The statements for the answer to a frame of a master, which is ``request``, in ``frame``.

    ``address`` is the member of ``frame`` with the address. Fields that may be absent are left to the
    program.
    """
    asked = {value.name: value for value in command.request.values} if sent is command.request else {}
    lines: list[str] = []
    for value, of in _repeated(command, answer):
        if isinstance(of, int):
            lines.append(f"response.{member(value.name)} = {_number(value, of)};")
        elif of in asked and not asked[of].field.conditional:
            lines += _copied(value, asked[of])
        elif of not in {each.name for each in command.request.values}:
            lines += _beside(value, of, address, "response", first=sent is command.request)
    return lines


def of_reply(commands: Sequence[Command], reply: Message, frame: Frame, address: str) -> list[str]:
    """The statements for a reply to several commands, ``own``, to the request in ``frame``.

    What is in the payload of the request is left to the program, which has given the reply.
    """
    lines: list[str] = []
    for value, of in _repeated(commands[0], reply):
        numbers = {each.request.id: each.repeated(reply)[value.name] for each in commands}
        if isinstance(of, int):
            piece = _piece(frame, value.field.repeats, numbers)
            if len(set(numbers.values())) == 1:
                lines.append(f"own.{member(value.name)} = {_number(value, of)};")
            elif piece is not None:
                lines.append(f"own.{member(value.name)} = {_of_id(value, piece)};")
        elif not any(of == each.name for command in commands for each in command.request.values):
            lines += _beside(value, of, address, "own", first=True)
    return lines


def _repeated(command: Command, answer: Message) -> Iterator[tuple[Value, str | int]]:
    """The fields of an answer that repeat something, and what; `slave_dispatch` fills values of frames."""
    found = command.repeated(answer)
    for value in answer.values:
        of = found.get(value.name)
        if of is not None and not isinstance(of, Proof) and not value.field.conditional:
            yield value, of


def _piece(frame: Frame, name: str, numbers: Mapping[int, Repeated]) -> PartBits | None:
    """The piece of an id with a number for each id, None if it is not in one place."""
    for piece in id_pieces(frame):
        mask = (1 << piece.bits) - 1
        if piece.name == name and all(number >> piece.at & mask == of for number, of in numbers.items()):
            return piece
    return None


def _number(value: Value, number: int) -> str:
    assert isinstance(value.type, Scalar)
    return literal(number, value.type.bits, signed=value.type.signed)


def _of_id(value: Value, piece: PartBits) -> str:
    """A piece of the id of a frame, as a number of a field."""
    assert isinstance(value.type, Scalar)
    shifted = f"(frame->{{id}} >> {piece.at}U)" if piece.at else "frame->{id}"
    mask = unsigned((1 << piece.bits) - 1, piece.bits, hexadecimal=True)
    return f"({scalar_type(value.type)})({shifted} & {mask})"


def _beside(value: Value, of: str, address: str, target: str, *, first: bool) -> list[str]:
    """The address of a frame, or a value of it; the latter is known while its request is handled."""
    assert isinstance(value.type, Scalar)
    if member(of) == address or f"{of}_" == address:
        kind = integer_type(value.type.bits, signed=value.type.signed)
        return [f"{target}.{member(value.name)} = ({kind})frame->{address};"]
    return [f"{target}.{member(value.name)} = frame->parts.{member(of)};"] if first else []


def _copied(value: Value, asked: Value) -> list[str]:
    """A value of the payload; an array has room for that of the request."""
    to, source = f"response.{member(value.name)}", f"request.{member(asked.name)}"
    kind, other = value.type, asked.type
    match kind:
        case Scalar() | Record():
            return [f"{to} = {source};"]
        case Blob() | Array() | Records():
            assert isinstance(other, Blob | Array | Records)
            number, before = str(other.length.maximum) + "U", list[str]()
            if not other.length.fixed:
                number = f"request.{asked.field.name}_{asked.field.quantity}"
            if not kind.length.fixed:
                count = f"response.{value.field.name}_{value.field.quantity}"
                before = [f"{count} = ({count_type(value.field.most)}){number};"]
            loop = f"for (size_t index = 0U; index < {number}; ++index) {{"
            return [*before, loop, f"    {to}[index] = {source}[index];", "}"]
        case _:
            assert_never(kind)
