"""The classes of a module: what each message adds, and what several messages share."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from qlinkgen.backends import python_text
from qlinkgen.backends.python import docstrings, values
from qlinkgen.backends.python.decode import Decoder
from qlinkgen.backends.python.encode import Encoder
from qlinkgen.backends.python.measure import measure_lines
from qlinkgen.backends.python.place import WIDTH, Place, constant_name, in_hex, indented, wrapped
from qlinkgen.model import sizes
from qlinkgen.model.frame import MarkedFrame, PacketFrame
from qlinkgen.model.message import Direction, Field, Message, Value
from qlinkgen.model.naming import pascal
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.types import Array, Bits, Blob, Scalar

#: A layout that so many messages have stands once, in a class of its own.
SHARED = 4

#: Names that a module has for itself.
TAKEN = frozenset(
    """Message Request Response StreamDecoder Command Counters Fault CodecError EncodeError DecodeError
    Bus OpenEnum BaseMessage Constant Count DecimalSteps Items Mask Misfit Octets OutOfRange Steps Text Whole
    Struct Decimal Self Any Callable BytesLike ClassVar Final Literal""".split()  # noqa: SIM905  # reads better than quoted words
)


@dataclass(frozen=True)
class ClassModel:
    """A class, ready to be placed: every entry is finished text."""

    name: str
    base: str
    doc: list[str]
    facts: list[str]
    slots: list[str] = field(default_factory=lambda: ["__slots__ = ()"])
    init: list[str] = field(default_factory=list)
    encode: list[str] = field(default_factory=list)
    decode: list[str] = field(default_factory=list)
    measure: list[str] = field(default_factory=list)
    constants: list[str] = field(default_factory=list)
    body_size: int | None = None
    has_codec: bool = False

    @property
    def refusable(self) -> bool:
        """There is a value that the encoder may have to refuse."""
        return self.encode != ['return b""']


def class_name(message: Message) -> str:
    """Name of a message's class."""
    name = pascal(message.name)
    return f"{name}_" if name in TAKEN else name


class ClassBuilder:
    """Builds the classes of one protocol."""

    def __init__(
        self, place: Place, protocol: Protocol, messages: Iterable[Message], *, measured: bool
    ) -> None:
        """``measured``: nothing but its own counts tells where a message ends."""
        frame = protocol.frame
        self._default_address = protocol.bus.nodes[0] if protocol.bus.nodes else 0
        self._measured = measured
        self._place = place
        self._frame = frame
        self._messages = tuple(messages)
        self._packets = isinstance(frame, PacketFrame)
        self._all_checked = all(message.checksum for message in self._messages)
        self._steps: dict[str, tuple[str, str]] = {}
        self._shapes = self._shared_shapes()

    def build(self) -> list[ClassModel]:
        """Every class, shared ones first."""
        shapes = [self._shape(name, message) for name, message in self._shapes.values()]
        return [*shapes, *map(self._message, self._messages)]

    @property
    def steps(self) -> list[str]:
        """Definitions of the conversions of scaled fields; complete once the classes are built."""
        return [f"{name} = {call}" for name, call in self._steps.values()]

    # Layouts that several messages have

    def _shared_shapes(self) -> Mapping[Message, tuple[str, Message]]:
        groups: dict[Message, list[Message]] = {}
        for message in self._messages:
            groups.setdefault(self._layout(message), []).append(message)
        shared = {layout: group[0] for layout, group in groups.items() if len(group) >= SHARED}
        names: dict[str, int] = {}
        found = {}
        for layout, message in shared.items():
            name = _shape_name(message) + (self._base(message) if self._packets else "")
            names[name] = names.get(name, 0) + 1
            found[layout] = (f"{name}{names[name]}" if names[name] > 1 else name, message)
        return found

    def _shape(self, name: str, message: Message) -> ClassModel:
        kinds = ", ".join(value.name for value in message.values)
        doc = python_text.docstring([f"What messages with {kinds or 'no data'} have in common."])
        head = ClassModel(name, self._base(message), doc, self._checked(message))
        return self._with_codec(message, head, _snake_upper(name), "self.ID")

    def _message(self, message: Message) -> ClassModel:
        facts = [f'NAME = "{message.name}"', f"ID = {in_hex(message.id)}"]
        facts.append(f"MAX_WIRE_SIZE = {sizes.max_wire_size(self._frame, message)}")
        head = ClassModel(class_name(message), self._base(message), self._doc(message), facts)
        if shape := self._shapes.get(self._layout(message)):
            return replace(head, base=shape[0])
        head.facts.extend(self._checked(message))
        return self._with_codec(message, head, constant_name(message), in_hex(message.id))

    def _with_codec(self, message: Message, head: ClassModel, title: str, number: str) -> ClassModel:
        """A class with its code; ``title`` is in the names of its constants, ``number`` its id."""
        steps = self._steps_of(message)
        encoder = Encoder(message, self._place, title, number, steps)
        decoder = Decoder(message, self._place, title, steps)
        return replace(
            head,
            slots=wrapped("__slots__ = (", _quoted(value.name for value in message.values), ")", 4),
            facts=[*head.facts, *self._facts(message, steps)],
            init=self._init(message),
            encode=encoder.statements("body = " if self._place.frame else "return "),
            decode=decoder.statements(),
            measure=measure_lines(message) if self._measured else [],
            constants=[*encoder.constants, *decoder.constants],
            body_size=self._body_size(message),
            has_codec=True,
        )

    def _body_size(self, message: Message) -> int | None:
        """Bytes that the encoder packs, None if their number varies."""
        frame = self._place.frame
        if frame is None or message.variable:
            return None
        return message.max_size + sum(part.size for part in (*self._place.front, *self._place.back))

    def _base(self, message: Message) -> str:
        return message.direction.title() if self._packets else "Message"

    def _checked(self, message: Message) -> list[str]:
        """Whether the message carries a checksum, where not all do."""
        frame = self._frame
        return (
            ["CHECKED = True"]
            if isinstance(frame, MarkedFrame) and not self._all_checked and message.checksum
            else []
        )

    def _layout(self, message: Message) -> Message:
        """A message without what does not matter to its code."""
        direction: Direction = message.direction if self._packets else "message"
        fields = tuple(_bare(each) for each in message.fields)
        return replace(
            message,
            name="",
            command="",
            direction=direction,
            id=0,
            doc="",
            section="",
            confirmed=True,
            fields=fields,
        )

    # Parts of a class

    def _steps_of(self, message: Message) -> dict[str, str]:
        found = {}
        for value in message.values:
            if isinstance(value.type, Scalar) and value.type.scaling is not None:
                key = values.steps_name(value.type, value.name)
                if key not in self._steps:
                    self._steps[key] = (
                        self._new_name(f"_{value.name.upper()}"),
                        values.steps_arguments(value.type, value.name),
                    )
                found[value.name] = self._steps[key][0]
        return found

    def _new_name(self, name: str) -> str:
        used = {known for known, _ in self._steps.values()}
        number = 2
        candidate = name
        while candidate in used:
            candidate, number = f"{name}_{number}", number + 1
        return candidate

    def _facts(self, message: Message, steps: dict[str, str]) -> list[str]:
        facts = [f"MIN_SIZE = {message.min_size}", f"MAX_SIZE = {message.max_size}"]
        if message.addresses and message.default_address != self._default_address:
            facts.append(f"DEFAULT_ADDRESS = {message.default_address}")
        facts += (
            wrapped("FIELDS = (", _quoted(value.name for value in message.values), ")", 4)
            if message.values
            else []
        )
        rules = values.rules(message, self._place, steps)
        return [*facts, "RULES = (", *(f"    {rule}," for rule in rules), ")"] if rules else facts

    def _init(self, message: Message) -> list[str]:
        place, address = self._place, self._place.address if message.addresses else ""
        # Nobody is addressed by default, unless there is but one who can be.
        spans = {end for span in message.addresses for end in span}
        default = f" = {message.default_address}" if len(spans) == 1 else ""
        arguments = [f"{address}: int{default}"] if address else []
        arguments += [values.argument(value, place) for value in message.values]
        body = [f"self.{address} = {address}"] if address else []
        body += [_assignment(value) for value in message.values]
        head = wrapped("def __init__(", ["self", "*", *arguments] if arguments else ["self"], ") -> None:", 4)
        if len(head) > 1:
            head = ["def __init__(", *(f"    {each}," for each in ["self", "*", *arguments]), ") -> None:"]
        return [*head, *indented(body or ["pass"])]

    def _doc(self, message: Message) -> list[str]:
        title = {"request": "Request", "response": "Response"}.get(message.direction, "Message")
        text = message.doc or message.name
        tail = f": {title.lower()}" if message.direction != "message" else ""
        lines = docstrings.paragraph(docstrings.opening(text, message.section, tail), WIDTH - 8)
        if not message.confirmed:
            lines += ["", docstrings.UNCONFIRMED]
        if message.values or message.addresses:
            lines += ["", "Attributes:"]
            if self._place.address and message.addresses:
                spans = " or ".join(_span(low, high) for low, high in message.addresses)
                lines.append(f"    {self._place.address}: Address in the frame, {spans}.")
            for value in message.values:
                described = f"{value.name}: {values.description(value, self._place)}"
                lines += docstrings.item(described, WIDTH - 4)
        return python_text.docstring(lines)


def _span(low: int, high: int) -> str:
    return str(low) if low == high else f"{low}..{high}"


def _assignment(value: Value) -> str:
    if isinstance(value.type, Array) and not value.required:
        default = list(value.type.default)
        return f"self.{value.name} = {default} if {value.name} is None else {value.name}"
    return f"self.{value.name} = {value.name}"


def _quoted(names: Iterable[str]) -> list[str]:
    quoted = [f'"{name}"' for name in names]
    return [f"{quoted[0]},"] if len(quoted) == 1 else quoted


def _bare(each: Field) -> Field:
    kind = each.type
    if isinstance(kind, Bits):
        kind = replace(kind, members=tuple(replace(member, doc="") for member in kind.members))
    return replace(each, type=kind, doc="", section="", confirmed=True, echo=False)


def _shape_name(message: Message) -> str:
    if not message.fields:
        return "_Empty"
    return "_" + "".join(pascal(each.name) + _kind(each) for each in message.fields)


def _kind(each: Field) -> str:
    kind = each.type
    if isinstance(kind, Blob):
        return "Text" if kind.text else "Bytes"
    scalar = kind.container if isinstance(kind, Bits) else kind.item if isinstance(kind, Array) else kind
    return f"{'I' if scalar.signed else 'U'}{scalar.bits}{'s' if isinstance(kind, Array) else ''}"


def _snake_upper(name: str) -> str:
    return "".join(f"_{char}" if char.isupper() else char for char in name.lstrip("_")).upper().lstrip("_")
