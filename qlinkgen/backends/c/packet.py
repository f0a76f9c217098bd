"""Packets: frames without a delimiter; the check value of a response covers its request."""

from __future__ import annotations

from collections.abc import Sequence

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.c.check_values import differs, put_check
from qlinkgen.backends.c.crc import finished
from qlinkgen.backends.c.framing import Function, struct_parameter
from qlinkgen.backends.c.names import Names, unsigned, unsigned_type
from qlinkgen.backends.c.places import refusal
from qlinkgen.errors import GenerationError
from qlinkgen.model.checksum import Sum
from qlinkgen.plan.check import Check
from qlinkgen.plan.tree import MessagePlan, Plan


@dataclass(frozen=True, slots=True, kw_only=True)
class PacketCheckView:
    """The check value of a response."""

    sum_type: str
    word_type: str
    word_size: int
    finished: str
    size: int
    put: list[str]
    differs: str
    has_rejected: bool
    rejected: str
    refused: str


@dataclass(frozen=True, slots=True)
class PacketView:
    """Variables of the templates of packets."""

    buffer_size: int
    count_type: str
    check: PacketCheckView | None


@dataclass(frozen=True, slots=True)
class Sized:
    """Requests with the same payload size."""

    size: int
    constants: list[str]


def packet_view(plan: Plan) -> PacketView:
    """The view of packets."""
    check, most = plan.frame.check, plan.frame.max_payload
    return PacketView(
        max(1, most), unsigned_type(max(8, most.bit_length())), _check(check) if check else None
    )


def sum_type(check: Check) -> str:
    """The C type of a sum over request and response."""
    return unsigned_type(check.algorithm.width)


def _check(check: Check) -> PacketCheckView:
    algorithm, kind = check.algorithm, sum_type(check)
    if not isinstance(algorithm, Sum):
        raise GenerationError(f"{algorithm.name}: the check value of a packet must be a sum")
    return PacketCheckView(
        sum_type=kind,
        word_type=unsigned_type(max(algorithm.width, 8 * check.word)),
        word_size=check.word,
        finished=finished(algorithm),
        size=check.size,
        put=put_check(check, "end", 0, "value"),
        differs=differs(check, "end", 0, "value"),
        has_rejected=check.rejected is not None,
        rejected=unsigned(check.rejected or 0, algorithm.width),
        refused=differs(check, "end", 0, "refused"),
    )


def packet_to_frame(names: Names, message: MessagePlan) -> Function:
    """The function that encodes a packet."""
    stated, upper, check = message.message, names.upper, message.envelope.check
    struct = struct_parameter(names, stated, const=True)
    encode, call = f"{names.function(stated)}_encode", "message, " if struct else ""
    if message.direction != "response":
        lines = ["int size;", ""] if stated.fields else []
        lines += [
            *refusal("capacity == 0U", f"{upper}_ERROR_CAPACITY"),
            f"wire[0] = {names.constant(stated)}_ID;",
        ]
        if stated.fields:
            lines.append(f"size = {encode}({call}&wire[1], capacity - 1U);")
        lines.append("return (size < 0) ? size : (size + 1);" if stated.fields else "return 1;")
        return Function(struct, lines)
    size = "(size_t)size" if stated.fields else "0U"
    whole = f"{names.prefix}_close_(request_sum, {size}, wire, capacity)" if check else "size"
    if stated.fields:
        lines = [f"const int size = {encode}({call}wire, capacity);", f"return (size < 0) ? size : {whole};"]
    else:
        lines = [f"return {whole};"] if check else ["(void)wire;", "(void)capacity;", "return 0;"]
    return Function(struct + (f"{sum_type(check.check)} request_sum, " if check else ""), lines)


def packet_from_frame(names: Names, message: MessagePlan) -> Function:
    """The function that decodes a response; schemas allow only responses of fixed size."""
    stated, check = message.message, message.envelope.check
    struct = struct_parameter(names, stated, const=False)
    request = "request_sum, " if check else ""
    opened = f"{names.prefix}_open_({request}wire, size, {names.constant(stated)}_MIN_SIZE)"
    lines = [f"return {opened};"]
    if stated.fields:
        size = f"size - {check.size}U" if check else "size"
        lines = [f"const int status = {opened};", *refusal(f"status != {names.upper}_OK", "status")]
        lines.append(f"return {names.function(stated)}_decode({'message, ' if struct else ''}wire, {size});")
    return Function(struct + (f"{sum_type(check.check)} request_sum, " if check else ""), lines)


def sizes_by_value(names: Names, messages: Sequence[MessagePlan]) -> list[Sized]:
    """Requests grouped by the size of their payload."""
    groups: dict[int, list[str]] = {}
    for message in messages:
        groups.setdefault(message.payload.most, []).append(names.constant(message.message))
    return [Sized(size, constants) for size, constants in sorted(groups.items())]
