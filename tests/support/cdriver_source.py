"""The text of the program described in cdriver.py."""

from __future__ import annotations

from pathlib import Path

from qlinkgen.backends.c.interface import count_member, interface
from qlinkgen.model import naming
from qlinkgen.model.fields import Layout, Record, Records
from qlinkgen.model.frame import FrameKinds
from qlinkgen.model.message import Direction, Message, Value
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.types import Array, Blob, Scalar

_HEAD, _MAIN = (Path(__file__).with_name(f"cdriver_{part}.c").read_text("utf-8") for part in ("head", "main"))


def source(protocol: Protocol) -> str:
    """The text of the program; it includes the header without a path."""
    return _Source(protocol).text()


class _Source:
    """Writes the program for one protocol."""

    def __init__(self, protocol: Protocol) -> None:
        self.protocol = protocol
        self.header = interface(protocol)
        self.names = self.header.names
        self.packet = self.header.packets
        self.lines: list[str] = []

    def text(self) -> str:
        head = f'#include "{naming.file_stem(self.protocol.name)}.h"\n' + self._filled(_HEAD)
        for message in self.protocol.messages:
            self._show(message)
            self._encode(message)
            self._decode(message)
        self._stream()
        self._cuts()
        self._check()
        rows = [f'    {{"{m.name}", encode_{s}, decode_{s}, payload_{s}}},' for m, s in self._stems()]
        table = [
            "typedef void (*action_t)(void);",
            "typedef struct { const char *name; action_t encode, decode, payload; } entry_t;",
        ]
        table += ["static const entry_t entries[] = {", *rows, "};"]
        return head + "\n".join([*self.lines, *table]) + _MAIN

    def _filled(self, text: str) -> str:
        return text.replace("@p@", self.names.prefix).replace("@P@", self.names.upper)

    def _stems(self) -> list[tuple[Message, str]]:
        return [(message, self.names.stem(message)) for message in self.protocol.messages]

    def _add(self, *lines: str) -> None:
        self.lines += [self._filled(line) for line in lines]

    # Values

    def _show(self, message: Message) -> None:
        if not message.values:
            return
        beside = ", const @p@_parts_t *parts" if message.decided_by else ""
        self._add(
            f"static void show_{self.names.stem(message)}(const {self.names.function(message)}_t *m{beside})",
            "{",
            *(["    (void)parts;"] if beside else []),
        )
        for value in message.values:
            if told := _presence(message, value):
                self._add(f'    printf(" %d", m->{told} ? 1 : 0);')
            self._add(
                *(
                    f"    {line}"
                    for line in _guarded(message, value, "m->", _printed(value, "m->"), "parts->")
                )
            )
        self._add("}")

    def _encode(self, message: Message) -> None:
        function, has_struct = self.names.function(message), bool(message.values)
        self._add(f"static void encode_{self.names.stem(message)}(void)", "{")
        if has_struct:
            self._add(f"    {function}_t m = {self.names.constant(message)}_INIT;")
        self._add(
            "    const char *node = word();",
            f"    uint8_t payload[{self.names.constant(message)}_MAX_SIZE + 1u] = {{0u}};",
        )
        self._add(
            f"    uint8_t wire[{self.names.constant(message)}_MAX_WIRE_SIZE];",
            "    int size = 0;",
            "    int total;",
        )
        self._add("    (void)node;")
        if self._takes_parts(message):
            self._add("    @p@_parts_t parts = @P@_PARTS_INIT;")
        for value in self.protocol.beside(message):
            self._add(*(f"    {line}" for line in _parsed(value, "parts.")))
        for value in message.values:
            if told := _presence(message, value):
                self._add(f"    m.{told} = strtoul(word(), NULL, 0) != 0ul;")
            self._add(
                *(f"    {line}" for line in _guarded(message, value, "m.", _parsed(value, "m."), "parts."))
            )
        call = "&m, " if has_struct else ""
        if message.fields:
            given, most = call + ("&parts, " if message.decided_by else ""), self.names.constant(message)
            self._add(f"    size = {function}_encode({given}payload, {most}_MAX_SIZE);")
            self._add("    if (size < 0) { fail(size); return; }")
        self._add(f"    total = {function}_to_frame({call}{self._whom(message)}wire, sizeof wire);")
        self._add("    if (total < 0) { fail(total); return; }", '    printf("ok");')
        self._add("    put_hex(payload, (size_t)size);", "    put_hex(wire, (size_t)total);", "}")

    def _whom(self, message: Message) -> str:
        if self.packet:
            has_sum = self.header.sum_bits and message.direction == "response"
            return self._filled("@p@_request_sum(bytes_a, from_hex(node, bytes_a)), ") if has_sum else ""
        bits = self.header.address_bits
        whom = f"(uint{bits}_t)strtoul(node, NULL, 0), " if bits else ""
        return f"{whom}&parts, " if self._takes_parts(message) else whom

    def _takes_parts(self, message: Message) -> bool:
        """Whether a frame is made with values; of several kinds of frame, with those of any."""
        several = isinstance(self.protocol.frame, FrameKinds)
        return bool(self.protocol.frame_values if several else self.protocol.beside(message))

    def _decode(self, message: Message) -> None:
        function, stem = self.names.function(message), self.names.stem(message)
        struct = f"    {function}_t m = {self.names.constant(message)}_INIT;" if message.values else ""
        decided = bool(message.decided_by)
        call, shown = ("&m, ", f"    show_{stem}(&m);") if message.values else ("", "")
        told = f"    show_{stem}(&m, &initial);" if decided and shown else shown
        decode = (
            f"{function}_decode({call}{'&initial, ' if decided else ''}bytes_a, size)"
            if message.fields
            else "(size == 0u) ? @P@_OK : @P@_ERROR_LENGTH"
        )
        self._add(f"static void payload_{stem}(void)", "{", struct)
        if decided:
            self._add("    const @p@_parts_t initial = @P@_PARTS_INIT;")
        self._add("    const size_t size = from_hex(word(), bytes_a);", f"    const int status = {decode};")
        self._add("    if (status != @P@_OK) { fail(status); return; }", '    printf("ok");', told, "}")
        self._add(
            f"static void decode_{stem}(void)",
            "{",
            struct,
            "    const size_t size = from_hex(word(), bytes_a);",
            "    int status;",
        )
        if isinstance(frame := self.protocol.frame, FrameKinds) and frame.is_turned(message.id):
            self._add(
                f"    status = {decode};",
                "    if (status != @P@_OK) { fail(status); return; }",
                '    printf("ok 0");',
                shown,
                "}",
            )
            return
        if self.packet and message.direction == "response":
            self._add(
                f"    status = {function}_from_frame({call}@SUM@bytes_a, size);".replace("@SUM@", self._sum())
            )
            self._add(
                "    if (status != @P@_OK) { fail(status); return; }", '    printf("ok -");', shown, "}"
            )
            return
        if decided:
            call, shown = f"{call}&frame.parts, ", f"    show_{stem}(&m, &frame.parts);" if shown else ""
        self._decode_frame(message, call, shown)

    def _sum(self) -> str:
        return "@p@_request_sum(bytes_b, from_hex(word(), bytes_b)), " if self.header.sum_bits else ""

    def _decode_frame(self, message: Message, call: str, shown: str) -> None:
        function = self.names.function(message)
        field = self.header.id
        buffer = "bytes_b, " if self.header.unpacks else ""
        self._add("    @p@_frame_t frame;")
        self._add(f"    status = @p@_frame_decode({self._direction(message)}&frame, {buffer}bytes_a, size);")
        name = _check_of(self.protocol, message)
        self._add(f"    if (status == @P@_OK) {{ status = @p@_{name}_check(&frame); }}")
        self._add(
            f"    if (status == @P@_OK && frame.{field} != {self.names.constant(message)}_ID) {{",
            "        status = @P@_ERROR_UNKNOWN;",
            "    }",
        )
        if message.fields:
            self._add(
                "    if (status == @P@_OK) {",
                f"        status = {function}_decode({call}frame.payload, frame.size);",
                "    }",
            )
        else:  # the check does not know an answer that only its request tells
            self._add("    if (status == @P@_OK && frame.size != 0U) { status = @P@_ERROR_LENGTH; }")
        self._add("    if (status != @P@_OK) { fail(status); return; }")
        address = self.header.address
        self._add(
            f'    printf("ok %llu", (unsigned long long)frame.{address});'
            if address
            else '    printf("ok -");',
            *(
                f"    {line}"
                for value in self.protocol.beside(message)
                for line in _printed(value, "frame.parts.")
            ),
            shown,
            "}",
        )

    def _direction(self, message: Message) -> str:
        return f"@P@_{_check_of(self.protocol, message).upper()}, " if self.header.directed else ""

    # Streams

    def _stream(self) -> None:
        address, field = self.header.address, self.header.id
        node = f'printf("%llu:", (unsigned long long)frame.{address});' if address else 'printf("-:");'
        self._add(
            "static void deliver(size_t at, @p@_event_t event, const @p@_receiver_t *rx,",
            "                    const char *direction)",
            "{",
        )
        self._add(
            "    if (event == @P@_EVENT_NONE) { return; }",
            '    printf(" %lu:", (unsigned long)at);',
            "    if (event != @P@_EVENT_FRAME) {",
        )
        self._add(
            '        printf("%s", kind_of_event(event));',
            "    } else {",
            "        const @p@_frame_t frame = @p@_receiver_frame(rx);",
        )
        self._add(
            "        int status = @P@_ERROR_UNKNOWN;",
            '        const char *name = "?";',
            "        (void)direction;",
        )
        for direction in self._directions():
            self._add(
                f'        if (strcmp(direction, "{direction}") == 0) {{',
                f"            status = @p@_{direction}_check(&frame);",
            )
            self._add(f"            switch (frame.{field}) {{")
            for message in self.protocol.received(direction):
                self._add(
                    f'            case {self.names.constant(message)}_ID: name = "{message.name}"; break;'
                )
            self._add("            default: break;", "            }", "        }")
        self._add("        if (status != @P@_OK) {", '            printf("%s", kind_of(status));')
        self._add("        } else {", '            printf("message:%s:", name);', f"            {node}")
        for direction in self._directions():
            held = {self.names.constant(each): each for each in self.protocol.received(direction)}
            held = {name: each for name, each in held.items() if self.protocol.beside(each)}
            if not held:
                continue
            self._add(f'            if (strcmp(direction, "{direction}") == 0) {{')
            self._add(f"                switch (frame.{field}) {{")
            for name, message in held.items():
                self._add(f"                case {name}_ID:")
                for value in self.protocol.beside(message):
                    if isinstance(value.type, Blob):
                        place = f"frame.parts.{naming.member(value.name)}, {value.type.length.maximum}u"
                        self._add(f"                    put_digits({place});")
                        self._add("                    putchar(':');")
                        continue
                    assert isinstance(value.type, Scalar)
                    form, cast = (
                        ("%lld", "long long") if value.type.signed else ("%llu", "unsigned long long")
                    )
                    shown = f"({cast})frame.parts.{naming.member(value.name)}"
                    self._add(f'                    printf("{form}:", {shown});')
                self._add("                    break;")
            self._add("                default: break;", "                }", "            }")
        self._add("            if (frame.size == 0u) { putchar('-'); }")
        self._add(
            "            put_digits(frame.payload, frame.size);",
            "        }",
            "    }",
            "}",
        )
        self._stream_loop()

    def _directions(self) -> list[Direction]:
        directions = ("request",) if self.packet else self.protocol.directions
        return [direction for direction in directions if self.protocol.received(direction)]

    def _stream_loop(self) -> None:
        rescan = self.header.rescans
        chosen = (
            ', strcmp(direction, "request") == 0 ? @P@_REQUEST : @P@_RESPONSE' if self.header.directed else ""
        )
        self._add("static void stream(const char *direction)", "{", "    static @p@_receiver_t rx;")
        self._add(
            "    const size_t size = from_hex(word(), bytes_a);",
            '    if (direction == NULL) { printf("usage"); return; }',
        )
        self._add(
            f"    @p@_receiver_init(&rx{chosen});",
            '    printf("ok");',
            "    for (size_t at = 0u; at < size; ++at) {",
        )
        self._add(
            "        @p@_event_t event = @p@_receive(&rx, bytes_a[at]);",
            "        deliver(at, event, &rx, direction);",
        )
        if rescan:
            self._add(
                "        while (event != @P@_EVENT_NONE) {", "            event = @p@_receiver_next(&rx);"
            )
            self._add("            deliver(at, event, &rx, direction);", "        }")
        self._add("    }")
        if rescan or self.header.gaps:
            self._add(
                "    for (;;) {",
                "        const @p@_event_t event = @p@_receiver_finish(&rx);",
                "        if (event == @P@_EVENT_NONE) { break; }",
            )
            self._add(
                "        deliver(size, event, &rx, direction);",
                "    }",
            )
        self._add("}")

    # Cuts

    def _cuts(self) -> None:
        """Each prefix of the bytes, in memory of exactly its size; see cdriver_head.c."""
        unpacks, directed = self.header.unpacks, self.header.directed
        self._add(
            "static void cuts(const char *direction)",
            "{",
            "    const size_t size = from_hex(word(), bytes_a);",
            '    if (direction == NULL) { printf("usage"); return; }',
            '    printf("ok");',
            "    for (size_t cut = 0u; cut <= size; ++cut) {",
            "        uint8_t *const part = copy_of(bytes_a, cut);",
            "        @p@_frame_t frame;",
            "        int status;",
        )
        if unpacks:
            self._add("        uint8_t *const body = copy_of(bytes_b, @P@_DECODE_BUFFER_SIZE);")
        buffer = "body, " if unpacks else ""
        chosen = 'strcmp(direction, "request") == 0 ? @P@_REQUEST : @P@_RESPONSE, ' if directed else ""
        self._add(f"        status = @p@_frame_decode({chosen}&frame, {buffer}part, cut);")
        self._add("        if (status == @P@_OK) {")
        for direction in self._directions():
            self._add(f'            if (strcmp(direction, "{direction}") == 0) {{')
            self._add(f"                status = @p@_{direction}_check(&frame);")
            self._add("                for (size_t least = 0u; least < frame.size; ++least) {")
            self._add("                    @p@_frame_t shorter = frame;")
            self._add("                    uint8_t *const payload = copy_of(frame.payload, least);")
            self._add(
                "                    shorter.payload = payload;", "                    shorter.size = least;"
            )
            self._add(f"                    (void)@p@_{direction}_check(&shorter);")
            self._add("                    release(payload);", "                }", "            }")
        self._add("        }")
        self._add(
            '        printf(" %s", (status == @P@_OK) ? "intact" : kind_of(status));',
            "        release(part);",
            "        release(body);" if unpacks else "",
        )
        self._add("    }", "}")

    def _check(self) -> None:
        self._add(
            "static void check(const char *text)",
            "{",
            "    const size_t size = from_hex(text, bytes_a);",
            "    (void)bytes_b;",
        )
        if self.header.sum_bits:
            self._add(
                '    printf("ok %llu", (unsigned long long)@p@_finish_sum_(@p@_sum_(0u, bytes_a, size)));',
                "}",
            )
        elif width := self.header.check_bits:
            self._add(
                f"    uint{width}_t value = @p@_check_start();",
                "    for (size_t index = 0u; index < size; ++index) {",
            )
            self._add("        value = @p@_check_update(value, bytes_a[index]);", "    }")
            self._add('    printf("ok %llu", (unsigned long long)@p@_check_finish(value));', "}")
        else:
            self._add("    (void)size;", '    printf("usage");', "}")


def _presence(message: Message | Layout, value: Value) -> str:
    """The member that tells whether the field of a value is present, before its first value."""
    first = next(each for each in message.values if each.field is value.field)
    return f"has_{value.field.name}" if _is_optional(value) and first == value else ""


def _is_optional(value: Value) -> bool:
    return value.field.conditional and not value.field.slot


def _guarded(
    message: Message | Layout, value: Value, owner: str, lines: list[str], parts: str = ""
) -> list[str]:
    """The statements for a value; those of a case only where the tested number selects it.

    `parts` precedes the values of the frame.
    """
    beside = message.decided_by if isinstance(message, Message) else ()
    if not value.field.slot:
        return lines
    terms = []
    for test in value.field.when:
        kind = next(each.type for each in (*beside, *message.values) if each.name == test.value)
        place = parts if test.value in {each.name for each in beside} else owner
        signed = isinstance(kind, Scalar) and kind.signed
        cast, end = ("(long long)", "ll") if signed else ("(unsigned long long)", "ull")
        number = f"{cast}{place}{naming.member(test.value)}"
        ranges = [f"({number} >= {low}{end} && {number} <= {high}{end})" for low, high in test.ranges]
        terms.append(f"{'!' if test.negated else ''}({' || '.join(ranges)})")
    return [f"if ({' && '.join(terms)}) {{", *lines, "}"]


def _member(value: Value) -> str:
    """The path of a member: a case is one of a union."""
    if not value.field.slot:
        return naming.member(value.name)
    counted = isinstance(value.type, Array | Blob | Records) and not value.type.length.fixed
    return f"{naming.member(value.name)}.{naming.member(value.field.case)}{'.items' if counted else ''}"


def _count(value: Value) -> str:
    """The path of the member that counts the items of a value."""
    if not value.field.slot:
        return count_member(value.field)
    return f"{naming.member(value.name)}.{naming.member(value.field.case)}.{value.field.quantity}"


def _parsed_in(layout: Layout, owner: str, depth: int) -> list[str]:
    """Statements that set the members of a record."""
    lines: list[str] = []
    for value in layout.values:
        if told := _presence(layout, value):
            lines.append(f"{owner}{told} = strtoul(word(), NULL, 0) != 0ul;")
        lines += _guarded(layout, value, owner, _parsed(value, owner, depth))
    return lines


def _printed_in(layout: Layout, owner: str, depth: int) -> list[str]:
    """Statements that print the members of a record."""
    lines: list[str] = []
    for value in layout.values:
        if told := _presence(layout, value):
            lines.append(f'printf(" %d", {owner}{told} ? 1 : 0);')
        lines += _guarded(layout, value, owner, _printed(value, owner, depth))
    return lines


def _parsed(value: Value, owner: str, depth: int = 0) -> list[str]:
    """Statements that set a member of a struct from words; `owner` ends in a dot."""
    kind, name = value.type, _member(value)
    if isinstance(kind, Record):
        return _parsed_in(kind.layout, f"{owner}{name}.", depth)
    if isinstance(kind, Records):
        index, most = f"at{depth}", kind.length.maximum
        place = f"{owner}{name}[{index} < {most}u ? {index} : 0u]."
        inner = _parsed_in(kind.layout, place, depth + 1)
        count_type = "uint8_t" if most < 256 else "uint16_t"
        counted = [] if kind.length.fixed else [f"{owner}{_count(value)} = ({count_type})count{depth};"]
        return [
            "{", f"size_t count{depth} = (size_t)strtoul(word(), NULL, 0);", *counted,
            f"for (size_t {index} = 0u; {index} < count{depth}; ++{index}) {{", *inner, "}", "}",
        ]  # fmt: skip
    if isinstance(kind, Scalar) and kind.bits > 64:
        return [f"wide_of(word(), &{owner}{name}.high, &{owner}{name}.low);"]
    if isinstance(kind, Scalar):
        number = "strtoll" if kind.signed else "strtoull"
        width = next(w for w in (8, 16, 32, 64) if w >= kind.bits)
        cast = "0ull != " if kind.meaning == "bool" else f"({'' if kind.signed else 'u'}int{width}_t)"
        return [f"{owner}{name} = {cast}{number}(word(), NULL, 0);"]
    count_type = "" if kind.length.fixed else ("uint8_t" if kind.length.maximum < 256 else "uint16_t")
    if isinstance(kind, Blob):
        lines = [
            "{",
            "    const size_t count = from_hex(word(), bytes_b);",
            f"    memcpy({owner}{name}, bytes_b,",
            f"           count < sizeof {owner}{name} ? count : sizeof {owner}{name});",
        ]
        lines += (
            [f"    {owner}{_count(value)} = ({count_type})count;"] if count_type else ["    (void)count;"]
        )
        return [*lines, "}"]
    number = "strtoll" if kind.item.signed else "strtoull"
    width = next(w for w in (8, 16, 32, 64) if w >= kind.item.bits)
    item = f"({'' if kind.item.signed else 'u'}int{width}_t){number}(text, &text, 0)"
    lines = [
        "{",
        "    char *text = word();",
        "    size_t count = 0u;",
        "    while (text != NULL && *text != '\\0' && strcmp(text, \"-\") != 0) {",
    ]
    lines += [
        f"        if (count < {kind.length.maximum}u) {{",
        f"            {owner}{name}[count] = {item};",
        "        } else {",
        f"            (void){number}(text, &text, 0);",
        "        }",
    ]
    lines += ["        ++count;", "        if (*text == ',') { ++text; }", "    }"]
    lines += [f"    {owner}{_count(value)} = ({count_type})count;"] if count_type else ["    (void)count;"]
    return [*lines, "}"]


def _printed(value: Value, owner: str, depth: int = 0) -> list[str]:
    kind, name = value.type, _member(value)
    if isinstance(kind, Record):
        return _printed_in(kind.layout, f"{owner}{name}.", depth)
    if isinstance(kind, Records):
        index, fixed = f"at{depth}", f"{kind.length.maximum}u"
        count = fixed if kind.length.fixed else f"{owner}{_count(value)}"
        place = f"{owner}{name}[{index}]."
        inner = _printed_in(kind.layout, place, depth + 1)
        return [
            f'printf(" %u", (unsigned){count});',
            f"for (size_t {index} = 0u; {index} < {count}; ++{index}) {{", *inner, "}",
        ]  # fmt: skip
    if isinstance(kind, Scalar) and kind.bits > 64:
        halves = ", ".join(f"(unsigned long long){owner}{name}.{half}" for half in ("high", "low"))
        return [f'printf(" 0x%016llx%016llx", {halves});']
    if isinstance(kind, Scalar):
        form, cast = ("%lld", "long long") if kind.signed else ("%llu", "unsigned long long")
        return [f'printf(" {form}", ({cast}){owner}{name});']
    count = f"{kind.length.maximum}u" if kind.length.fixed else f"{owner}{_count(value)}"
    if isinstance(kind, Blob):
        return [f"put_hex({owner}{name}, {count});"]
    assert isinstance(kind, Array)
    form, cast = ("%lld", "long long") if kind.item.signed else ("%llu", "unsigned long long")
    return [
        f'printf({count} == 0u ? " -" : " ");',
        f"for (size_t index = 0u; index < {count}; ++index) {{",
        f'    printf("%s{form}", index == 0u ? "" : ",", ({cast}){owner}{name}[index]);',
        "}",
    ]


def _check_of(protocol: Protocol, message: Message) -> str:
    if message.direction != "message" or protocol.directions == ("message",):
        return message.direction
    return "request"
