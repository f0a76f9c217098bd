"""The text of the fuzz targets: common parts of all three, for one protocol or several in one program.

The files cfuzz_*.c in this folder are templates; @p@ is replaced by the name of the protocol, other
placeholders by text from this module.
"""

from __future__ import annotations

from pathlib import Path

from qlinkgen.backends.c.interface import Interface, interface
from qlinkgen.backends.c.names import integer_type, scalar_literal, scalar_type
from qlinkgen.model import naming
from qlinkgen.model.message import Message, Value
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.types import Array, Bits, Blob, Reserved, Scalar
from qlinkgen.plan import plan_of
from qlinkgen.plan.ends import Hunt, Rescan
from qlinkgen.plan.transparency import FrameStuffing


def _ignores_bits(message: Message) -> bool:
    """Whether some received bits are ignored, so that encoding again may change them."""
    for each in message.fields:
        kind = each.type
        if isinstance(kind, Scalar) and isinstance(kind.role, Reserved):
            return True
        if isinstance(kind, Bits):
            kept = sum(member.mask for member in kind.members)
            if kept != (1 << kind.container.bits) - 1:
                return True
    return False


class Harness:
    """Common functions of the targets of one protocol, and a way to fill in templates."""

    def __init__(self, protocol: Protocol) -> None:
        """Use the interface of the header."""
        self.protocol = protocol
        self.c: Interface = interface(protocol)
        self.frame = plan_of(protocol).frame
        self.first, self.second = (*protocol.directions, *protocol.directions)[:2]

    def part(self, file: str, /, **places: str) -> str:
        """A template with its placeholders filled in."""
        return self.filled(Path(__file__).with_name(f"cfuzz_{file}.c").read_text("utf-8"), **places)

    def filled(self, text: str, /, **places: str) -> str:
        """The text with its placeholders filled in, common ones last."""
        common = {
            "id": self.c.id,
            "address_size": str(self.c.address_bits // 8),
            "first": self.first,
            "second": self.second,
            "messages": str(len(self.protocol.messages)),
            "sum_bits": str(self.c.sum_bits),
            "listener": self.c.listener,
            "p": self.c.prefix,
            "P": self.c.upper,
        }
        for key, value in (*places.items(), *common.items()):
            text = text.replace(f"@{key}@", value)
        return text

    def text(self) -> str:
        """Functions for each message, and functions that select one."""
        ahead = "\nstatic bool @p@_whole_(bool answer, const uint8_t *wire, size_t size);\n"
        messages = "".join(self._message(message) for message in self.protocol.messages)
        return self.filled(ahead) + messages + self._choices() + self._whole()

    def address(self, value: str) -> str:
        """The statement that sets the address of a frame."""
        return f"    frame.{self.c.address} = (uint{self.c.address_bits}_t){value};" if self.c.address else ""

    def flag(self, message: Message) -> str:
        """The statement that sets `answer` for a message."""
        return "true" if message.direction == "response" else "false"

    # One message

    def put(self, message: Message, struct: str, to: str, capacity: str) -> str:
        """The call that encodes a message, if it has fields."""
        own = f"{struct}, " if message.values else ""
        return f"{self.c.function(message)}_encode({own}{to}, {capacity})" if message.fields else "0"

    def get(self, message: Message, struct: str, source: str, size: str) -> str:
        """The call that decodes a message."""
        own = f"{struct}, " if message.values else ""
        if message.fields:
            return f"{self.c.function(message)}_decode({own}{source}, {size})"
        return f"(({size}) == 0u ? {self.c.upper}_OK : {self.c.upper}_ERROR_LENGTH)"

    def _message(self, message: Message) -> str:
        function, values = self.c.function(message), message.values
        bits = self._whom_bits(message)
        own, whom = "&message, " if values else "", f"(uint{bits}_t)whom, " if bits else ""
        return self.part(
            "message",
            name=message.name,
            fill=self._fill(message),
            f=function,
            C=self.c.constant(message),
            type=f"{function}_t" if values else "char",
            zero="" if values else " = 0",
            get_first=self.get(message, "&first", "bytes", "size"),
            put_first=self.put(message, "&first", "again", "sizeof again"),
            get_second=self.get(message, "&second", "again", "(size_t)written"),
            put_second=self.put(message, "&second", "once_more", "sizeof once_more"),
            exact="false" if _ignores_bits(message) else "size != 0u" if message.empty_is_default else "true",
            whom_size=str(bits // 8),
            fill_message=f"    {function}_fill_(&message, input);" if values else "",
            put_any=self.put(message, "&message", "wire", "capacity"),
            to_frame=f"{function}_to_frame({own}{whom}wire, capacity)",
            taken_apart=self._taken_apart(message, own, whom),
            scales="\n".join(line for value in values for line in self._scale(message, value)),
        )

    def _whom_bits(self, message: Message) -> int:
        return self.c.sum_bits if self._by_sum(message) else self.c.address_bits

    def _by_sum(self, message: Message) -> bool:
        return self.c.packets and message.direction == "response"

    def _taken_apart(self, message: Message, own: str, whom: str) -> str:
        if self._by_sum(message):
            return (
                f"{self.c.function(message)}_from_frame({own}{whom}wire, (size_t)size) == {self.c.upper}_OK"
            )
        return f"{self.c.prefix}_whole_({self.flag(message)}, wire, (size_t)size)"

    def _fill(self, message: Message) -> str:
        if not message.values:
            return ""
        function = self.c.function(message)
        lines = [f"    {line}" for value in message.values for line in self._filled(value)]
        return "\n".join(
            [
                f"static inline void {function}_fill_({function}_t *message, input_t *input)",
                "{",
                *lines,
                "}",
                "",
            ]
        )

    def _filled(self, value: Value) -> list[str]:
        """Statements that set a value of a message from the input, legal or not."""
        kind, member = value.type, f"message->{naming.member(value.name)}"
        if isinstance(kind, Scalar):
            if scalar_type(kind) == "bool":
                return [f"{member} = (take(input) & 1u) != 0u;"]
            return [f"{member} = ({scalar_type(kind)})take_number(input, {self.c.width(kind)}u);"]
        assert isinstance(kind, Array | Blob)
        lines = []
        if not kind.length.fixed:
            width = self.c.count_width(kind.length.maximum)
            count = f"message->{self.c.count_member(value.field)}"
            lines = [f"{count} = (uint{8 * width}_t)take_number(input, {width}u);"]
        item = integer_type(kind.item.bits, signed=kind.item.signed) if isinstance(kind, Array) else "uint8_t"
        return [
            *lines,
            f"for (size_t index = 0u; index < {kind.length.maximum}u; ++index) {{",
            f"    {member}[index] = ({item})take_number(input, sizeof {member}[0]);",
            "}",
        ]

    def _scale(self, message: Message, value: Value) -> list[str]:
        """Raw to physical and back is the identity, and no double becomes a raw value out of range."""
        kind, ok = value.type, f"{self.c.upper}_OK"
        if not isinstance(kind, Scalar) or kind.scaling is None:
            return []
        function = self.c.conversions(message, value.name, kind)
        member = f"message.{naming.member(value.name)}"
        constant = function.upper()
        least, most = scalar_literal(kind, kind.minimum), scalar_literal(kind, kind.maximum)
        # A double holds all whole numbers of 53 bits.
        exact = kind.bits < 53
        inside = f"IN_RANGE({member}, {least}, {most})" if exact else "true"
        return [
            "    {",
            f"        {scalar_type(kind)} raw = 0;",
            f"        double physical = {function}_physical({member});",
            f"        int status = {function}_raw(physical, &raw);",
            f"        REQUIRE((status == {ok}) == {inside});",
            *([f"        REQUIRE(status != {ok} || raw == {member});"] if exact else []),
            f"        physical = take_steps(input, (double)({least}), (double)({most}));",
            f"        physical = (physical * {constant}_FACTOR + {constant}_BIAS) / {constant}_DIVISOR;",
            f"        status = {function}_raw(physical, &raw);",
            f"        REQUIRE(status != {ok} || IN_RANGE(raw, {least}, {most}));",
            "    }",
        ]

    # All messages

    def sides(self) -> list[tuple[str, str]]:
        """Directions, and the condition on `answer` for each; a ring has only one direction."""
        if self.first == self.second:
            return [(self.first, "answer || !answer")]
        return [(self.first, "!answer"), (self.second, "answer")]

    def _choices(self) -> str:
        """Functions that call a function of the message with a direction and an id."""
        found = ["\nstatic inline unsigned @p@_find_(bool answer, uint8_t id)", "{"]
        messages = self.protocol.messages
        for direction, condition in self.sides():
            chosen = [m for m in messages if m.direction in (direction, "message")]
            rows = [f"    case {self.c.constant(m)}_ID: return {messages.index(m)}u;" for m in chosen]
            found += [
                f"    if ({condition}) {{",
                "    switch (id) {",
                *rows,
                "    default: break;",
                "    }",
                "    }",
            ]
        found += [f"    return {len(messages)}u;", "}"]
        again, made = (
            "const uint8_t *bytes, size_t size",
            "input_t *input, uint64_t whom, uint8_t *wire, size_t capacity",
        )
        lines = [
            *found,
            *self._each("bool", "again", again, "again_(bytes, size)", "false"),
            *self._each("int", "made", made, "made_(input, whom, wire, capacity)", "-1"),
            *self._sizes(),
            *self._each("void", "any", "input_t *input", "any_(input)", ""),
        ]
        return self.filled("\n".join(lines) + "\n")

    def _each(self, kind: str, name: str, parameters: str, call: str, otherwise: str) -> list[str]:
        does = "" if kind == "void" else "return "
        rows = [
            f"    case {number}u: {does}{self.c.function(message)}_{call}; break;"
            for number, message in enumerate(self.protocol.messages)
        ]
        head = f"static inline {kind} @p@_{name}_(unsigned found, {parameters})"
        end = [f"    return {otherwise};"] if otherwise else []
        return [head, "{", "    switch (found) {", *rows, "    default: break;", "    }", *end, "}"]

    def _sizes(self) -> list[str]:
        rows = [
            f"    case {number}u: return {self.c.constant(message)}_MAX_SIZE;"
            for number, message in enumerate(self.protocol.messages)
        ]
        head = "static inline size_t @p@_most_(unsigned found)"
        return [head, "{", "    switch (found) {", *rows, "    default: return 0u;", "    }", "}"]

    def _whole(self) -> str:
        """The function that decodes any bytes as a whole frame, and encodes a decoded one again."""
        decoded = self.frame_decode("frame", "answer ? @P@_RESPONSE : @P@_REQUEST", "wire", "size")
        checks = []
        for name, condition in self.sides():
            checks += [
                f"    if (({condition}) && @p@_{name}_check(&frame) == @P@_OK) {{",
                "        REQUIRE(@p@_again_(@p@_find_(answer, frame.@id@), frame.payload, frame.size));",
                "    }",
            ]
        lines = [
            "\nstatic bool @p@_whole_(bool answer, const uint8_t *wire, size_t size)",
            "{",
            "    @p@_frame_t frame;",
            *(["    uint8_t buffer[@P@_DECODE_BUFFER_SIZE];"] if self.c.unpacks else []),
            "    (void)answer;",
            f"    if ({decoded} != @P@_OK) {{",
            "        return false;",
            "    }",
            "    REQUIRE(frame.size <= @P@_MAX_PAYLOAD_SIZE);",
            *self._made_again(),
            *checks,
            "    return true;",
            "}",
        ]
        return self.filled("\n".join(lines) + "\n")

    def _made_again(self) -> list[str]:
        if not isinstance(self.frame.receiver, Hunt | Rescan):
            return []
        made = self.frame_encode("frame.payload", "frame.size", "again", "sizeof again")
        same = "made == (int)size"
        stuffing = self.frame.transparency
        if isinstance(stuffing, FrameStuffing):
            # An inserted byte after the last byte of a frame may be missing.
            same = f"({same} || (made == (int)size + 1 && again[size] == {stuffing.rule.insert}u))"
        return [
            "    {",
            "        uint8_t again[2u * @P@_MAX_FRAME_SIZE];",
            f"        const int made = {made};",
            f"        REQUIRE({same} && memcmp(again, wire, size) == 0);",
            "    }",
        ]

    def frame_decode(self, frame: str, direction: str, wire: str, size: str) -> str:
        """The call that decodes a whole frame, using `buffer`."""
        directed, buffer = f"{direction}, " if self.c.directed else "", "buffer, " if self.c.unpacks else ""
        return f"{self.c.prefix}_frame_decode({directed}&{frame}, {buffer}{wire}, {size})"

    def frame_encode(self, payload: str, size: str, wire: str, capacity: str) -> str:
        """The call that encodes a frame with the id and address of `frame`."""
        whom = f"frame.{self.c.address}, " if self.c.address else ""
        return f"{self.c.prefix}_frame_encode(frame.{self.c.id}, {whom}{payload}, {size}, {wire}, {capacity})"
