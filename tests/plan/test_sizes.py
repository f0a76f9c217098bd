"""The maximum size of a frame on the wire is exactly the size of the longest frame, with any stuffing."""

from __future__ import annotations

import itertools

import pytest

from qlinkgen.plan import Plan, plan_of
from qlinkgen.plan.codec import Codec
from qlinkgen.schema import loads

_MARK = 0x7E
_SCHEMA = """
qlinkgen: 1
protocol: {name: shape, title: Shape, revision: "1", source: Tests, doc: A shape}
byteorder: big
frame:
  parts:
    start: {role: constant, value: 7E 7E}
    node: {role: address, type: u8}
    id: {role: message, type: u8}
    size: {role: length, type: u8, counts: [COUNTS]}
KIND    data: {role: payload, size: 0..130}
    check: {role: checksum, type: u8, algorithm: sum8, over: [node, id, size, data]}
  stuffing: {after: 0x7E, insert: 0x00, exempt: [start, check]}
bus: {kind: master_slave, nodes: NODES, response_within: 5 ms}
defaults: {addressing: node, repeat: safe}
commands:
  own: {id: ID, request: {a: "bytes[SIZES]"}, response: {}}
"""


def _plan(nodes: str, number: int, sizes: str, constant: str = "", counts: str = "data, check") -> Plan:
    text = (
        _SCHEMA.replace("NODES", nodes)
        .replace("ID", str(number))
        .replace("SIZES", sizes)
        .replace("COUNTS", counts)
    )
    kind = f"    kind: {{role: constant, value: {constant}}}\n" if constant else ""
    protocol, faults = loads(text.replace("KIND", kind), "shape.yaml")
    assert protocol is not None, [str(fault) for fault in faults]
    return plan_of(protocol)


def _longest(plan: Plan) -> int:
    """The longest frame of the request, whose payload consists of stuffed bytes."""
    message = plan.message("own")
    assert message.allowed
    addresses = [at for each in message.allowed.ranges for at in range(each.low, each.high + 1)]
    sizes = range(message.payload.least, message.payload.most + 1)
    codec = Codec(plan)
    return max(
        len(codec.wrap("own", bytes((_MARK,)) * size, address))
        for size, address in itertools.product(sizes, addresses)
    )


@pytest.mark.parametrize("nodes", ["1..125", "1..126", "126..130", "127..130"])
@pytest.mark.parametrize("number", [_MARK - 1, _MARK, _MARK + 1])
def test_an_address_and_an_id_may_be_stuffed(nodes: str, number: int) -> None:
    plan = _plan(nodes, number, "0..2")
    assert plan.message("own").wire_size == _longest(plan)


@pytest.mark.parametrize("counts", ["data, check", "id, data, check"])
@pytest.mark.parametrize("sizes", ["0..124", "123..123", "124..124", "125..125", "126..130", "126..126"])
def test_a_length_may_be_stuffed(sizes: str, counts: str) -> None:
    """The length includes other parts; it is stuffed if it always or sometimes equals the byte."""
    plan = _plan("1..2", 5, sizes, counts=counts)
    assert plan.message("own").wire_size == _longest(plan)


def test_a_constant_may_be_stuffed_as_far_as_is_known() -> None:
    plan = _plan("1..2", 5, "0..2", "7E 02")
    assert plan.message("own").wire_size == _longest(plan) + 1, "02 is counted too"
