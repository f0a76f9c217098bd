"""The same message in construct, interpreted and compiled."""

from __future__ import annotations

from binascii import crc_hqx

from benchmarks import messages
from benchmarks.peer import FIELDS, KEYWORDS, READ_FIELDS, Peer, load


def _crc(data: bytes) -> int:
    return crc_hqx(data, 0xFFFF)


def construct_fields(compiled: bool) -> Peer:
    construct = load("construct")
    fields = construct.Struct(
        "counter" / construct.Int8ub,
        "inputs" / construct.Int8ub,
        "position" / construct.Int32sb,
        "motor_status" / construct.Int16ub,
        "fifo_space" / construct.Int8ub,
    )
    codec = fields.compile() if compiled else fields
    values = dict(zip(FIELDS, messages.RESPONSE, strict=True))
    names = {
        "codec": codec,
        "ready": values,
        "data": messages.RESPONSE_DATA,
        "wire": messages.RESPONSE_WIRE,
        "wrap": messages.wrap,
        "unwrap": messages.unwrap,
    }
    return Peer(
        f"construct, {'compiled' if compiled else 'interpreted'}, frame by hand",
        names,
        encode="wrap(32, 3, codec.build(ready))",
        build=f"wrap(32, 3, codec.build(dict({KEYWORDS})))",
        decode="codec.parse(unwrap(wire)[2])",
        read=f"m = codec.parse(unwrap(wire)[2]); {READ_FIELDS}",
    )


def construct_frame(compiled: bool) -> Peer:
    """Length, command and CRC in construct as well; only the stuffing is done by bytes.replace."""
    construct = load("construct")
    body = construct.Struct(
        "length" / construct.Const(13, construct.Int8ub),
        "command" / construct.Const(32, construct.Int8ub),
        "node" / construct.Int8ub,
        "counter" / construct.Int8ub,
        "inputs" / construct.Int8ub,
        "position" / construct.Int32sb,
        "motor_status" / construct.Int16ub,
        "fifo_space" / construct.Int8ub,
    )
    frame = construct.Struct(
        "preamble" / construct.Const(messages.PREAMBLE),
        "body" / construct.RawCopy(body),
        "crc" / construct.Checksum(construct.Int16ub, _crc, construct.this.body.data),
    )
    values = {"node": messages.NODE, **messages.RESPONSE._asdict()}
    names = {
        "codec": frame.compile() if compiled else frame,
        "ready": {"body": {"value": values}},
        "wire": messages.RESPONSE_WIRE,
        "stuff": lambda raw: messages.PREAMBLE + raw[2:].replace(b"\xa5", b"\xa5\x00"),
        "unstuff": lambda raw: messages.PREAMBLE + raw[2:].replace(b"\xa5\x00", b"\xa5"),
    }
    return Peer(
        f"construct, {'compiled' if compiled else 'interpreted'}, frame too",
        names,
        encode="stuff(codec.build(ready))",
        build=f"stuff(codec.build(dict(body=dict(value=dict(node=3, {KEYWORDS})))))",
        decode="codec.parse(unstuff(wire))",
        read=f"m = codec.parse(unstuff(wire)).body.value; {READ_FIELDS}",
    )
