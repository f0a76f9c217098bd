"""Packets: nothing marks one; an answer is checked over the request it belongs to."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from qlinkgen.backends.c.framing import struct_parameter
from qlinkgen.backends.c.names import Names, unsigned, unsigned_type
from qlinkgen.backends.c.parts import differs, put_check, refusal
from qlinkgen.backends.c.views import common_view
from qlinkgen.errors import GenerationError
from qlinkgen.model.checksum import Sum
from qlinkgen.plan.check import Check
from qlinkgen.plan.tree import MessagePlan, Plan


def packet_view(plan: Plan) -> dict[str, Any]:
    """What the templates of packets place."""
    prefix, check, most = plan.protocol.name, plan.frame.check, plan.frame.max_payload
    view = common_view(plan) | {
        "buffer_size": max(1, most),
        "reject": f"{prefix}_reject_" if check and check.rejected is not None else "",
        "has_check": check is not None,
        "slave_arguments": f"{prefix}_frame_sum(frame), " if check else "",
        "check_name": "request_check",
        "count_type": unsigned_type(max(8, most.bit_length())),
    }
    return view | (_check(check) if check else {})


def _check(check: Check) -> dict[str, Any]:
    algorithm = check.algorithm
    if not isinstance(algorithm, Sum):
        raise GenerationError(f"{algorithm.name}: the check value of a packet is a sum")
    kind = unsigned_type(algorithm.width)
    return {
        "sum_type": kind,
        "word_type": unsigned_type(max(algorithm.width, 8 * check.word)),
        "word_size": check.word,
        "finished": f"({kind})~sum" if algorithm.complement else "sum",
        "check_size": check.size,
        "put_check": put_check(check, "end", 0, "value"),
        "check_differs": differs(check, "end", 0, "value"),
        "has_rejected": check.rejected is not None,
        "rejected": unsigned(check.rejected or 0, algorithm.width),
        "refused": differs(check, "end", 0, "refused"),
    }


def packet_to_frame(names: Names, message: MessagePlan, view: dict[str, Any]) -> dict[str, Any]:
    """The function that makes a packet."""
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
        return {"parameters": struct, "lines": lines}
    size = "(size_t)size" if stated.fields else "0U"
    whole = f"{names.prefix}_close_(request_sum, {size}, wire, capacity)" if check else "size"
    if stated.fields:
        lines = [f"const int size = {encode}({call}wire, capacity);", f"return (size < 0) ? size : {whole};"]
    else:
        lines = [f"return {whole};"] if check else ["(void)wire;", "(void)capacity;", "return 0;"]
    return {"parameters": struct + (f"{view['sum_type']} request_sum, " if check else ""), "lines": lines}


def packet_from_frame(names: Names, message: MessagePlan, view: dict[str, Any]) -> dict[str, Any]:
    """The function that takes an answer apart; schemas allow answers of fixed size alone."""
    stated, check = message.message, message.envelope.check
    struct = struct_parameter(names, stated, const=False)
    request = "request_sum, " if check else ""
    opened = f"{names.prefix}_open_({request}wire, size, {names.constant(stated)}_MIN_SIZE)"
    lines = [f"return {opened};"]
    if stated.fields:
        size = f"size - {check.size}U" if check else "size"
        lines = [f"const int status = {opened};", *refusal(f"status != {names.upper}_OK", "status")]
        lines.append(f"return {names.function(stated)}_decode({'message, ' if struct else ''}wire, {size});")
    return {"parameters": struct + (f"{view['sum_type']} request_sum, " if check else ""), "lines": lines}


def sizes_by_value(names: Names, messages: Sequence[MessagePlan]) -> list[dict[str, Any]]:
    """Requests grouped by the size of their payload."""
    groups: dict[int, list[str]] = {}
    for message in messages:
        groups.setdefault(message.payload.most, []).append(names.constant(message.message))
    return [{"size": size, "constants": constants} for size, constants in sorted(groups.items())]
