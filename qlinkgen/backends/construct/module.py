"""From a protocol to the definitions of a module: one for each message, then the frames."""

from __future__ import annotations

from collections.abc import Iterator

from qlinkgen.backends.base import Options
from qlinkgen.backends.construct import payload
from qlinkgen.backends.construct.tree import Call, Definition, Hex, Node, Ref, Sequence, Table
from qlinkgen.model import checksum as catalogue
from qlinkgen.model import naming
from qlinkgen.model.frame import Checksum, DelimitedFrame, MarkedFrame, PacketFrame, Part, Stuffing
from qlinkgen.model.message import Direction, Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.types import Chunk, Scalar

#: Names of what is defined beside messages, enums and flags.
_OWN_NAMES = frozenset({"ALGORITHM", "LAYOUT", "MESSAGES", "REQUEST_FRAME", "RESPONSE_FRAME", "FRAME", "CRC"})


def definitions(protocol: Protocol, options: Options) -> tuple[Definition, ...]:
    """Everything that the module of a protocol defines."""
    return tuple(_definitions(protocol, options))


def _definitions(protocol: Protocol, options: Options) -> Iterator[Definition]:
    for group in protocol.enums:
        values = tuple((member.name, member.value) for member in group.members)
        yield Definition(naming.upper(group.name), Table(values), _comment(group.doc, group.section))
    for flags in protocol.flags:
        digits = (flags.bits + 3) // 4
        masks = tuple((member.name, Hex(1 << member.value, digits)) for member in flags.members)
        yield Definition(naming.upper(flags.name), Table(masks), _comment(flags.doc, flags.section))
    names = _message_names(protocol)
    kept = [
        each
        for each in protocol.messages
        if not options.only or {each.name, each.command} & set(options.only)
    ]
    for before, message in zip([None, *kept], kept, strict=False):
        again = before is not None and before.command == message.command
        comment = _comment(message.doc, message.section, confirmed=message.confirmed)
        yield Definition(names[message.name], _message(message), "" if again else comment, again)
    yield from _frames(protocol, [(names[each.name], each) for each in kept])


def _message_names(protocol: Protocol) -> dict[str, str]:
    """Constants of the messages; one that is taken gets a suffix."""
    types = [group.name for group in protocol.enums] + [flags.name for flags in protocol.flags]
    taken = _OWN_NAMES | set(map(naming.upper, types))
    names = {message.name: naming.upper(message.name) for message in protocol.messages}
    return {name: f"{upper}_MESSAGE" if upper in taken else upper for name, upper in names.items()}


def _message(message: Message) -> Call:
    settings: dict[str, Node] = {}
    if message.addresses:
        settings["addresses"] = Sequence(message.addresses)
    if not message.checksum:
        settings["checksum"] = False
    if message.empty_is_default:
        settings["empty_is_default"] = True
    return Call("Message", (message.name, Hex(message.id), *payload.fields(message)), tuple(settings.items()))


def _comment(doc: str, section: str, *, confirmed: bool = True) -> str:
    """Purpose and section; what is not confirmed says so."""
    words = [doc.strip()] if doc else []
    words += [f"({section})"] if section else []
    words += [] if confirmed else ["NOT CONFIRMED by a second source."]
    return " ".join(words)


# Frames


def _frames(protocol: Protocol, messages: list[tuple[str, Message]]) -> Iterator[Definition]:
    frame = protocol.frame
    check = _checksum(frame)
    if check is not None:
        yield Definition("ALGORITHM", _algorithm(check.algorithm), check.algorithm.name)
    if isinstance(frame, DelimitedFrame):
        yield Definition("LAYOUT", _layout(frame), _comment(frame.doc, frame.section))
    frames = []
    for direction in protocol.directions:
        name = "FRAME" if direction == "message" else f"{direction.upper()}_FRAME"
        chosen = Sequence(
            tuple(Ref(name) for name, each in messages if each.direction in (direction, "message"))
        )
        frames.append(Ref(name))
        yield Definition(name, _frame(protocol, direction, chosen))
    yield Definition("MESSAGES", Call("messages_of", tuple(frames)), "Payloads by full name.")


def _checksum(frame: DelimitedFrame | MarkedFrame | PacketFrame) -> Checksum | None:
    if isinstance(frame, DelimitedFrame):
        return part.checksum if (part := frame.part("checksum")) else None
    return frame.checksum


def _algorithm(algorithm: catalogue.Algorithm | catalogue.Sum) -> Call:
    if isinstance(algorithm, catalogue.Sum):
        return Call("Sum", (algorithm.width,), (("complement", True),) if algorithm.complement else ())
    digits = (algorithm.width + 3) // 4
    return Call(
        "CRC",
        (),
        (
            ("width", algorithm.width),
            ("poly", Hex(algorithm.poly, digits)),
            ("init", Hex(algorithm.init, digits)),
            ("refin", algorithm.refin),
            ("refout", algorithm.refout),
            ("xorout", Hex(algorithm.xorout, digits)),
        ),
    )


def _check(checksum: Checksum) -> Call:
    digits = (checksum.algorithm.width + 3) // 4
    return Call("Check", (Ref("ALGORITHM"), payload.integer(checksum.chunks), Hex(checksum.mask, digits)))


def _layout(frame: DelimitedFrame) -> Call:
    stuffing = (("stuffing", _stuffing(frame.stuffing)),) if frame.stuffing else ()
    return Call("Layout", tuple(_part(frame, part) for part in frame.parts), stuffing)


def _stuffing(stuffing: Stuffing) -> Call:
    exempt = (
        (("exempt", Sequence(stuffing.exempt)),) if stuffing.exempt and not stuffing.before_checksum else ()
    )
    only = (("payload_only", True),) if stuffing.before_checksum else ()
    return Call("Stuffing", (stuffing.after, bytes([stuffing.insert])), (*exempt, *only))


def _part(frame: DelimitedFrame, part: Part) -> Call:
    role = {"message": "id", "checksum": "check"}.get(part.role, part.role)
    over: tuple[str, ...] = part.checksum.over if part.checksum else part.counts
    return Call("Part", (part.name, role, _content(frame, part), *((Sequence(over),) if over else ())))


def _content(frame: DelimitedFrame, part: Part) -> Node:
    if part.role == "constant":
        return part.constant
    if part.role == "payload":
        most = part.max_size
        if frame.stuffing and frame.stuffing.before_checksum:
            most += most // len(frame.stuffing.after)  # the length counts what is inserted
        return (part.min_size, most)
    if part.checksum is not None:
        return _check(part.checksum)
    assert isinstance(part.scalar, Scalar)
    return payload.integer(part.scalar.chunks)


def _frame(protocol: Protocol, direction: Direction, messages: Sequence) -> Call:
    frame = protocol.frame
    if isinstance(frame, DelimitedFrame):
        return Call("DelimitedFrame", (Ref("LAYOUT"), messages))
    check = (("check", _check(frame.checksum)),) if frame.checksum else ()
    if isinstance(frame, MarkedFrame):
        settings: tuple[tuple[str, Node], ...] = (
            ("address_name", frame.address_name),
            ("marker", Hex(frame.marker)),
            ("address_bits", _pair(frame.address_bits)),
            ("id_bits", _pair(frame.id_bits)),
            ("end", frame.end_id),
        )
        return Call("MarkedFrame", (messages,), settings + check)
    if direction == "request":
        return Call("RequestPacket", (messages,))
    rejected = (("rejected", frame.rejected),) if frame.rejected is not None else ()
    return Call("ResponsePacket", (messages,), (*check, ("word", frame.word_size), *rejected))


def _pair(chunk: Chunk) -> tuple[int, int]:
    return chunk.shift, chunk.bits
