"""Values that an encoder must reject: one step out of range, as far as the C type can hold them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.conformance.rows import Right, held, number_bytes, value_sizes
from qlinkgen.backends.conformance.sources import Header
from qlinkgen.model.message import Message
from qlinkgen.model.types import Characters, Float, Scalar
from qlinkgen.plan import MessagePlan
from qlinkgen.plan.payload import Holder, Member, RecordStep, ValueStep


@dataclass(frozen=True, slots=True)
class Unsent:
    """Values that must be rejected, and the error."""

    what: str
    address: int
    values: bytes


def unsent(header: Header, message: MessagePlan, right: Right) -> Iterator[Unsent]:
    """A valid vector once with each number, and the address, out of range by one."""
    for what, values in _spoilt(header, held(message), right.values):
        yield Unsent(what, right.address, values)
    for address in _addresses(header, message.message):
        yield Unsent(f"sent to {address}", address, right.values)


def _spoilt(header: Header, holders: Sequence[Holder], values: bytes) -> Iterator[tuple[str, bytes]]:
    """The values once with each number out of range."""
    at = 0
    presences = [each.presence for each in holders if each.presence is not None and each.presence.slot]
    # Another number selects another case, which the values do not have.
    choosing = {test.value for each in presences for test in each.when}
    for step, size in zip(holders, value_sizes(header, holders, values), strict=True):
        own, after = values[at : at + size], values[at + size :]
        if step.presence is not None or step.name in choosing:
            at += size
            continue
        if isinstance(step, ValueStep | Member):
            for number in _outside(step.number, size):
                yield f"{step.name} is {number}", values[:at] + number_bytes(number, size) + after
        if isinstance(step, RecordStep):
            for what, inner in _spoilt(header, step.record.payload.settable, own):
                yield f"{step.name}.{what}", values[:at] + inner + after
        at += size


def _outside(scalar: Scalar, size: int) -> Iterator[int]:
    """The nearest numbers out of range that the struct can hold; none for a bool, NaN for a float."""
    if scalar.meaning == "bool":
        return
    if isinstance(scalar.meaning, Characters):
        yield scalar.meaning.excluded[-1] if scalar.meaning.excluded else 0x80
        return
    if isinstance(scalar.meaning, Float):
        yield from [scalar.meaning.raw(math.nan)] if scalar.meaning.bounds else []
        return
    least, most = (
        (-(1 << 8 * size - 1), (1 << 8 * size - 1) - 1) if scalar.signed else (0, (1 << 8 * size) - 1)
    )
    if scalar.minimum > least:
        yield scalar.minimum - 1
    if scalar.maximum < most:
        yield scalar.maximum + 1


def _addresses(header: Header, message: Message) -> Iterator[int]:
    if not header.address or not message.addresses:
        return
    least, most = min(first for first, _ in message.addresses), max(last for _, last in message.addresses)
    if least > 0:
        yield least - 1
    if most < (1 << header.address_bits) - 1:
        yield most + 1
