"""A node derived from the schema alone answers every command of every protocol with valid values."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from pathlib import Path

import pytest

from qlinkgen.backends.python import load
from qlinkgen.link import MasterEngine, Timing
from qlinkgen.link.codec import address_of, answers
from qlinkgen.link.slave import Refusal, SlaveEngine
from qlinkgen.plan import plan_of
from qlinkgen.schema import load as load_schema
from qlinkgen.schema import loads
from qlinkgen.sim import VirtualPort, Wire
from qlinkgen.sim.generic import GenericNode
from qlinkgen.sim.refusals import Refusals
from qlinkgen.sim.smallest import required_values
from qlinkgen.sim.values import Values
from qlinkgen.transport.blocking import BlockingMaster
from tests.cli.wire import REPOSITORY

SCHEMAS = [
    REPOSITORY / "schemas" / "qlink.yaml",
    *sorted((REPOSITORY / "tests" / "schemas").glob("*.yaml")),
]


@pytest.mark.parametrize("path", SCHEMAS, ids=lambda path: path.stem)
def test_every_command(path: Path) -> None:
    codec = load(load_schema(path))
    number = codec.BUS.last_node
    node = GenericNode(codec, number)
    for command in codec.COMMANDS.values():
        address = codec.BUS.broadcast if command.addressing == "broadcast" else number
        request = command.request(**{command.request.ADDRESS: address}, **required_values(command.request))
        request.to_frame()
        response = node.handle(request, 0.0)
        if command.response is None:
            assert response is None
            continue
        assert codec.encode(node.example(command))
        if command.steps:
            assert isinstance(response, Generator)
        elif command.many is None:
            assert response is not None
            assert not isinstance(response, list | Iterator)
            assert codec.encode(response)
            assert answers(command, request, request, response)
            assert address_of(response) == number
    assert node.requests == len(codec.COMMANDS)


MANY = """\
qlinkgen: 1
protocol: {name: log, title: Log, revision: "1", source: Manual}
frame:
  parts:
    code: {role: message, type: u8}
    length: {type: u8, counts: [data]}
    data: {role: payload, size: 0..8}
    crc: {type: u16, algorithm: crc-16/modbus, over: [code, length, data]}
bus: {kind: master_slave, baud: 9600, response_within: 10 ms}
defaults: {repeat: safe}
replies: {end: {id: 0x70, fields: {}, means: done}}
commands:
  pair: {id: 1, request: {}, response: {value: u8}, many: {count: 2}}
  some:
    id: 2
    request: {number: {type: u8, range: 1..4}}
    response: {value: u8}
    many: {count: request.number}
  list: {id: 3, request: {}, response: {more: {type: u8, default: 1}, value: u8}, many: {until: {more: 0}}}
  dump: {id: 4, request: {}, response: {value: u8}, many: {until: end}}
  scan: {id: 5, request: {}, response: {value: u8}, many: {within: 50 ms}}
"""


def test_a_master_gets_several_answers() -> None:
    protocol, faults = loads(MANY, "log.yaml")
    assert protocol is not None, faults
    codec = load(protocol)
    wire = Wire(baud=9600)
    wire.attach(SlaveEngine(codec, GenericNode(codec), baud=9600), "node")
    master = BlockingMaster(MasterEngine(codec, Timing.of(codec, host_slack=0.002)), VirtualPort(wire))
    counts = {}
    for name, command in codec.COMMANDS.items():
        given = {"number": 3} if name == "some" else {}
        counts[name] = len(master.transact(command.request(**given)).response)
    assert counts == {"pair": 2, "some": 3, "list": 1, "dump": 1, "scan": 1}


DECIDED = """\
qlinkgen: 1
protocol: {name: heater, title: Heater, revision: "1", source: Manual}
frame:
  parts:
    code: {role: message, type: u8}
    length: {type: u8, counts: [data]}
    number: {role: counter, type: u8, echo: true}
    data: {role: payload, size: 0..8}
    crc: {type: u16, algorithm: crc-16/modbus, over: [code, length, data]}
bus: {kind: master_slave, response_within: 10 ms}
defaults: {repeat: safe}
commands:
  heat:
    id: 1
    request: {class: u8}
    response: {class: {type: u8, echo: true}, delay: {type: u16, if: {class: 2}}}
  read:
    id: 2
    request: {mode: u8}
    response:
      mode: {type: u8, echo: true}
      value:
        switch: mode
        cases: {0: {}, 1: {type: u16, range: 5..9}, 2: {first: u8, last: u8}}
        default: "bytes[1..4]"
"""


def test_fields_that_repeated_values_decide() -> None:
    protocol, faults = loads(DECIDED, "heater.yaml")
    assert protocol is not None, faults
    codec = load(protocol)
    node = GenericNode(codec, plan=plan_of(protocol))
    found: dict[str, list[str]] = {}
    for name, command in codec.COMMANDS.items():
        (key,) = command.request.FIELDS
        answered = [node.handle(command.request(**{key: number}), 0.0) for number in range(4)]
        found[name] = [codec.encode(each)[3:-2].hex() for each in answered]
    assert found["heat"] == ["00", "01", "020000", "03"]
    assert found["read"] == ["00", "010005", "020000", "0300"]


BOUNDED = """\
qlinkgen: 1
protocol: {name: tags, title: Tags, revision: "1", source: Manual}
frame:
  parts:
    code: {role: message, type: u8}
    length: {type: u8, counts: [data]}
    data: {role: payload, size: 0..60}
bus: {kind: master_slave, response_within: 10 ms}
defaults: {addressing: none, repeat: safe}
types: {part: {fields: {kind: {type: u8, range: 1..9}, rest: {type: "bytes[0..8]", if: {kind: 1}}}}}
commands:
  name:
    id: 1
    request: {}
    response: {name: {type: "text[1..8]", terminator: 20}, key: {type: "bytes[2..4]", terminator: 00}}
  parts: {id: 2, request: {}, response: {parts: "part[0..4]"}}
"""


def test_smallest_values_leave_out_the_bytes_that_end_them() -> None:
    protocol, faults = loads(BOUNDED, "tags.yaml")
    assert protocol is not None, faults
    codec = load(protocol)
    node = GenericNode(codec, 0)
    name, parts = (node.handle(each(), 0.0) for each in (codec.NameRequest, codec.PartsRequest))
    assert name == codec.NameResponse(name="0", key=b"\x01\x01")
    assert codec.NameResponse(name="0", key=b"\x01\x01").to_bytes() == b"0 \x01\x01\x00"
    assert parts == codec.PartsResponse(parts=[])


STATED = """\
qlinkgen: 1
protocol: {name: gauge, title: Gauge, revision: "1", source: Manual}
frame:
  parts:
    code: {role: message, type: u8}
    length: {type: u8, counts: [data]}
    status: {type: u8, if: {direction: response}}
    data: {role: payload, size: 0..32}
bus: {kind: master_slave, response_within: 100 ms}
defaults: {repeat: safe}
replies:
  failed: {if: {status: 7}, fields: {reason: u8, why: {type: "text[1..4]", terminator: 20}}}
commands:
  read: {id: 1, request: {}, response: {level: u16, name: "text[0..4]"}}
"""


def test_fields_that_a_refusal_decides() -> None:
    protocol, faults = loads(STATED, "gauge.yaml")
    assert protocol is not None, faults
    codec, plan = load(protocol), plan_of(protocol)
    refusals = Refusals(codec, {"read": 1.0})
    values = Values(protocol, {}, {"read": {"level": 5}})
    for each in (
        GenericNode(codec, plan=plan, refusals=refusals),
        GenericNode(codec, plan=plan, refusals=refusals, values=values),
    ):
        with pytest.raises(Refusal) as refused:
            each.handle(codec.ReadRequest(), 0.0)
        assert codec.encode(refused.value.reply).hex() == "010307005f20"
    usual = GenericNode(codec, plan=plan, values=values).handle(codec.ReadRequest(), 0.0)
    assert usual == codec.ReadResponse(level=5)


def test_defaults_follow_the_values_that_decide_them() -> None:
    protocol, faults = loads(STATED, "gauge.yaml")
    assert protocol is not None, faults
    codec = load(protocol)
    answer = codec.ReadResponse(status=7, why="hot")
    assert (answer.level, answer.name, answer.reason) == (None, None, 0)
    assert answer.to_frame().hex() == "01050700686f7420"
    answer = codec.ReadResponse()
    assert (answer.level, answer.name, answer.reason, answer.why) == (0, "", None, None)
    with pytest.raises(codec.EncodeError, match="level: 1 cannot be sent"):
        codec.ReadResponse(status=7, level=1).to_frame()


def test_what_it_repeats() -> None:
    codec = load(load_schema(REPOSITORY / "schemas" / "qlink.yaml"))
    response = GenericNode(codec, 4).handle(codec.LoopBackRequest(node=4, offset=3, data=b"abc"), 0.0)
    assert response == codec.LoopBackResponse(node=4, offset=3, data=b"abc")
    assert codec.ReadResponse(node=4, **required_values(codec.ReadResponse)).data == b"\0"


def test_a_message_of_no_command_is_not_answered() -> None:
    codec = load(load_schema(REPOSITORY / "tests" / "schemas" / "kitchen_sink.yaml"))
    node = GenericNode(codec, 4)
    engine = SlaveEngine(codec, node)
    engine.receive(codec.MESSAGES["hello"](station=4, serial=1).to_frame(), 0.0)
    assert node.requests == 1
    assert engine.next_timer() is None
