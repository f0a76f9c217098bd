"""Values, memory, refusals and delays of simulated nodes, in every kind of field."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import ModuleType
from typing import Any

import pytest

from qlinkgen.backends.python import load
from qlinkgen.errors import Refused
from qlinkgen.link import MasterEngine, Timing
from qlinkgen.link.codec import Message
from qlinkgen.link.slave import SlaveEngine
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.values import Json
from qlinkgen.plan import plan_of
from qlinkgen.schema import loads
from qlinkgen.sim import SimulationError, VirtualPort, Wire
from qlinkgen.sim.generic import GenericNode
from qlinkgen.sim.memory import Memory
from qlinkgen.sim.refusals import Refusals
from qlinkgen.sim.tables import Access, Table
from qlinkgen.sim.values import Values
from qlinkgen.transport.blocking import BlockingMaster

SCHEMA = """\
qlinkgen: 1
protocol: {name: oven, title: Oven, revision: "1", source: Own design}
byteorder: big
enums: {mode: {type: u8, values: {off: 0, heat: 1}}}
types:
  zone: {fields: {power: u8, target: {type: i16, default: 20}}}
frame:
  parts:
    start: {role: constant, value: 7E 81}
    node: {role: address, type: u8}
    size: {role: length, type: u8, counts: [data]}
    code: {role: message, type: u8}
    data: {role: payload, size: 0..40}
    sum: {role: checksum, type: u8, algorithm: sum8, over: [node, size, code, data]}
bus: {kind: master_slave, nodes: 1..30, baud: 9600, response_within: 5 ms}
defaults: {addressing: node, repeat: safe}
replies:
  nak: {id: 0x7F, fields: {reason: {type: u8, default: 9}}, means: refused}
commands:
  get_status:
    id: 1
    request: {}
    response:
      mode: mode
      position: {type: i16, range: -100..100}
      temperature: {type: i16, scale: 1/10, unit: degC}
      pressure: f32
      label: "text[0..8]"
  get_zones: {id: 2, request: {}, response: {temperatures: "i16[0..8]"}}
  get_first: {id: 3, request: {number: {type: u8, range: 1..8}},
              response: {number: {type: u8, echo: true}, zone: zone, kind: {type: u8, if: {number: 2}}}}
  read: {id: 4, request: {start: u8, count: {type: u8, range: 1..8}}, response: {data: "u16[request.count]"}}
  set: {id: 5, request: {mode: mode, temperature: {type: i16, scale: 1/10, unit: degC}, position: i16},
        response: {}}
  put: {id: 7, request: {number: u8, value: u16}, response: {}}
  puts: {id: 8, request: {first: u8, values: "u16[1..8]"}, response: {}}
  peek: {id: 9, request: {number: u8}, response: {value: u16}}
  low: {id: 10, request: {number: u8}, response: {value: u8}}
  load: {id: 11, request: {page: u8, offset: u8, bytes: "bytes[1..8]"}, response: {}}
  dump: {id: 12, request: {page: u8, offset: u8}, response: {bytes: "bytes[0..4]"}}
  beep: {id: 6, request: {}, response: none}
"""


@pytest.fixture(scope="module")
def protocol() -> Protocol:
    found, faults = loads(SCHEMA, "oven.yaml")
    assert found is not None, faults
    return found


@pytest.fixture(scope="module")
def codec(protocol: Protocol) -> ModuleType:
    return load(protocol)


class Rig:
    """One node, and a master."""

    def __init__(
        self,
        protocol: Protocol,
        codec: ModuleType,
        values: dict[str, dict[str, Json]] | None = None,
        *,
        memory: bool = False,
        tables: Sequence[Mapping[str, Access]] = (),
        refuse: dict[str, float] | None = None,
        delays: dict[str, float] | None = None,
    ) -> None:
        node = GenericNode(
            codec,
            3,
            plan_of(protocol),
            values=Values(protocol, getattr(codec, "RECORDS", {}), values or {}),
            memory=Memory(protocol) if memory else None,
            tables=[Table(protocol, uses) for uses in tables],
            refusals=Refusals(codec, refuse or {}),
        )
        self.codec = codec
        engine = SlaveEngine(codec, node, baud=9600)
        engine.delays = {codec.COMMANDS[name].request: delay for name, delay in (delays or {}).items()}
        wire = Wire(baud=9600)
        wire.attach(engine, "node")
        self.port = VirtualPort(wire)
        self.master = BlockingMaster(MasterEngine(codec, Timing.of(codec, host_slack=1.0)), self.port)

    def ask(self, name: str, **given: object) -> Any:
        return self.master.transact(self.codec.COMMANDS[name].request(node=3, **given)).response


def fields(message: Message) -> dict[str, object]:
    return {name: getattr(message, name) for name in message.FIELDS}


def test_constant_values_of_every_kind(protocol: Protocol, codec: ModuleType) -> None:
    given: dict[str, dict[str, Json]] = {
        "get_status": {
            "mode": "heat",
            "position": "-5",
            "temperature": "21.5",
            "pressure": 0.25,
            "label": "hot",
        },
        "get_zones.response": {"temperatures": "250,251"},
        "get_first": {"zone": {"power": 7}, "kind": 4},
        "read": {"data": [1, 2, 3]},
    }
    rig = Rig(protocol, codec, given)
    status = {"mode": 1, "position": -5, "temperature": 21.5, "pressure": 0.25, "label": "hot"}
    assert fields(rig.ask("get_status")) == status
    assert fields(rig.ask("get_zones")) == {"temperatures": [250, 251]}
    assert fields(rig.ask("read", start=1, count=8)) == {"data": [1, 2, 3, 1, 2, 3, 1, 2]}
    assert fields(rig.ask("read", start=1, count=2)) == {"data": [1, 2]}
    first, second = rig.ask("get_first", number=1), rig.ask("get_first", number=2)
    zone = codec.RECORDS["zone"](power=7, target=20)
    assert fields(first) == {"number": 1, "zone": zone, "kind": None}
    assert fields(second) == {"number": 2, "zone": zone, "kind": 4}


def test_changing_values(protocol: Protocol, codec: ModuleType) -> None:
    given: dict[str, Json] = {
        "position": "ramp:-100..100:10s",
        "temperature": "noise:20:0.5",
        "pressure": "ramp:1..0:2s",
    }
    values = Values(protocol, {}, {"get_status": given})
    found = [values.of("get_status.response", at) for at in (0.0, 5.01, 9.999, 10.0)]
    assert [each["position"] for each in found] == [-100, 0, 100, -100]
    assert [each["pressure"] for each in found] == pytest.approx([1.0, 0.495, 0.0005, 1.0])
    rig = Rig(protocol, codec, {"get_status": given})
    seen = {rig.ask("get_status").temperature for _ in range(50)}
    assert min(seen) >= 19.5
    assert max(seen) <= 20.5
    assert len(seen) > 5
    again = Rig(protocol, codec, {"get_status": given})
    assert {again.ask("get_status").temperature for _ in range(50)} == seen, "the seed decides"


def test_memory(protocol: Protocol, codec: ModuleType) -> None:
    rig = Rig(protocol, codec, {"get_status": {"temperature": "5", "position": "7"}}, memory=True)
    assert rig.ask("get_status").temperature == 5
    rig.ask("set", mode=1, temperature=33.5, position=9)
    status = rig.ask("get_status")
    assert (status.mode, status.temperature) == (1, 33.5)
    assert status.position == 7, "the request has numbers that the answer cannot have"
    assert rig.ask("get_first", number=5).number == 5
    without = Rig(protocol, codec)
    without.ask("set", mode=1, temperature=33.5, position=9)
    assert without.ask("get_status").temperature == 0


def test_tables(protocol: Protocol, codec: ModuleType) -> None:
    registers = {
        "put": Access(["number"], "value"),
        "puts": Access(["first"], "values"),
        "peek": Access(["number"], "value"),
        "read": Access(["start"], "data"),
    }
    pages = {
        "load": Access(["page", "offset"], "bytes"),
        "dump": Access(["page", "offset"], "bytes"),
    }
    rig = Rig(protocol, codec, {"read": {"data": [7]}}, tables=[registers, pages])
    assert rig.ask("peek", number=3).value == 0
    assert rig.ask("read", start=2, count=3).data == [7, 7, 7]
    rig.ask("put", number=3, value=333)
    rig.ask("puts", first=5, values=[55, 66])
    assert rig.ask("read", start=2, count=6).data == [7, 333, 7, 55, 66, 7]
    assert [rig.ask("peek", number=number).value for number in (3, 5, 6)] == [333, 55, 66]
    rig.ask("load", page=1, offset=2, bytes=b"abcdef")
    assert rig.ask("dump", page=1, offset=2).bytes == b"abcd"
    assert rig.ask("dump", page=1, offset=6).bytes == b"ef"
    assert rig.ask("dump", page=0, offset=2).bytes == b""
    other = Rig(protocol, codec, tables=[registers])
    assert other.ask("peek", number=3).value == 0, "each node has its own"


@pytest.mark.parametrize(
    ("uses", "error"),
    [
        ({"putt": Access(["number"], "value")}, "unknown command 'putt'; did you mean put?"),
        ({"put": Access(["numer"], "value")}, "put: the request has no number 'numer'; did you mean number?"),
        ({"get_zones": Access(["x"], "temperatures")}, "get_zones: the request has no number 'x'"),
        ({"peek": Access(["number"], "x")}, "peek: no value or list 'x'; there are number, value"),
        ({"get_first": Access(["number"], "zone")}, "get_first: no value or list 'zone'"),
        (
            {"put": Access(["number"], "value"), "low": Access(["number"], "value")},
            "value cannot have every value that is set; use a table for each",
        ),
        (
            {"load": Access(["page", "offset"], "bytes"), "dump": Access(["offset"], "bytes")},
            "at: 2 and 1 fields; give as many",
        ),
    ],
)
def test_wrong_tables(protocol: Protocol, uses: Mapping[str, Access], error: str) -> None:
    with pytest.raises(SimulationError) as caught:
        Table(protocol, uses)
    assert error in str(caught.value)


def test_refusals(protocol: Protocol, codec: ModuleType) -> None:
    rig = Rig(protocol, codec, {"nak": {"reason": 3}}, refuse={"set": 1, "get_status": 0.5}, memory=True)
    with pytest.raises(Refused, match="refused by node 3: 3;"):
        rig.ask("set", mode=1, temperature=1, position=1)
    reasons = []
    for _ in range(100):
        try:
            assert rig.ask("get_status").mode == 0, "a refused request sets nothing"
        except Refused as error:
            reasons.append(error.reason)
    assert set(reasons) == {"3"}
    assert 30 < len(reasons) < 70


def test_delays(protocol: Protocol, codec: ModuleType) -> None:
    rig = Rig(protocol, codec, delays={"get_zones": 0.5})
    before = rig.port.now()
    rig.ask("get_status")
    between = rig.port.now()
    rig.ask("get_zones")
    assert between - before < 0.1
    assert 0.5 < rig.port.now() - between < 0.6


@pytest.mark.parametrize(
    ("answer", "field", "value", "error"),
    [
        ("get_satus", "mode", 1, "oven has no answer 'get_satus'; did you mean get_status?"),
        ("set.request", "mode", 1, "oven has no answer 'set.request'"),
        ("beep", "x", 1, "beep is not answered"),
        ("get_status", "positon", 1, "get_status.response has no field 'positon'; did you mean position?"),
        ("get_status", "xyz", 1, "get_status.response has no field 'xyz'; its fields are mode, position, "),
        ("set", "x", 1, "set.response has no field 'x'; it has no fields"),
        ("get_status", "mode", "cool", "get_status.response: mode: "),
        ("get_status", "position", "1.5", "get_status.response: position: "),
        ("get_status", "position", 101, "get_status.response: position: 101 is out of range; -100..100"),
        ("get_status", "position", "ramp:0..101:1s", "position: 101 is out of range; -100..100 can be sent"),
        ("get_status", "position", "noise:-99:2", "position: -101 is out of range; -100..100 can be sent"),
        ("get_status", "position", "ramp:0..1:0s", "position: ramp:0..1:0s takes no time; give"),
        ("get_status", "mode", "ramp:0..1:1s", "mode: "),
        ("get_zones", "temperatures", [1] * 9, "temperatures: 9 items; at most 8"),
        ("get_zones", "temperatures", [99999], "temperatures[0]: 99999 is out of range"),
        ("get_first", "zone", {"power": 1, "x": 2}, "zone: a record zone has no 'x'"),
    ],
)  # fmt: skip
def test_wrong_values(protocol: Protocol, answer: str, field: str, value: Json, error: str) -> None:
    with pytest.raises(SimulationError) as caught:
        Values(protocol, {}, {answer: {field: value}})
    assert error in str(caught.value)


def test_a_ramp_is_text_in_a_text(protocol: Protocol) -> None:
    assert (
        Values(protocol, {}, {"get_status": {"label": "ramp:1"}}).of("get_status.response", 9)["label"]
        == "ramp:1"
    )


@pytest.mark.parametrize(
    ("rates", "error"),
    [
        ({"sett": 1.0}, "unknown command 'sett'; did you mean set?"),
        ({"set": 1.5}, "set: 1.5 is not a probability; give 0 to 1"),
        ({"beep": 1.0}, "beep cannot be refused: none of its replies means refused"),
    ],
)
def test_wrong_refusals(codec: ModuleType, rates: dict[str, float], error: str) -> None:
    with pytest.raises(SimulationError) as caught:
        Refusals(codec, rates)
    assert error in str(caught.value)
