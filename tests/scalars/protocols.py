"""Small protocols around the fields of one request."""

from __future__ import annotations

from qlinkgen.errors import Fault
from qlinkgen.model.protocol import Protocol
from qlinkgen.schema import loads

_SCHEMA = """\
qlinkgen: 1
protocol: {{name: probe, title: Probe, revision: "1", source: this test, doc: Fields.}}
byteorder: big
{types}
frame:
  parts:
    start: {{role: constant, value: 7E}}
    size: {{role: length, type: u16, counts: [data]}}
    id: {{role: message, type: u8}}
    data: {{role: payload, size: 0..600}}
    sum: {{role: checksum, type: u8, algorithm: sum8, over: [size, id, data]}}
bus: {{kind: master_slave, response_within: 1 ms}}
defaults: {{repeat: safe}}
commands:
  put:
    id: 1
    doc: D.
    request: {request}
    response: {response}
"""


def text_of(request: str, *, types: str = "", response: str = "{}") -> str:
    """The text of a schema; ``types`` are more mappings at its top level."""
    return _SCHEMA.format(request=request, types=types, response=response)


def protocol_of(request: str, *, types: str = "", response: str = "{}") -> Protocol:
    """A valid protocol."""
    protocol, faults = loads(text_of(request, types=types, response=response), "probe.yaml")
    assert protocol, [str(fault) for fault in faults]
    return protocol


def faults_of(request: str, *, types: str = "", response: str = "{}") -> list[Fault]:
    """What lint says."""
    return loads(text_of(request, types=types, response=response), "probe.yaml")[1]
