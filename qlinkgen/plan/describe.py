"""The plan in words: texts on parts and steps for tables, comments and documentation."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from decimal import Decimal
from fractions import Fraction
from typing import assert_never

from qlinkgen.model.condition import Test
from qlinkgen.model.digits import Digits as TextDigits
from qlinkgen.model.frame import Silence
from qlinkgen.model.integer import Chunk, Integer
from qlinkgen.model.types import (
    Characters,
    Checked,
    Constant,
    Count,
    Derived,
    Enum,
    Flags,
    Float,
    Length,
    Number,
    Reserved,
    Scalar,
    Settable,
)
from qlinkgen.model.values import native_from_raw
from qlinkgen.model.words import Words
from qlinkgen.plan.check import Check
from qlinkgen.plan.coding import Add, Cobs, Digits, Escaping, Insertion, Pair, Stage
from qlinkgen.plan.ends import (
    ByKind,
    ByLength,
    ByMark,
    ByMessage,
    BySilence,
    ByTerminator,
    ByTurn,
    Gaps,
    Hunt,
    InStep,
    Marks,
    Rescan,
)
from qlinkgen.plan.expr import Clear, Condition, Legible, OneOf, Size, Term, Within
from qlinkgen.plan.framing import FramePlan
from qlinkgen.plan.parts import (
    AddressPart,
    AddressSlot,
    BlocksPart,
    CellPart,
    CheckPart,
    ConstantPart,
    ConstantSlot,
    EqualPart,
    IdPart,
    IdSlot,
    LengthPart,
    MarkPart,
    Part,
    PayloadPart,
    Slot,
)
from qlinkgen.plan.payload import (
    BitsStep,
    BytesStep,
    Compare,
    ConstantStep,
    CountStep,
    Equal,
    FilledStep,
    Infer,
    ItemsStep,
    Learn,
    Member,
    Presence,
    RecordsStep,
    RecordStep,
    ReservedStep,
    Segment,
    Sizing,
    Step,
    ValueStep,
)
from qlinkgen.plan.transparency import Coded, FrameStuffing, PayloadStuffing, Plain, SevenBit

# Numbers ----------------------------------------------------------------------------------------------------


def span_text(low: object, high: object) -> str:
    """``low..high``, or one number if they are equal."""
    return str(low) if low == high else f"{low}..{high}"


def bytes_text(low: int, high: int) -> str:
    """``1 byte``, ``0..12 bytes``."""
    return f"{span_text(low, high)} byte{'' if low == high == 1 else 's'}"


def number_text(value: Number | Fraction) -> str:
    """A number without an exponent or needless digits."""
    if isinstance(value, Decimal):
        return f"{value:f}"
    return f"{value:.10g}" if isinstance(value, float) else str(value)


def limits_text(scalar: Scalar) -> str:
    """Legal values in the unit, or all words."""
    if isinstance(scalar.text, Words):
        return ", ".join(each.decode() for each in scalar.text.words)
    low, high = scalar.span
    return f"{number_text(low)}..{number_text(high)}"


def range_text(scalar: Scalar) -> str:
    """Legal values in the unit; "" for a bool, enum or flags without limits."""
    match scalar.role:
        case Constant():
            return f"always {_constants_text(scalar, (scalar.default, *scalar.role.accepted))}"
        case Reserved():
            return "reserved"
        case Settable() | Count() | Checked() | Derived():
            return "" if _is_free(scalar) else limits_text(scalar)
        case _:
            assert_never(scalar.role)


def _constants_text(scalar: Scalar, raw: Sequence[int]) -> str:
    """The legal values of a constant."""
    if isinstance(scalar.text, Words):
        return " or ".join(scalar.text.text(each).decode() for each in raw)
    return " or ".join(number_text(scalar.physical(each)) for each in raw)


def _is_free(scalar: Scalar) -> bool:
    """Whether the value has no limits beyond those of its type, which has a name."""
    if isinstance(scalar.meaning, Float):
        return scalar.meaning.bounds is None
    return scalar.meaning is not None and scalar.full_range


def scale_text(scalar: Scalar) -> str:
    """The value of one step of the raw number: ``1/10``, ``1/2^16``, with the offset if there is one."""
    if scalar.scaling is None:
        return ""
    scale, offset = scalar.scaling.scale, scalar.scaling.offset
    base = scale.denominator.bit_length() - 1
    power = base >= 8 and scale.denominator == 1 << base
    step = f"{scale.numerator}/2^{base}" if power else str(scale)
    return f"{step}, from {offset}" if offset else step


def value_text(scalar: Scalar, raw: int) -> str:
    """A value: its number in the unit, its name, or the names of its bits."""
    meaning = scalar.meaning
    match meaning:
        case Enum(words=Words() as words):
            return f"{meaning.name_of(raw)} ({words.text(raw).decode()})"
        case Enum():
            return f"{meaning.name_of(raw) or 'no name'} ({raw})"
        case Flags():
            names = [member.name for member in meaning.members if raw >> member.value & 1]
            bits = f"0x{raw & scalar.integer.mask:0{(scalar.bits + 3) // 4}X}"
            return f"{bits} ({' | '.join(names) or 'none set'})"
        case "bool":
            return str(native_from_raw(scalar, raw)).lower()
        case Characters():
            return repr(raw.to_bytes(meaning.number, "big").decode("latin-1"))
        case None if isinstance(scalar.text, Words):
            return scalar.text.text(raw).decode()
        case Float() | None:
            unit = f" {scalar.unit}" if scalar.unit else ""
            raw_text = f" (raw {raw})" if scalar.scaling else ""
            return f"{number_text(scalar.physical(raw))}{unit}{raw_text}"
        case _:
            assert_never(meaning)


def unread_text(field: Step | Member, raw: bytes) -> str:
    """Text that is neither a number nor a word of its field; "" for coded and for other bytes."""
    integer = field.integer if isinstance(field, ValueStep | ConstantStep | ReservedStep) else None
    if isinstance(field, ItemsStep) and field.between:
        integer = field.item
    if integer is None or integer.text is None or len(raw) > integer.size or not integer.stray(raw):
        return ""
    return repr(raw.decode("ascii", "backslashreplace"))


# Steps ------------------------------------------------------------------------------------------------------


def number_of(step: Step | Member) -> Scalar | None:
    """The number of a step, or of each of its items; None if it does not hold a value."""
    match step:
        case ValueStep() | ConstantStep() | ReservedStep() | ItemsStep() | Member():
            return step.number
        case CountStep() | FilledStep() | BitsStep() | BytesStep() | RecordStep() | RecordsStep():
            return None
        case _:
            assert_never(step)


def type_text(step: Step | Member) -> str:
    """A type in schema notation: u16, i32 little, text[1..256], u16[0..12]."""
    match step:
        case ValueStep() | ConstantStep() | ReservedStep() | Member():
            return _scalar_text(step.number)
        case CountStep() | FilledStep() | BitsStep():
            return integer_text(step.integer)
        case BytesStep():
            pad = f" padded with {step.pad.hex().upper()}" if step.pad else ""
            pad += f" ended by {step.terminator.hex().upper()}" if step.terminator else ""
            return f"{'text' if step.text else 'bytes'}[{_length_text(step.length)}]{pad}"
        case ItemsStep():
            row = f" in a row of bits, {step.packed} first" if step.packed else ""
            return f"{_scalar_text(step.number)}[{_length_text(step.length)}]{row}"
        case RecordStep():
            return step.record.name
        case RecordsStep():
            return f"{step.record.name}[{_length_text(step.length)}]"
        case _:
            assert_never(step)


def _scalar_text(scalar: Scalar) -> str:
    integer, meaning = integer_text(scalar.integer), scalar.meaning
    match meaning:
        case Enum():
            return f"{meaning.name} (enum, {integer})"
        case Flags():
            return f"{meaning.name} (flags, {integer})"
        case Float():
            return f"{meaning.name}{integer.removeprefix(f'u{scalar.bits}')}"
        case Characters():
            return f"text[{meaning.number}]"
        case "bool":
            return "bool"
        case None:
            return integer
        case _:
            assert_never(meaning)


def integer_text(integer: Integer) -> str:
    """``u8``, ``i32 little``, ``u14 in groups: bits 7-13 0-6``."""
    base = integer.notation
    if integer.size <= 1 or integer.text:
        return base
    if integer.byteorder:
        return f"{base} {integer.byteorder}"
    return f"{base} in groups: bits {' '.join(map(_chunk_text, integer.chunks))}"


def _chunk_text(chunk: Chunk) -> str:
    return f"{chunk.shift}-{chunk.shift + chunk.bits - 1}"


def _length_text(length: Length) -> str:
    """``4``, ``0..12``, or ``0..12, by count``."""
    span = span_text(length.minimum, length.maximum)
    return f"{span}, by {length.counted_by}" if length.counted_by else span


def holds_text(step: Step | Member) -> str:
    """The content of a step beyond its type: a range, a constant, or the run that it counts."""
    match step:
        case ValueStep() | ConstantStep() | ReservedStep() | ItemsStep() | Member():
            return range_text(step.number)
        case CountStep():
            return f"{count_unit(step)} of {counted_text(step)}"
        case FilledStep():
            return filled_text(step)
        case BitsStep():
            return span_text(step.integer.minimum, step.integer.maximum)
        case BytesStep() | RecordStep() | RecordsStep():
            return ""
        case _:
            assert_never(step)


def kind_text(step: Step | Member) -> str:  # noqa: C901  # a case a step
    """The kind of a step, in a word."""
    match step:
        case ValueStep() | Member():
            return "value"
        case ConstantStep():
            return "constant"
        case ReservedStep():
            return "reserved"
        case CountStep():
            return "count"
        case FilledStep():
            return "derived" if isinstance(step.rule, Equal) else "check"
        case BitsStep():
            return "bits"
        case BytesStep():
            return "text" if step.text else "bytes"
        case ItemsStep():
            return "items"
        case RecordStep():
            return "record"
        case RecordsStep():
            return "records"
        case _:
            assert_never(step)


def must_text(step: Step | Member) -> str:
    """Conditions on the raw number of a step, or of each of its items, beyond the limits of its bits."""
    match step:
        case ValueStep() | ItemsStep() | Member() if isinstance(step.number.meaning, Float):
            return range_text(step.number)
        case ValueStep() | ItemsStep() | Member():
            return " and ".join(map(condition_text, step.conditions))
        case ConstantStep():
            return constant_text(step)
        case FilledStep():
            return filled_text(step)
        case ReservedStep():
            return f"anything; sent as {step.value}"
        case CountStep():
            return f"{count_unit(step)} of {counted_text(step)}, {condition_text(step.bounds)}"
        case BitsStep() | RecordStep() | RecordsStep():
            return ""
        case BytesStep():
            return "7-bit characters" if step.text else ""
        case _:
            assert_never(step)


def constant_text(step: ConstantStep) -> str:
    """The numbers that a receiver accepts, the one that is sent first."""
    raw = (step.value, *step.accepted)
    return _constants_text(step.number, raw) if step.integer.text else " or ".join(map(str, raw))


def filled_text(step: FilledStep) -> str:
    """What a number follows from: ``crc-8/nrsc-5 over value``, ``~count``, ``count + 1``."""
    rule, over = step.rule, step.over
    if not isinstance(rule, Equal):
        return f"{rule.name} over {span_names(over)}"
    added = f" {'+' if rule.added > 0 else '-'} {abs(rule.added)}" if rule.added else ""
    return f"{'~' if rule.inverted else ''}{over[0]}{added}"


def span_names(names: Sequence[str]) -> str:
    """Names of fields that follow each other: ``a``, ``a, b``, ``a .. f``."""
    return ", ".join(names) if len(names) <= 3 else f"{names[0]} .. {names[-1]}"


def filled_number(step: FilledStep, number: int) -> str:
    """A number that follows from others in hex, with all digits of its width."""
    return f"0x{number:0{(step.integer.bits + 3) // 4}X}"


def count_unit(step: CountStep) -> str:
    """The unit of a count."""
    if step.unit > 1:
        return f"units of {step.unit} bytes"
    term = step.term
    return "bytes" if step.sized or term.packed or term.factor > 1 or term.more > 0 else "items"


def counted_text(step: CountStep) -> str:
    """What a count counts: ``samples``, ``samples and 4 more bytes``."""
    more = step.term.more
    if step.unit > 1 and more > 0:
        return f"{step.run} and {more} more"
    return (
        f"{step.run} and {more} more bytes" if more > 0 else f"{step.run}, less {-more}" if more else step.run
    )


def size_text(size: Size) -> str:
    """A size: ``4``, ``3 + 2*samples``."""
    terms = map(term_text, size.terms)
    return " + ".join([*[str(size.fixed)] * bool(size.fixed or not size.terms), *terms])


def term_text(term: Term) -> str:
    """The size of a run: ``2*samples``, ``(11*samples + 7) / 8``."""
    product = f"{term.factor}*{term.run}" if term.factor > 1 else term.run
    product = f"({product} + 7) / 8" if term.packed else product
    return plus(product, term.more)


def plus(number: str, more: int) -> str:
    """A number plus a constant: ``n + 2``, ``n - 1``, ``n``."""
    return f"{number} {'+' if more > 0 else '-'} {abs(more)}" if more else number


def condition_text(rule: Condition) -> str:
    """A condition on a number on the wire."""
    match rule:
        case Within():
            return span_text(rule.low, rule.high)
        case Clear():
            return f"bits 0x{rule.mask:X} clear"
        case OneOf():
            return " or ".join(map(condition_text, rule.ranges))
        case Legible():
            barred = rule.characters.excluded
            return "7-bit characters" + (f" without {barred.decode('ascii')!r}" if barred else "")
        case _:
            assert_never(rule)


def sizing_text(each: Sizing) -> str:
    """The derivation of the number of items of a run."""
    match each:
        case Learn():
            count, bounds = each.count, condition_text(each.count.bounds)
            return f"{count.run}: {_counted_text(count)}; {count.name} is {bounds}"
        case Compare() if each.count.term.packed:
            return f"{each.count.run}: {each.count.name} must be {term_text(each.count.term)}"
        case Compare():
            return f"{each.count.run}: {_counted_text(each.count)}, which must agree"
        case Infer():
            others = f"({size_text(each.others)})" if each.others.terms else size_text(each.others)
            rest = f"payload size - {others}" if others != "0" else "payload size"
            share = f"({rest}) / {each.run.item_size}" if each.run.item_size > 1 else rest
            return f"{each.run.name}: {share}, {span_text(each.run.length.minimum, each.run.length.maximum)}"
        case _:
            assert_never(each)


def _counted_text(count: CountStep) -> str:
    number, steps = count.name, count.term.packed or count.scale > 1
    if count.term.more:
        number = f"({plus(number, -count.term.more)})" if steps else plus(number, -count.term.more)
    if count.term.packed:
        times, by = count.term.per_byte
        product = f"{times}*{number}" if times > 1 else number
        return f"{product} / {by}" if by > 1 else product
    return f"{number} / {count.scale}" if count.scale > 1 else number


# Parts ------------------------------------------------------------------------------------------------------


def part_text(part: Part, frame: FramePlan) -> str:  # noqa: C901  # a case a part
    """The content of a part of a frame."""
    match part:
        case ConstantPart():
            return part.data.hex(" ").upper() + _held_text(part, frame)
        case LengthPart():
            more = f"; {part.otherwise} for more" if part.otherwise is not None else ""
            counted = _counted("payload bytes", part.bias, part.scale)
            return f"{counted}, {span_text(part.least, part.most)}{more}"
        case IdPart():
            return "message id"
        case AddressPart():
            return f"address, {digits_text(part.digits)}" if part.digits else "address"
        case MarkPart():
            what = part.id_name if part.end_id is None else f"{part.end_id} in place of {part.id_name}"
            return f"0x{part.marker:02X}, {part.address_name}, {what}"
        case CellPart():
            slots = "; ".join(f"bits {_slot_text(part, slot)}" for slot in part.slots)
            return slots + _held_text(part, frame)
        case EqualPart():
            added = f" {part.added:+d}".replace("+", "+ ").replace("-", "- ") if part.added else ""
            return f"{'complement of ' if part.inverted else ''}{part.of.name}{added}"
        case PayloadPart():
            kept = "" if part.trim is None else ", without zeros at their end"
            kept += f", at least {part.trim}" if part.trim else ""
            before = f"{part.opening}, and then " if part.opening else ""
            return f"{before}the message's fields{kept}"
        case CheckPart():
            text = check_text(part.check, frame) + _held_text(part, frame)
            return text if part.check.complete else f"{text}; bits {_sent_bits_text(part.check)} are sent"
        case BlocksPart():
            return f"{check_text(part.check, frame)}, after every {part.every} bytes and after the rest"
        case _:
            assert_never(part)


def _held_text(part: Part, frame: FramePlan) -> str:
    """The condition of a part that only some frames have, "" if each has it."""
    held = (each for each in frame.envelope.conditional if part in each.parts)
    return "".join(f"; {_if_text(each.tests)}" for each in held)


def _slot_text(part: CellPart, slot: Slot) -> str:
    last = slot.shift + slot.bits - 1
    place = span_text(slot.shift, last)
    match slot:
        case IdSlot():
            return f"{place} message id" + (
                f" from bit {slot.at}" if slot.at or slot.bits < part.integer.bits else ""
            )
        case AddressSlot():
            return f"{place} address"
        case ConstantSlot():
            return f"{place} {' or '.join(f'0x{value:X}' for value in slot.values)}"
        case Member():
            return f"{place} {slot.name}" if slot.name != part.name else f"{place} value"
        case _:
            assert_never(slot)


def _counted(what: str, bias: int, scale: int = 1) -> str:
    text = f"{what} {'+' if bias > 0 else '-'} {abs(bias)}" if bias else what
    return f"({text}) / {scale}" if scale > 1 else text


def digits_text(digits: TextDigits) -> str:
    """How a number of a frame is sent as text."""
    kind = "decimal" if digits.base == 10 else "hexadecimal"
    return f"{digits.most} {kind} digit{'s' if digits.most > 1 else ''}"


def check_text(check: Check, frame: FramePlan) -> str:
    """Algorithm and coverage."""
    if check.chained:
        words = f"every {check.word}-byte word" if check.word > 1 else "every byte"
        return f"{check.algorithm.name} of {frame.id_name} and {words}, written or read"
    kinds = {0: "", 10: f", as {check.size} decimal digits", 16: f", as {check.size} digits"}
    digits = kinds[check.value.base]
    return f"{check.algorithm.name} over {', '.join(check.over)}{digits}"


def _sent_bits_text(check: Check) -> str:
    return ", ".join(f"{chunk.shift}..{chunk.shift + chunk.bits - 1}" for chunk in check.value.chunks)


def id_text(frame: FramePlan, number: int) -> str:
    """A message id: text if it has several lengths, decimal if it shares a byte, otherwise hexadecimal."""
    if number < len(frame.texts):
        return f'"{frame.texts[number].decode()}"'
    end = frame.end
    match end:
        case ByMark():
            return str(number)
        case ByLength() | ByMessage() | ByTerminator() | BySilence() | ByTurn():
            return f"0x{number:02X}"
        case ByKind():
            base = max(each.base for each in frame.kinds if each.base <= number)
            names = "/".join(each.name for each in frame.kinds if each.base == base)
            text = f"0x{number - base:02X}"
            return text if len({each.base for each in frame.kinds}) == 1 else f"{names} {text}"
        case _:
            assert_never(end)


def end_text(frame: FramePlan) -> str:
    """The rule that determines the end of a frame."""
    if frame.idle is None or frame.idle.alone:
        return _end_text(frame)
    verb = "begins each one" if frame.idle.broken else "ends it early"
    return f"{_end_text(frame)}; {idle_text(frame.idle)} {verb}"


def idle_text(silence: Silence) -> str:
    """The duration of an idle line or a break."""
    what = "a break" if silence.broken else "an idle line"
    times = f"{float(silence.byte_times):g} byte times" if silence.byte_times else ""
    clock = f"{float(silence.seconds * 1_000_000):g} us" if silence.seconds else ""
    if times and clock:
        return f"{what} of {times}, at least {clock},"
    return f"{what} of {times or clock}"


def _end_text(frame: FramePlan) -> str:
    end = frame.end
    match end:
        case ByLength():
            steps = f" * {end.part.scale}" if end.part.scale > 1 else ""
            return f"the payload has {_counted(f'{end.part.name}{steps}', -end.part.bias)} bytes"
        case ByMessage():
            return "the size follows from the message and the counts in its payload"
        case ByTerminator():
            begins = ", which may also begin the next frame" if end.shared else ""
            after = f"; {end.after} bytes follow" if end.after else ""
            return f"the next {end.part.data.hex(' ').upper()}{begins}{after}"
        case BySilence():
            assert frame.idle is not None
            return (
                f"the next break; {idle_text(frame.idle)} begins each one"
                if frame.idle.broken
                else f"{idle_text(frame.idle)} alone"
            )
        case ByTurn():
            return "only its turn in a dialogue tells a frame, whose size follows from the message"
        case ByMark():
            return f"the next byte with bit 0x{end.header.marker:02X} set"
        case ByKind():
            return "that of its kind, which its first bytes tell"
        case _:
            assert_never(end)


def transparency_text(frame: FramePlan) -> str:
    """The stuffing of a frame."""
    way = frame.transparency
    coded = [
        each for each in frame.kinds if isinstance(each.transparency, Coded) and each.transparency.stages
    ]
    if coded:
        texts = [f"{transparency_text(each)} of {each.name}" for each in coded]
        return "; ".join([*texts, *(["others as they are"] if len(coded) < len(frame.kinds) else [])])
    if isinstance(way, Plain):
        return "bytes are sent as they are"
    envelope = frame.envelope
    match way:
        case SevenBit():
            return f"no byte between header and end has bit 0x{way.marker:02X} set"
        case FrameStuffing():
            parts = envelope.between(way.front, way.back)
            exempt = ", ".join(part.name for part in envelope.parts if part not in parts)
            rule = f"a byte {way.rule.insert:02X} is inserted after every {_after_text(way)}"
            return f"{rule}, after the checksum is computed" + (f"; not in {exempt}" if exempt else "")
        case PayloadStuffing():
            rule = f"{_stage_text(way.rule)} in {envelope.payload.name}"
            return f"{rule}, before length and checksum are computed"
        case Coded(stages=()):
            return "bytes are sent as they are"
        case Coded():
            parts = envelope.between(way.front, way.back)
            names = ", ".join(each.name for each in parts)
            return f"{'; then '.join(map(_stage_text, way.stages))}; in {names}"
        case _:
            assert_never(way)


def _stage_text(coding: Stage) -> str:
    match coding:
        case Escaping():
            escape, escaped = f"{coding.escape:02X}", " ".join(f"{byte:02X}" for byte, _ in coding.codes)
            if coding.mask:
                return f"{escape} precedes each of {escaped}, which are XORed with {coding.mask:02X}"
            return ", ".join(f"{byte:02X} is sent as {escape} {second:02X}" for byte, second in coding.codes)
        case Insertion():
            return f"a byte {coding.insert:02X} is inserted after every {coding.after.hex(' ').upper()}"
        case Cobs():
            return "COBS removes each 00"
        case Digits():
            return "each byte is two hexadecimal digits"
        case Pair():
            return "each byte is followed by its complement"
        case Add():
            return f"{coding.number:02X} is added to each byte"
        case _:
            assert_never(coding)


def _after_text(way: FrameStuffing) -> str:
    return way.rule.after.hex(" ").upper()


def _start_text(kind: FramePlan) -> str:
    """What frames of a kind begin with, "" if any bytes."""
    first = kind.envelope.parts[0]
    told = "bits of the first byte" if isinstance(first, CellPart) else "the message ids"
    ids = "an address" if isinstance(first, AddressPart) else told
    ids = ids if kind.envelope.starts else ""
    return kind.envelope.preamble.hex(" ").upper() or ids


def receiver_text(frame: FramePlan) -> tuple[str, str]:
    """The strategy of a receiver, and its reason."""
    way = frame.receiver
    beginnings = dict.fromkeys(each for kind in frame.sought if (each := _start_text(kind)))
    preamble = " or ".join(beginnings)
    match way:
        case Hunt():
            return "hunt", (
                f"{preamble} does not occur inside a frame, so each byte is processed once and only the "
                "frame itself is buffered"
            )
        case Rescan():
            if isinstance(frame.end, ByTerminator) and preamble:
                text = f"a frame reaches from {preamble} to the next terminator"
                return "rescan", f"{text}; after a failure the search continues at the next {preamble[:2]}"
            seen = f"{preamble} may also be data" if preamble else "frames do not begin with a constant"
            proof = (
                "a frame with a valid check value but wrong contents is skipped as a whole"
                if way.verified
                else "frames have no check value"
            )
            return "rescan", f"{seen}, so after a failure the search continues at the next byte; {proof}"
        case Marks():
            return "marks", "header and end have a marker bit that all other bytes lack"
        case InStep():
            return "in step", "packets have no delimiter, so both sides must stay in step"
        case Gaps():
            return "gaps", "what lies between two silences is a frame, or one fault"
        case _:
            assert_never(way)


# Walked payloads --------------------------------------------------------------------------------------------


def presence_text(presence: Presence) -> str:
    """What decides whether a field is present: ``if kind is 3..5``."""
    if presence.optional:
        return "if bytes are left"
    return _if_text(presence.when)


def _if_text(tests: Iterable[Test]) -> str:
    return f"if {' and '.join(map(_test_text, tests))}"


def _test_text(test: Test) -> str:
    ranges = " or ".join(span_text(first, last) for first, last in test.ranges)
    return f"{test.value} is {'not ' if test.negated else ''}{ranges}"


def segment_text(segment: Segment) -> str:
    """A segment of a walked payload: its fields, its size, and what decides whether it is present."""
    names = ", ".join(step.name for step in segment.steps)
    run = segment.run
    if segment.records is not None:
        size = "read one by one" if isinstance(segment.records, RecordsStep) else "one"
    elif run is None:
        size = f"{segment.size} bytes" if segment.size != 1 else "1 byte"
    else:
        size = f"{run.item_size}*{run.name}" if run.item_size > 1 else run.name
        size += f" and {segment.terminator.hex().upper()}" if segment.terminator else ""
        if segment.rest is not None:
            rest = size_text(segment.rest)
            size = f"the rest{f' but {rest} bytes' if rest != '0' else ''}"
            size = f"the bytes of {segment.slot}" if segment.counted else size
    return f"{names}: {size}" + (f", {presence_text(segment.presence)}" if segment.presence else "")
